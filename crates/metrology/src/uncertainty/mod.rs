//! Evaluation of measurement uncertainty: budgets, linear propagation, and Monte Carlo.
//!
//! ```text
//!   touches ─┬─ smooth result (least squares) ── linear::contributions ─┐
//!            └─ extreme touches decide (zones) ── simulate ─────────────┤
//!   what all touches share (calibration, temperature) ── Budget ────────┼─ Budget::combine ─ u, ν_eff, k, U
//!   alignment ── linear::propagate ─────────────────────────────────────┘
//!   results that share a component ── Components::linear_combination
//! ```
//!
//! | question | answer | source |
//! |---|---|---|
//! | several independent inputs, one value | [`Budget::combine`]: u, effective degrees of freedom, coverage factor | JCGM 100 (GUM) 5.1.2, G.4.1 (Welch–Satterthwaite), G.3.2 (Student's t) |
//! | inputs that are correlated | [`propagate`] | GUM 5.2.2; JCGM 102 6.2 |
//! | values that share a component | [`Components`] | GUM 5.2.2, F.1.2.3 |
//! | a model without derivatives | [`contributions`] | GUM 5.1.3 note 2 |
//! | a model that is not linear within its uncertainties | [`simulate`], trials until stable | JCGM 101 7.9, JCGM 102 7.8 |
//!
//! Units are those of the quantities. Everything is deterministic: random sequences start from a seed that is passed in.
//! The module judges nothing: for conformance see [`crate::conformance`].
//!
//! A diameter from touches that repeat to 0.6 µm, found in ten readings, with a calibrated stylus:
//!
//! ```
//! use metrology::uncertainty::{Budget, Coverage, Input};
//!
//! let budget = Budget::default()
//!     .with("touches", Input::Readings { deviation: 0.6e-6, count: 10 }, 1.0)
//!     .with("stylus", Input::Normal { standard: 0.3e-6, degrees_of_freedom: 4.0 }, 2.0);
//! let stated = budget.combine(Coverage::Probability(0.95))?;
//! assert_eq!(format!("{:.2} µm", stated.standard * 1e6), "0.63 µm");
//! assert_eq!(format!("{:.1}", stated.degrees_of_freedom), "4.8");
//! assert_eq!(format!("{:.1} µm", stated.expanded * 1e6), "1.6 µm");
//! # Ok::<(), metrology::uncertainty::UncertaintyError>(())
//! ```

mod budget;
mod components;
mod input;
mod linear;
mod simulation;

pub use budget::{Budget, Contribution, Coverage, Uncertainty};
pub use components::Components;
pub use input::Input;
pub use linear::{contributions, propagate};
pub use simulation::{Simulation, Stability, simulate};

use thiserror::Error;

/// Why no uncertainty can be stated.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum UncertaintyError {
    /// A standard uncertainty is negative or not finite.
    #[error("the standard uncertainty of {0} is {1}; it must be finite and not negative")]
    Standard(String, f64),
    /// Degrees of freedom are not positive.
    #[error("the degrees of freedom of {0} are {1}; they must be above 0")]
    DegreesOfFreedom(String, f64),
    /// A sensitivity is NaN or infinite.
    #[error("the sensitivity to {0} is not a finite number")]
    Sensitivity(String),
    /// The coverage probability is outside (0, 1), or the coverage factor is not positive.
    #[error(
        "the coverage asked for is {0:?}; a probability must lie between 0 and 1, a factor above 0"
    )]
    Coverage(Coverage),
    /// Matrix sizes that do not fit.
    #[error("a covariance of {rows} × {columns} does not fit {inputs} inputs")]
    Shape {
        /// Rows given.
        rows: usize,
        /// Columns given.
        columns: usize,
        /// Inputs of the model.
        inputs: usize,
    },
    /// The model has no finite value within the uncertainty of an input.
    #[error("the model has no value within the uncertainty of input {0}")]
    Undefined(usize),
    /// The model has too often no value for draws of its inputs.
    #[error("the model has no value in {undefined} of {trials} trials")]
    TrialsUndefined {
        /// Trials without a finite value.
        undefined: usize,
        /// All trials.
        trials: usize,
    },
}
