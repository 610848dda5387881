//! Decides in which order the points of a part are measured: the shortest open path with given ends.
//!
//! The crate knows numbers only. A [`CostMatrix`] says what each move costs, as metres of path or as seconds of the
//! real axes; a [`Problem`] adds the ends, the order to beat and the constraints; [`solve`] searches. It reads no
//! clock and no file: a deadline is the caller's closure, randomness is the caller's seed, so the same problem, seed
//! and budget give the same path on every run. A [`Search`] is the same in slices, a value between any two of them.
//!
//! Up to [`EXACT_LIMIT`] points the answer is exact (dynamic programming, Held and Karp 1962); above, an iterated
//! local search runs until its budget ends or the caller stops it. The answer is never longer than the order given.

mod axes;
mod check;
mod costs;
mod exact;
mod moves;
mod problem;
mod resume;
mod search;
mod solids;
mod solve;

pub use axes::{Axes, AxesError, Axis};
pub use check::{Collision, check_moves};
pub use costs::{CostError, CostMatrix};
pub use exact::EXACT_LIMIT;
pub use moves::{
    Clearances, LimitError, MoveError, Station, Touch, Workspace, check_limits, path_length,
};
pub use problem::{Problem, ProblemError};
pub use resume::{Remainder, cheapest_revisit};
pub use solids::{Solid, StylusShape, Vector};
pub use solve::{Options, Progress, Search, Solution, solve};
