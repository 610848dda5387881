//! Settings of `cycle`: the passes of the part program.

use serde::Deserialize;

/// As written in the cell file, section `[cycle]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    /// The machining passes, in order.
    pub passes: Vec<Pass>,
    /// A measurement whose decision does not come within this time stops the part.
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
    /// Allowance left on the sizes by this pass; the sizes aimed at are the drawing's plus this.
    #[serde(default)]
    pub allowance_mm: f64,
    /// Measured for the record: the next pass follows whatever is found, and nothing is corrected.
    #[serde(default)]
    pub for_record: bool,
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// At least one pass.
    pub passes: Vec<Pass>,
    /// s; how long a decision may take.
    pub decision_limit: f64,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// No pass.
    #[error("cycle.passes is empty: a part needs at least one pass")]
    NoPass,
    /// A number that is not a time.
    #[error("cycle.decision_limit_s = {0} must be a positive finite number")]
    DecisionLimit(f64),
    /// An allowance that is not a length.
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
