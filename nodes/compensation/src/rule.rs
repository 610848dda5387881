//! The decision rule of the cell file: how much of a tolerance the uncertainty of the reading takes, and what it risks.
//!
//! The rule judges against the drawing, so it holds in the last pass in which a size decides. Limits of the passes before
//! it are process limits, applied without guard bands.

use metrology::conformance::{DecisionRule, GuardBands, Tolerance, nonconformity_probability};
use probecell_msgs::FeatureResult;

use crate::{
    config::{Characteristic, Config},
    path,
};

impl Config {
    /// The rule by which a size is judged in a pass.
    pub(crate) fn rule_in(&self, characteristic: &Characteristic, pass: u32) -> DecisionRule {
        if pass >= characteristic.final_pass {
            self.decision_rule
        } else {
            DecisionRule::SimpleAcceptance
        }
    }
}

/// The guard bands of a result.
pub(crate) fn guard_bands(rule: DecisionRule, result: &FeatureResult) -> GuardBands {
    rule.guard_bands(result.standard_uncertainty, result.coverage_factor)
}

/// Rule and risk of a verdict, for a person.
pub(crate) fn described(
    rule: DecisionRule,
    characteristic: &Characteristic,
    result: &FeatureResult,
) -> String {
    let tolerance = characteristic.tolerance;
    let (standard, factor) = (result.standard_uncertainty, result.coverage_factor);
    let limits = Tolerance {
        lower: -tolerance,
        upper: tolerance,
    };
    let own = nonconformity_probability(path::error(result), standard, &limits);
    let accepted = tolerance - guard_bands(rule, result).acceptance;
    let accepted = if accepted < 0.0 {
        "nothing can be accepted".to_owned()
    } else {
        format!("accepted within ± {:.1} µm", accepted * 1e6)
    };
    format!(
        "{}, U = {:.1} µm (k = {factor:.3}): {accepted}; the probability that the true size is out of tolerance is {}, at the \
         limit of acceptance {}",
        rule.name(),
        factor * standard * 1e6,
        percent(own),
        percent(rule.largest_risk(factor)),
    )
}

/// A probability in per cent, with two significant digits.
pub(crate) fn percent(probability: f64) -> String {
    match probability * 100.0 {
        small if small < 0.01 => "below 0.01 %".to_owned(),
        small if small < 1.0 => format!("{small:.2} %"),
        value => format!("{value:.1} %"),
    }
}
