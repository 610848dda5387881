//! Key `decision_rule`: how the uncertainty of a size enters the decision on it.

use metrology::conformance::DecisionRule;
use serde::Deserialize;

use super::ConfigError;

/// As written: `"iso_14253_1"`, `"simple_acceptance"` or `{ guard_band = { consumers_risk = 0.02 } }`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum RawDecisionRule {
    /// ISO 14253-1:2013.
    #[default]
    #[serde(rename = "iso_14253_1")]
    Iso14253,
    /// The tolerance limits themselves.
    #[serde(rename = "simple_acceptance")]
    SimpleAcceptance,
    /// Guarded acceptance by JCGM 106:2012.
    #[serde(rename = "guard_band")]
    GuardBand {
        /// Largest specific consumer's risk, above 0 and at most 0.5.
        consumers_risk: f64,
    },
}

impl RawDecisionRule {
    pub(crate) fn check(self) -> Result<DecisionRule, ConfigError> {
        match self {
            Self::Iso14253 => Ok(DecisionRule::Iso14253),
            Self::SimpleAcceptance => Ok(DecisionRule::SimpleAcceptance),
            Self::GuardBand { consumers_risk } if consumers_risk > 0.0 && consumers_risk <= 0.5 => {
                Ok(DecisionRule::GuardBand { consumers_risk })
            }
            Self::GuardBand { consumers_risk } => Err(ConfigError::Risk(consumers_risk)),
        }
    }
}
