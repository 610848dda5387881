//! Settings of `cycle`: the passes of the part program.

use probecell_msgs::{PlanId, RunId};
use serde::Deserialize;

/// As written in the cell file, section `[cycle]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    /// The machining passes, in order.
    pub passes: Vec<Pass>,
    /// A measurement without a decision within this time stops the part.
    #[serde(default = "default_decision_limit")]
    pub decision_limit_s: f64,
}

fn default_decision_limit() -> f64 {
    30.0
}

/// One machining pass: what is cut before it is measured.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pass {
    /// Its name.
    pub name: String,
    /// Operations that are cut, in order; none: the part is only measured.
    #[serde(default)]
    pub operations: Vec<String>,
    /// Allowance that this pass leaves: its target sizes are those of the drawing plus this.
    #[serde(default)]
    pub allowance_mm: f64,
    /// Measured for the record only: the next pass follows in any case, and nothing is corrected.
    #[serde(default)]
    pub for_record: bool,
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// At least one pass.
    pub passes: Vec<Pass>,
    /// s; a measurement without a decision within this time stops the part.
    pub decision_limit: f64,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// No pass.
    #[error("cycle.passes is empty: a part needs at least one pass")]
    NoPass,
    /// A name that would make the identifier of a measurement that of a supplement.
    #[error("cycle.passes: name = {0:?} is reserved for supplements of a plan")]
    Reserved(String),
    /// A time that is not positive and finite.
    #[error("cycle.decision_limit_s = {0} must be a positive finite number")]
    DecisionLimit(f64),
    /// An allowance that is negative or not finite.
    #[error(
        "cycle.passes: allowance_mm = {value} of pass {pass:?} must be a finite number that is not negative"
    )]
    Allowance {
        /// The pass.
        pass: String,
        /// mm.
        value: f64,
    },
}

impl RawConfig {
    /// Checks the settings.
    pub fn check(&self) -> Result<Config, ConfigError> {
        if self.passes.is_empty() {
            return Err(ConfigError::NoPass);
        }
        if !(self.decision_limit_s.is_finite() && self.decision_limit_s > 0.0) {
            return Err(ConfigError::DecisionLimit(self.decision_limit_s));
        }
        for pass in &self.passes {
            let first = PlanId::measurement(RunId::new("part", &pass.name), 2);
            if PlanId::from(first.to_string()) != first {
                return Err(ConfigError::Reserved(pass.name.clone()));
            }
            if !(pass.allowance_mm.is_finite() && pass.allowance_mm >= 0.0) {
                return Err(ConfigError::Allowance {
                    pass: pass.name.clone(),
                    value: pass.allowance_mm,
                });
            }
        }
        Ok(Config {
            passes: self.passes.clone(),
            decision_limit: self.decision_limit_s,
        })
    }
}
