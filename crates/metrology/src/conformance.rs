//! Decides whether a measured value with a stated uncertainty conforms to a tolerance, and with which risk.
//!
//! Lengths in m. ISO 14253-1:2013: conformance is proved inside the tolerance zone less the expanded uncertainty U at each
//! limit, non-conformance outside the zone enlarged by U, and in between neither can be proved. A limit may be infinite
//! where a tolerance is one-sided.
//!
//! | [`DecisionRule`] | accepted within T less | refuted beyond T plus | consumer's risk at the limit |
//! |---|---|---|---|
//! | ISO 14253-1:2013 | U = k u | U | Φ(−k): 2.3 % for k = 2 |
//! | simple acceptance (JCGM 106:2012, 8.2) | 0 | 0 | 50 % |
//! | guarded acceptance (JCGM 106:2012, 8.3.2) | z u, z the quantile of 1 − risk | 0 | as stated |
//!
//! The rule of ISO 14253-1 is that of its editions of 1998 and 2013, with U itself as the guard band. The edition of 2017 asks by default for a
//! conformance probability of 95 %, a guard band of 1.65 u where the zone is wide: what the rule with k = 2 accepts meets it as well, and
//! guarded acceptance with a risk of 5 % accepts just what it asks for.
//!
//! Risks are the specific consumer's risk (JCGM 106:2012, 3.3.13) of a normally distributed error with no other knowledge
//! of the item.

use crate::statistics::{normal_cdf, normal_quantile};
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

/// How the uncertainty of a reading enters the decision on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum DecisionRule {
    /// ISO 14253-1:2013: U is the guard band of acceptance and of rejection.
    #[default]
    Iso14253,
    /// The tolerance limits themselves (JCGM 106:2012, 8.2).
    SimpleAcceptance,
    /// Guarded acceptance (JCGM 106:2012, 8.3.2).
    GuardBand {
        /// Largest specific consumer's risk, above 0 and at most 0.5.
        consumers_risk: f64,
    },
}

/// Widths, m, by which a decision rule moves the tolerance limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardBands {
    /// Inwards: what is accepted.
    pub acceptance: f64,
    /// Outwards: what is refuted.
    pub rejection: f64,
}

impl DecisionRule {
    /// The guard bands for a standard uncertainty `standard` (m) with coverage factor `factor`.
    pub fn guard_bands(&self, standard: f64, factor: f64) -> GuardBands {
        let (acceptance, rejection) = match *self {
            Self::Iso14253 => (factor * standard, factor * standard),
            Self::SimpleAcceptance => (0.0, 0.0),
            Self::GuardBand { consumers_risk } => {
                (normal_quantile(1.0 - consumers_risk) * standard, 0.0)
            }
        };
        GuardBands {
            acceptance,
            rejection,
        }
    }

    /// Its name with the edition of the standard.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Iso14253 => "ISO 14253-1:2013",
            Self::SimpleAcceptance => "simple acceptance (JCGM 106:2012, 8.2)",
            Self::GuardBand { .. } => "guarded acceptance (JCGM 106:2012, 8.3.2)",
        }
    }

    /// Largest specific consumer's risk of what it accepts: that of a reading at the acceptance limit.
    pub fn largest_risk(&self, factor: f64) -> f64 {
        match *self {
            Self::Iso14253 => normal_cdf(-factor),
            Self::SimpleAcceptance => 0.5,
            Self::GuardBand { consumers_risk } => consumers_risk,
        }
    }
}

/// Probability that the true value lies outside the tolerance, of a normally distributed error of standard uncertainty
/// `standard` (m; 0: none): JCGM 106:2012, 7.2.
pub fn nonconformity_probability(value: f64, standard: f64, tolerance: &Tolerance) -> f64 {
    if standard > 0.0 {
        let below = normal_cdf((tolerance.lower - value) / standard);
        below + normal_cdf((value - tolerance.upper) / standard)
    } else {
        f64::from(!(tolerance.lower <= value && value <= tolerance.upper))
    }
}

