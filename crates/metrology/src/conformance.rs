//! Decides whether a measured value with a stated uncertainty conforms to a tolerance.
//!
//! Lengths in m. ISO 14253-1: conformance is proved inside the tolerance zone less the expanded uncertainty U at each
//! limit, non-conformance outside the zone enlarged by U, and in between neither can be proved. A limit may be infinite
//! where a tolerance is one-sided.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Limits of a characteristic in m, absolute or as deviations, in the same sense as the value judged by them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tolerance {
    /// Lower limit; −∞ if there is none.
    pub lower: f64,
    /// Upper limit; +∞ if there is none.
    pub upper: f64,
}

/// What can be proved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Conformance {
    /// Inside the acceptance zone.
    Conforms,
    /// Inside the rejection zone.
    DoesNotConform,
    /// Within U of a limit.
    Indeterminate,
}

/// Arguments that allow no statement.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ConformanceError {
    /// The value is NaN or infinite.
    #[error("the measured value is not a number")]
    NotFinite,
    /// U is negative, NaN or infinite.
    #[error("the expanded uncertainty is {0} m")]
    Uncertainty(f64),
    /// The limits are NaN or in the wrong order.
    #[error("the tolerance runs from {lower} m to {upper} m")]
    Tolerance {
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
}

/// ISO 14253-1: conformance of `value` (m) measured with expanded uncertainty `expanded` (m).
///
/// # Errors
/// See [`ConformanceError`].
pub fn conformance(
    value: f64,
    expanded: f64,
    tolerance: &Tolerance,
) -> Result<Conformance, ConformanceError> {
    if !value.is_finite() {
        return Err(ConformanceError::NotFinite);
    }
    if !(expanded >= 0.0 && expanded.is_finite()) {
        return Err(ConformanceError::Uncertainty(expanded));
    }
    let Tolerance { lower, upper } = *tolerance;
    if lower.is_nan() || upper.is_nan() || lower > upper {
        return Err(ConformanceError::Tolerance { lower, upper });
    }
    Ok(if lower + expanded <= value && value <= upper - expanded {
        Conformance::Conforms
    } else if value < lower - expanded || value > upper + expanded {
        Conformance::DoesNotConform
    } else {
        Conformance::Indeterminate
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Tolerance = Tolerance {
        lower: -10e-6,
        upper: 10e-6,
    };

    #[test]
    fn zones_meet_without_gap_or_overlap() {
        use Conformance::{Conforms, DoesNotConform, Indeterminate};
        for (value, expected) in [
            (0.0, Conforms),
            (7.9e-6, Conforms),
            (8.1e-6, Indeterminate),
            (10e-6, Indeterminate),
            (11.9e-6, Indeterminate),
            (12.1e-6, DoesNotConform),
            (-7.9e-6, Conforms),
            (-8.1e-6, Indeterminate),
            (-12.1e-6, DoesNotConform),
        ] {
            assert_eq!(conformance(value, 2e-6, &SIZE), Ok(expected), "{value}");
        }
        // Without uncertainty the limits themselves conform and nothing is indeterminate.
        assert_eq!(conformance(10e-6, 0.0, &SIZE), Ok(Conforms));
        assert_eq!(conformance(10.1e-6, 0.0, &SIZE), Ok(DoesNotConform));
    }

    #[test]
    fn an_uncertainty_beyond_half_the_tolerance_proves_no_conformance() {
        assert_eq!(
            conformance(0.0, 10.1e-6, &SIZE),
            Ok(Conformance::Indeterminate)
        );
    }

    #[test]
    fn one_sided_tolerances_and_bad_arguments() {
        let roundness = Tolerance {
            lower: f64::NEG_INFINITY,
            upper: 5e-6,
        };
        assert_eq!(
            conformance(1e-6, 1e-6, &roundness),
            Ok(Conformance::Conforms)
        );
        assert_eq!(
            conformance(f64::NAN, 1e-6, &SIZE),
            Err(ConformanceError::NotFinite)
        );
        assert_eq!(
            conformance(0.0, -1e-6, &SIZE),
            Err(ConformanceError::Uncertainty(-1e-6))
        );
        let inverted = Tolerance {
            lower: 1.0,
            upper: 0.0,
        };
        assert!(conformance(0.5, 0.0, &inverted).is_err());
    }
}
