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
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            at_end_of_plan: true,
            every_touches: None,
            without: Vec::new(),
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
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// Fewer touches than a diagnosis needs.
    #[error("gap.every_touches = {0} must be at least 8")]
    Often(u32),
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
    pub fn check(
        &self,
        vocabulary: &[String],
        declared: &[DeclaredEffect],
    ) -> Result<Config, ConfigError> {
        if let Some(touches) = self.every_touches.filter(|&touches| touches < 8) {
            return Err(ConfigError::Often(touches));
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
        })
    }
}
