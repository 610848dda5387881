//! Settings of `gap`.

use diagnosis::{DeclaredEffect, Options};
use serde::Deserialize;

/// As written in the cell file, section `[gap]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawConfig {
    /// Diagnose when every point of a plan has been tried, and when its reference measurement arrives.
    pub at_end_of_plan: bool,
    /// Diagnose every so many touches, before the plan's end.
    pub every_touches: Option<u32>,
    /// Effects to exclude.
    pub without: Vec<String>,
    /// Compare the parts with one another, and raise a finding when the gap changes.
    pub watch: bool,
    /// Findings in 1,000 parts without a change, at most, in the mean.
    pub false_alarms_per_1000_parts: f64,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            at_end_of_plan: true,
            every_touches: None,
            without: Vec::new(),
            watch: true,
            false_alarms_per_1000_parts: 1.0,
        }
    }
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// Diagnose at the end of a plan.
    pub at_end_of_plan: bool,
    /// Diagnose every so many touches.
    pub every_touches: Option<u32>,
    /// Options of the diagnosis.
    pub options: Options,
    /// Effects of the cell's declared model.
    pub declared: Vec<DeclaredEffect>,
    /// False alarms in 1,000 parts; `None`: parts are not compared with one another.
    pub false_alarms: Option<f64>,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// Fewer touches than a diagnosis needs.
    #[error("gap.every_touches = {0} must be at least 8")]
    Often(u32),
    /// A rate that is none.
    #[error("gap.false_alarms_per_1000_parts = {0} must be above 0 and at most 100")]
    Rate(f64),
    /// An unknown effect.
    #[error("gap.without: there is no effect {name:?} on this machine: did you mean {nearest:?}?")]
    Effect {
        /// As written.
        name: String,
        /// The most similar one.
        nearest: String,
    },
}

impl RawConfig {
    /// Checks the settings; `vocabulary` holds the effects of this machine, `declared` those that its model has already.
    ///
    /// # Errors
    /// [`ConfigError`] names the key.
    pub fn check(
        &self,
        vocabulary: &[String],
        declared: &[DeclaredEffect],
    ) -> Result<Config, ConfigError> {
        if let Some(touches) = self.every_touches.filter(|&touches| touches < 8) {
            return Err(ConfigError::Often(touches));
        }
        let rate = self.false_alarms_per_1000_parts;
        if !(rate > 0.0 && rate <= 100.0) {
            return Err(ConfigError::Rate(rate));
        }
        if let Some(name) = self.without.iter().find(|name| !vocabulary.contains(name)) {
            let nearest = effects::vocabulary::nearest(name, vocabulary).unwrap_or_default();
            return Err(ConfigError::Effect {
                name: name.clone(),
                nearest: nearest.to_owned(),
            });
        }
        Ok(Config {
            at_end_of_plan: self.at_end_of_plan,
            every_touches: self.every_touches,
            options: Options {
                without: self.without.clone(),
                ..Options::default()
            },
            declared: declared.to_vec(),
            false_alarms: self.watch.then_some(rate),
        })
    }
}