/// E_n score of a reading against a reference, both with expanded uncertainties (m): their difference over the root sum
/// of squares (ISO 13528:2015, 9.7). Above 1 they contradict each other; NaN where neither has an uncertainty and they
/// agree.
pub fn normalised_error(reading: (f64, f64), reference: (f64, f64)) -> f64 {
    (reading.0 - reference.0).abs() / reading.1.hypot(reference.1)
}

/// Whether a reference refutes a reading, deviations (m, point by point or of one size) and expanded uncertainty (m) of
/// each: by E_n > 1, or because the reference proves a deviation beyond the tolerance ± `accepted` (m) that the reading was
/// accepted by. Gives the largest E_n score; `None` where nothing is refuted.
pub fn contradiction(
    reading: (&[f64], f64),
    reference: (&[f64], f64),
    accepted: Option<f64>,
) -> Option<f64> {
    let pairs = reading.0.iter().zip(reference.0);
    let scores =
        pairs.map(|(own, other)| normalised_error((*own, reading.1), (*other, reference.1)));
    let score = scores.fold(0.0, f64::max);
    let largest = reference
        .0
        .iter()
        .fold(0.0, |most: f64, one| most.max(one.abs()));
    let outside = accepted.is_some_and(|tolerance| largest > tolerance + reference.1);
    (score > 1.0 || outside).then_some(score)
}

/// ISO 14253-1:2013: conformance of `value` (m) measured with expanded uncertainty `expanded` (m).
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

    /// Against integration of the density with the trapezoidal rule, which shares nothing with the distribution function.
    #[test]
    fn the_risk_at_the_acceptance_limit_is_the_one_that_the_rule_states() {
        let standard = 1.5e-6;
        let outside = |value: f64| {
            let steps = 400_000;
            let width = 12.0 * standard / f64::from(steps);
            let density = |x: f64| {
                let t = (x - value) / standard;
                (-0.5 * t * t).exp() / (standard * std::f64::consts::TAU.sqrt())
            };
            (0..steps)
                .map(|i| width * density(SIZE.upper + width * f64::from(i)))
                .sum::<f64>()
        };
        for rule in [
            DecisionRule::Iso14253,
            DecisionRule::SimpleAcceptance,
            DecisionRule::GuardBand {
                consumers_risk: 0.01,
            },
        ] {
            let limit = SIZE.upper - rule.guard_bands(standard, 2.0).acceptance;
            let (stated, integrated) = (rule.largest_risk(2.0), outside(limit));
            assert!(
                (stated - integrated).abs() < 1e-4,
                "{rule:?}: {stated}, {integrated}"
            );
            let risk = nonconformity_probability(limit, standard, &SIZE);
            assert!((risk - stated).abs() < 1e-6, "{rule:?}: {risk}");
        }
        assert_eq!(nonconformity_probability(10.1e-6, 0.0, &SIZE), 1.0);
        assert_eq!(nonconformity_probability(10e-6, 0.0, &SIZE), 0.0);
    }

    #[test]
    fn a_reading_beyond_both_uncertainties_contradicts_its_reference() {
        assert!((normalised_error((71e-6, 3e-6), (0.0, 4e-6)) - 14.2).abs() < 1e-9);
        assert!(normalised_error((6e-6, 4.4e-6), (0.0, 12e-6)) < 1.0);
        assert_eq!(normalised_error((1e-6, 0.0), (0.0, 0.0)), f64::INFINITY);
        let refuted = |reading: f64, reference: f64, accepted| {
            contradiction((&[reading], 4e-6), (&[reference], 3e-6), accepted)
        };
        assert_eq!(refuted(0.0, 4.9e-6, Some(10e-6)), None);
        assert!(refuted(0.0, 5.1e-6, None).is_some());
        // Within both uncertainties, and yet proved to be out of tolerance.
        assert!(refuted(9.9e-6, 13.1e-6, Some(10e-6)).is_some());
        assert_eq!(refuted(9.9e-6, 12.9e-6, Some(10e-6)), None);
        assert_eq!(refuted(9.9e-6, 13.1e-6, None), None);
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
