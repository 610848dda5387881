//! Discrepancy processes: Gaussian processes over the rows that stand for what no candidate explains.

mod kind;
mod process;
mod tridiagonal;

pub use kind::{Covariate, Kind};
pub use process::{Discrepancy, Projected, leading_columns};
