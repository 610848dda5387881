//! The node `analysis`.
//!
//! - `fits`: criteria, uncertainties and datums against shapes whose answer is known
//! - `robot`: the machine of the tests
//! - `steps`: step by step: from touches to deviations and sizes
//! - `tolerances`: geometrical tolerances, and how often the stated uncertainty holds the truth

mod fits;
mod robot;
mod steps;
mod tolerances;
