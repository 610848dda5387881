//! What does a FANUC or SINUMERIK program do? Interpreters that answer without a controller.
//!
//! `programs` writes programs for machines that no test can reach. The interpreters here execute such a program block by
//! block on axes whose motion a simulated probe answers, so that a test can compare what the program *does* with the plan it
//! was written from. They share no code with the writers except the reader's error type. Only tests depend on this crate; no
//! command of `probecell` does.
//!
//! ```text
//! program text --load--> blocks --run--> moves, skip moves, printed lines --> End
//!                                          |        ^
//!                                          v        |
//!                                      trait Probe: the part under test
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`control`] | positions, the [`control::Probe`] that answers a skip move, events, errors, calls |
//! | [`fanuc`] | FANUC custom macro B |
//! | [`sinumerik`] | SINUMERIK 840D |
//! | [`arithmetic`] | functions and operators that both languages share |
//!
//! Positions are programmed positions in mm and degrees, without work and tool offsets.
//!
//! ```
//! use controller_oracle::{control::{End, Position, Probe}, fanuc::Interpreter};
//!
//! /// A wall at X = 10 mm.
//! struct Wall;
//!
//! impl Probe for Wall {
//!     fn skip(&mut self, _from: &Position, to: &Position) -> Option<Position> {
//!         (to[&'X'] >= 10.0).then(|| Position::from([('X', 10.0)]))
//!     }
//! }
//!
//! let mut controller = Interpreter::new(&['X']);
//! controller.load("O0001\nG31X25.F100.\n#100=#5061\nM30\n")?;
//! let (end, _events) = controller.run(1, &mut Wall)?;
//! assert_eq!(end, End::Finished);
//! assert_eq!(controller.variables[&100], 10.0);
//! # Ok::<(), controller_oracle::control::RunError>(())
//! ```

pub mod arithmetic;
pub mod control;
pub mod fanuc;
mod reader;
pub mod sinumerik;
