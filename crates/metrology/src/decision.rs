//! Decides what follows the measurement of a size: qualified, recut with a corrected tool, or stop.
//!
//! Lengths in m; sizes and wear are diametral. `docs/source_systems.md, A.4`: the decision table of the turn-mill's
//! macro, first match wins, with e = measured − drawing size rounded to 1e-6 mm, s = +1 for an outer feature and −1
//! for a bore, and the X-wear register W of the cutting tool. All comparisons are made in whole nanometres, so a size
//! exactly on a limit is inside it.
//!
//! The table takes the reading as true: a probe error passes through it into the part (see [`crate::probe_model`]). The
//! uncertainty of the reading enters by the guard bands of a decision rule ([`crate::conformance::DecisionRule`]), which
//! narrow what qualifies and what is rejected; in between a size that no recut can save is indeterminate. Without guard
//! bands the table is the source's.
//!
//! ```
//! use metrology::decision::{Case, DecisionLimits, Policy, Side, Verdict, decide};
//!
//! // A shaft of 19.800 mm that came out 11 µm too large, by a tool whose wear offset is still 0.
//! let case = Case { size: Some(19.811e-3), nominal: 19.8e-3, side: Side::Outer, wear: 0.0, corrections: 0 };
//! let decision = decide(&case, &DecisionLimits::default(), Policy::Compensate)?;
//! assert_eq!(decision.verdict, Verdict::Compensable);
//! assert_eq!(decision.new_wear, -11e-6);
//! # Ok::<(), metrology::decision::DecisionError>(())
//! ```

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// On which side of the surface the material lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// A shaft or a distance across flats: too large means material is left (s = +1).
    Outer,
    /// A bore: too small means material is left (s = −1).
    Bore,
}

impl Side {
    /// s of the decision table.
    pub fn sign(self) -> f64 {
        match self {
            Self::Outer => 1.0,
            Self::Bore => -1.0,
        }
    }
}

/// What happens to a feature that a corrected recut can save.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Policy {
    /// Correct the tool, recut, measure again.
    #[default]
    Compensate,
    /// Stop, as the macro's prose says; the wear register stays as it is.
    Literal,
}

/// Limits of the decision, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DecisionLimits {
    /// t: half width of the tolerance.
    pub tolerance: f64,
    /// g: |e| ≤ t − g qualifies; 0 by simple acceptance.
    pub acceptance_guard: f64,
    /// h: an error beyond t + h is proved to be outside; 0 by simple acceptance.
    pub rejection_guard: f64,
    /// W_min: lowest wear value of an outer feature's tool, negative; a bore's tool is held at −W_min from above.
    pub wear_limit: f64,
    /// N_max: corrections after which the loop gives up.
    pub max_corrections: u32,
}

impl Default for DecisionLimits {
    /// The source's cell: ±0.010 mm, −0.110 mm, five corrections.
    fn default() -> Self {
        Self {
            tolerance: 10e-6,
            acceptance_guard: 0.0,
            rejection_guard: 0.0,
            wear_limit: -110e-6,
            max_corrections: 5,
        }
    }
}

/// A measured size, and what is known of the feature and of the tool that cut it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// m; the measured size (#600 of the macro). `None`, or a size that is not finite: the measurement is invalid.
    pub size: Option<f64>,
    /// m; drawing size.
    pub nominal: f64,
    /// On which side of the surface the material lies.
    pub side: Side,
    /// m; W, wear value of the cutting tool that is in force.
    pub wear: f64,
    /// Corrections already made to this feature.
    pub corrections: u32,
}

/// The rows of the decision table, in order of gravity: the gravest verdict of a measurement decides on the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Verdict {
    /// Row 1: |e| ≤ t − g.
    Qualified,
    /// Row 5: a corrected recut reaches the size.
    Compensable,
    /// Row 4: the permitted corrections are spent.
    NotConverged,
    /// Within a guard band, and no recut can save it: conformity is neither proved nor refuted.
    Indeterminate,
    /// Row 3: the correction would pass the wear limit.
    ToolWorn,
    /// Row 2: too much was cut.
    OvercutNotCompensable,
    /// Row 0.
    MeasurementInvalid,
}

/// What the cell does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Action {
    /// Continue with the next pass.
    NextPass,
    /// Stop and leave everything as it is.
    Stop,
    /// Stop and reject the part.
    Reject,
    /// Stop and change the insert.
    ChangeInsert,
    /// Write the new wear value, recut and measure again.
    Recut,
}

/// The outcome of [`decide`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// The first row that matched.
    pub verdict: Verdict,
    /// What follows from it under the policy.
    pub action: Action,
    /// e in m, rounded to 1e-9 m; `None` if the measurement is invalid.
    pub error: Option<f64>,
    /// W in m after the decision; the value passed in unless `action` is [`Action::Recut`].
    pub new_wear: f64,
}

