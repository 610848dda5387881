//! Settings of `visualization`.

use machine::{ChainError, tree::TreeJoint};
use serde::Deserialize;

/// As written in the cell file, section `[visualization]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawConfig {
    /// Length of the line of a deviation over the deviation.
    pub magnification: f64,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            magnification: 1000.0,
        }
    }
}

/// Why the settings cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// No length can be drawn.
    #[error("visualization.magnification is {0}, it must be above 0 and finite")]
    Magnification(f64),
    /// The text is no robot description.
    #[error(transparent)]
    Robot(#[from] ChainError),
}

impl RawConfig {
    /// The settings of a machine.
    ///
    /// # Errors
    /// [`ConfigError`] names the key and what is wrong with it.
    pub fn check(&self, robot_description: &str) -> Result<Config, ConfigError> {
        let magnification = self.magnification;
        if !(magnification.is_finite() && magnification > 0.0) {
            return Err(ConfigError::Magnification(magnification));
        }
        Ok(Config {
            joints: machine::tree::joints(robot_description)?,
            magnification,
        })
    }
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// Every joint of the robot description.
    pub(crate) joints: Vec<TreeJoint>,
    /// Length of the line of a deviation over the deviation.
    pub(crate) magnification: f64,
}
