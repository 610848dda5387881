//! Settings of `visualization`.

use machine::{ChainError, tree::TreeJoint};
use serde::Deserialize;

/// As written in the cell file, section `[visualization]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawConfig {
    /// Begins the name of every frame on `/tf`, which all cells of a bus share; without it the name of the cell and a slash.
    /// Empty where the cell is the only robot of its ROS domain.
    pub frame_prefix: Option<String>,
    /// Length of the line of a deviation over the deviation.
    pub magnification: f64,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            frame_prefix: None,
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
    /// tf2 refuses such frames.
    #[error("visualization.frame_prefix {0:?} begins with a slash, which tf2 refuses")]
    FramePrefix(String),
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
        let prefix = self.frame_prefix.as_deref().unwrap_or_default();
        if prefix.starts_with('/') {
            return Err(ConfigError::FramePrefix(prefix.to_owned()));
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
