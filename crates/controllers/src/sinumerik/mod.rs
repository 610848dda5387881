//! SINUMERIK: measuring programs out, and an interpreter that proves what they do.
//!
//! | module | what it holds |
//! |---|---|
//! | [`expression`] | numbers, texts, variables, functions, comparisons |
//! | [`interpreter`] | programs, calls, branches, moves, touches, lines written |
//! | [`program`] | a measuring program from an inspection plan |
//! | [`decision`] | the programs that decide after a measured size |
//!
//! Lengths are mm in the programs, as everywhere in a controller's text.

mod block;
pub mod decision;
pub mod expression;
mod flow;
pub mod interpreter;
mod memory;
pub mod program;

pub use interpreter::Interpreter;
pub use memory::Variables;
