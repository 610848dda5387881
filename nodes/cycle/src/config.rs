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
    /// An operation or a measurement that lasts longer stops the part.
    #[serde(default = "default_operation_limit")]
    pub operation_limit_s: f64,
    /// Corrections that are not acknowledged within this time stop the part; longer than operators have for an approval.
    #[serde(default = "default_correction_limit")]
    pub correction_limit_s: f64,
    /// A part is stopped when `machine_state` has not answered a request for longer.
    #[serde(default = "default_answer_limit")]
    pub answer_limit_s: f64,
}

fn default_decision_limit() -> f64 {
    30.0
}

fn default_operation_limit() -> f64 {
    4.0 * 3600.0
}

fn default_correction_limit() -> f64 {
    900.0
}

fn default_answer_limit() -> f64 {
    10.0
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
    /// s; longest operation or measurement.
    pub operation_limit: f64,
    /// s; longest time until corrections are acknowledged.
    pub correction_limit: f64,
    /// s; longest silence of `machine_state` on what was requested of it.
    pub answer_limit: f64,
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
    #[error("cycle.{0} = {1} must be a positive finite number")]
    Limit(&'static str, f64),
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
    ///
    /// # Errors
    /// [`ConfigError`] names the key.
    pub fn check(&self) -> Result<Config, ConfigError> {
        if self.passes.is_empty() {
            return Err(ConfigError::NoPass);
        }
        for (key, value) in [
            ("decision_limit_s", self.decision_limit_s),
            ("operation_limit_s", self.operation_limit_s),
            ("correction_limit_s", self.correction_limit_s),
            ("answer_limit_s", self.answer_limit_s),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ConfigError::Limit(key, value));
            }
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
            operation_limit: self.operation_limit_s,
            correction_limit: self.correction_limit_s,
            answer_limit: self.answer_limit_s,
        })
    }
}
