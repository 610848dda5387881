//! Why the settings of `analysis` cannot be used.

use metrology::uncertainty::UncertaintyError;

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A number out of range.
    #[error("analysis.{key} = {value} must be a finite number {more}")]
    Number {
        /// The key.
        key: String,
        /// As written.
        value: f64,
        /// What else it must be.
        more: &'static str,
    },
    /// A line of the budget that is none.
    #[error(
        "analysis.common: {0:?} needs one of standard_uncertainty_um, deviation_um with readings, half_width_um with distribution"
    )]
    Contribution(String),
    /// A line of the budget with a number that cannot be used.
    #[error("analysis.common: {0}")]
    Uncertainty(#[from] UncertaintyError),
    /// Two fits of one feature.
    #[error("analysis.fits: feature {0:?} is listed twice")]
    FitTwice(String),
    /// No method, or two.
    #[error("analysis.alignment needs either datums or best_fit")]
    Method,
    /// An unknown displacement.
    #[error("analysis.alignment.free = {0:?} is none of x, y, z, a, b, c")]
    Displacement(String),
    /// A datum system is rigid.
    #[error(
        "analysis.alignment.free belongs to best_fit: a datum system aligns all six degrees of freedom"
    )]
    FreeDatums,
}