/// Limits or arguments no decision can be made with.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DecisionError {
    /// A size, wear value or limit is NaN or infinite.
    #[error("{0} is not a number")]
    NotFinite(&'static str),
    /// The tolerance is negative.
    #[error("the tolerance is negative: {0} m")]
    NegativeTolerance(f64),
    /// A guard band is negative.
    #[error("the guard band is negative: {0} m")]
    NegativeGuard(f64),
    /// The wear limit is positive.
    #[error("the wear limit must not be positive: {0} m")]
    PositiveWearLimit(f64),
}

/// Whole nanometres (1e-6 mm), the resolution of the decision.
fn nanometres(metres: f64) -> f64 {
    (metres * 1e9).round()
}

/// Applies the decision table A.4: the first row that matches gives the verdict.
///
/// # Errors
/// A drawing size, wear value or limit that is not finite, or a limit of the wrong sign; a size that is not finite is
/// row 0, not an error.
pub fn decide(
    case: &Case,
    limits: &DecisionLimits,
    policy: Policy,
) -> Result<Decision, DecisionError> {
    let Case {
        nominal,
        side,
        wear,
        corrections,
        ..
    } = *case;
    for (name, value) in [
        ("the drawing size", nominal),
        ("the wear value", wear),
        ("the tolerance", limits.tolerance),
        ("the guard band", limits.acceptance_guard),
        ("the guard band", limits.rejection_guard),
        ("the wear limit", limits.wear_limit),
    ] {
        if !value.is_finite() {
            return Err(DecisionError::NotFinite(name));
        }
    }
    if limits.tolerance < 0.0 {
        return Err(DecisionError::NegativeTolerance(limits.tolerance));
    }
    let guard = limits.acceptance_guard.min(limits.rejection_guard);
    if guard < 0.0 {
        return Err(DecisionError::NegativeGuard(guard));
    }
    if limits.wear_limit > 0.0 {
        return Err(DecisionError::PositiveWearLimit(limits.wear_limit));
    }
    let Some(size) = case.size.filter(|size| size.is_finite()) else {
        return Ok(Decision {
            verdict: Verdict::MeasurementInvalid,
            action: Action::Stop,
            error: None,
            new_wear: wear,
        });
    };
    let error = nanometres(size - nominal);
    let excess = side.sign() * error;
    let accepted = nanometres(limits.tolerance - limits.acceptance_guard);
    let rejected = nanometres(limits.tolerance + limits.rejection_guard);
    // Counted in the outer feature's direction; a bore's register and limit are its mirror image.
    let corrected = nanometres(side.sign() * wear) - error.abs();
    let (verdict, action) = if error.abs() <= accepted {
        (Verdict::Qualified, Action::NextPass)
    } else if excess < -rejected {
        (Verdict::OvercutNotCompensable, Action::Reject)
    } else if excess < -accepted || accepted < 0.0 && excess <= rejected {
        (Verdict::Indeterminate, Action::Stop)
    } else if corrected < nanometres(limits.wear_limit) {
        (Verdict::ToolWorn, Action::ChangeInsert)
    } else if corrections >= limits.max_corrections {
        (Verdict::NotConverged, Action::Stop)
    } else {
        match policy {
            Policy::Compensate => (Verdict::Compensable, Action::Recut),
            Policy::Literal => (Verdict::Compensable, Action::Stop),
        }
    };
    Ok(Decision {
        verdict,
        action,
        error: Some(error / 1e9),
        new_wear: if action == Action::Recut {
            side.sign() * corrected / 1e9
        } else {
            wear
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(side: Side, size_mm: f64, wear_mm: f64, corrections: u32) -> Case {
        Case {
            size: Some(size_mm * 1e-3),
            nominal: 19.8e-3,
            side,
            wear: wear_mm * 1e-3,
            corrections,
        }
    }

    fn outer(size_mm: f64, wear_mm: f64, corrections: u32) -> Decision {
        let case = case(Side::Outer, size_mm, wear_mm, corrections);
        decide(&case, &DecisionLimits::default(), Policy::Compensate).unwrap()
    }

    #[test]
    fn every_vector_of_the_source_gets_its_verdict() {
        use Verdict::{Compensable, OvercutNotCompensable, Qualified, ToolWorn};
        for (size, wear, verdict, new_wear) in [
            (19.810, 0.0, Qualified, 0.0),
            (19.811, 0.0, Compensable, -0.011),
            (19.790, 0.0, Qualified, 0.0),
            (19.789, 0.0, OvercutNotCompensable, 0.0),
            (19.835, -0.070, Compensable, -0.105),
            (19.835, -0.080, ToolWorn, -0.080),
            (19.840, -0.070, Compensable, -0.110),
        ] {
            let decision = outer(size, wear, 0);
            assert_eq!(decision.verdict, verdict, "{size} {wear}");
            assert!(
                (decision.new_wear - new_wear * 1e-3).abs() < 1e-18,
                "{size} {wear}: {decision:?}"
            );
        }
    }

    #[test]
    fn three_corrections_of_35_um_fit_the_wear_budget_and_four_do_not() {
        let mut wear = 0.0;
        for _ in 0..3 {
            let decision = outer(19.835, wear * 1e3, 0);
            assert_eq!(decision.action, Action::Recut);
            wear = decision.new_wear;
        }
        assert!((wear + 105e-6).abs() < 1e-18);
        assert_eq!(outer(19.835, wear * 1e3, 0).verdict, Verdict::ToolWorn);
    }

    #[test]
    fn a_bore_mirrors_error_wear_and_limit() {
        let bore = |size: f64, wear: f64| {
            let case = case(Side::Bore, size, wear, 0);
            decide(&case, &DecisionLimits::default(), Policy::Compensate).unwrap()
        };
        for (size, wear) in [
            (19.810, 0.0),
            (19.811, 0.0),
            (19.789, 0.0),
            (19.835, -0.070),
            (19.835, -0.080),
            (19.840, -0.070),
        ] {
            let mirrored = bore(2.0 * 19.8 - size, -wear);
            let shaft = outer(size, wear, 0);
            assert_eq!(mirrored.verdict, shaft.verdict, "{size} {wear}");
            assert!((mirrored.new_wear + shaft.new_wear).abs() < 1e-18);
        }
        assert_eq!(bore(19.811, 0.0).verdict, Verdict::OvercutNotCompensable);
    }

    #[test]
    fn the_fifth_correction_is_the_last_and_worn_comes_before_not_converged() {
        assert_eq!(outer(19.811, 0.0, 4).verdict, Verdict::Compensable);
        assert_eq!(outer(19.811, 0.0, 5).verdict, Verdict::NotConverged);
        assert_eq!(outer(19.835, -0.080, 5).verdict, Verdict::ToolWorn);
        assert_eq!(outer(19.805, 0.0, 5).verdict, Verdict::Qualified);
    }

    #[test]
    fn the_literal_policy_stops_and_leaves_the_register() {
        let case = case(Side::Outer, 19.811, -7e-3, 0);
        let decision = decide(&case, &DecisionLimits::default(), Policy::Literal).unwrap();
        assert_eq!(decision.verdict, Verdict::Compensable);
        assert_eq!(decision.action, Action::Stop);
        assert_eq!(decision.new_wear, -7e-6);
    }

    /// U = 4 µm as both guard bands: ISO 14253-1:2013, 5.2 to 5.4.
    #[test]
    fn within_a_guard_band_a_size_is_recut_or_indeterminate_and_never_qualified() {
        use Verdict::{Compensable, Indeterminate, OvercutNotCompensable, Qualified};
        let guarded = |size_mm: f64, guard: f64| {
            let limits = DecisionLimits {
                acceptance_guard: guard,
                rejection_guard: guard,
                ..DecisionLimits::default()
            };
            let decision = decide(
                &case(Side::Outer, size_mm, 0.0, 0),
                &limits,
                Policy::Compensate,
            );
            let decision = decision.unwrap();
            (decision.verdict, decision.action)
        };
        for (size, verdict, action) in [
            (19.806, Qualified, Action::NextPass),
            (19.807, Compensable, Action::Recut),
            (19.794, Qualified, Action::NextPass),
            (19.793, Indeterminate, Action::Stop),
            (19.786, Indeterminate, Action::Stop),
            (19.785, OvercutNotCompensable, Action::Reject),
        ] {
            assert_eq!(guarded(size, 4e-6), (verdict, action), "{size}");
        }
        // An uncertainty beyond the tolerance proves nothing, and no recut helps.
        assert_eq!(guarded(19.8, 11e-6).0, Indeterminate);
        assert_eq!(guarded(19.808, 11e-6).0, Indeterminate);
        assert_eq!(guarded(19.822, 11e-6).0, Compensable);
    }

    #[test]
    fn an_invalid_measurement_never_touches_the_register() {
        for size in [None, Some(f64::NAN), Some(f64::INFINITY)] {
            let case = Case {
                size,
                ..case(Side::Outer, 19.8, -5e-3, 0)
            };
            let decision = decide(&case, &DecisionLimits::default(), Policy::Compensate).unwrap();
            assert_eq!(decision.verdict, Verdict::MeasurementInvalid);
            assert_eq!((decision.action, decision.new_wear), (Action::Stop, -5e-6));
        }
    }

    #[test]
    fn verdicts_are_ordered_by_gravity() {
        use Verdict::{
            Compensable, Indeterminate, MeasurementInvalid, NotConverged, OvercutNotCompensable,
            Qualified, ToolWorn,
        };
        let verdicts = [
            Qualified,
            Compensable,
            NotConverged,
            Indeterminate,
            ToolWorn,
            OvercutNotCompensable,
            MeasurementInvalid,
        ];
        assert!(verdicts.is_sorted());
    }

    #[test]
    fn senseless_limits_are_refused() {
        let limits = DecisionLimits {
            wear_limit: 1e-3,
            ..DecisionLimits::default()
        };
        let outcome = decide(
            &case(Side::Outer, 20.0, 0.0, 0),
            &limits,
            Policy::Compensate,
        );
        assert_eq!(outcome, Err(DecisionError::PositiveWearLimit(1e-3)));
    }
}
