//! In which order are the points of a part measured? The shortest open path with given ends.
//!
//! ```text
//!   costs (m or s)        rules                              order
//!        0  1  2  3       start at 0                         0 ── 3
//!     0  .  4  9  2       1 before 2 (precedence)                 │
//!     1  4  .  3  7  +    stages: datum features first   ->       1 ── 2
//!     2  9  3  .  5       one of several nodes per point
//!     3  2  7  5  .       (poses of the probe)               cost, proven shortest or not
//! ```
//!
//! The crate knows numbers only: no machine, no geometry, no clock and no file. A [`CostMatrix`] holds what each move
//! costs, in the caller's unit (metres of path, seconds of the axes), symmetric or not; a [`Problem`] adds ends, the order
//! to beat and the rules; [`solve`] searches. A deadline is the caller's closure, randomness the caller's seed, so the same
//! problem, seed and budget give the same path on every run. A [`Search`] is the same in slices: a value between any two
//! of them, which can be stored.
//!
//! Up to [`EXACT_LIMIT`] points the answer is exact (dynamic programming; M. Held and R. M. Karp, "A dynamic programming
//! approach to sequencing problems", 1962). Above, it is an iterated local search: exchanges of up to five edges (S. Lin and
//! B. W. Kernighan, 1973; K. Helsgaun, 2000), local double bridges as kicks, acceptance as in simulated annealing; large
//! symmetric problems without rules by sequences of exchanges, in walks that accept what is little longer than their shortest path
//! (record-to-record travel, G. Dueck, 1993). The answer is never longer than the order given.
//!
//! Problems are those of the literature: an open path is a travelling salesman problem with a dummy node; alternative poses
//! make it a generalised one (GTSP), precedence a sequential ordering problem (SOP).
//!
//! ```
//! use planning::{CostMatrix, Options, Problem, solve};
//!
//! // Four touches on a line, listed back and forth, and the probe stands at the first; m.
//! let costs = CostMatrix::euclidean(&[
//!     [0.00, 0.0, 0.0],
//!     [0.03, 0.0, 0.0],
//!     [0.01, 0.0, 0.0],
//!     [0.02, 0.0, 0.0],
//! ])?;
//! let solution = solve(&Problem::new(costs).starting_at(0), &Options::default(), &mut |_| true)?;
//! assert_eq!(solution.order, [0, 2, 3, 1]);
//! assert!(solution.optimal && (solution.cost - 0.03).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod costs;
mod exact;
mod options;
mod problem;
mod search;
mod solve;

pub use costs::{CostError, CostMatrix};
pub use exact::EXACT_LIMIT;
pub use options::{Options, Progress};
pub use problem::{Problem, ProblemError};
pub use solve::{Search, Solution, solve};
