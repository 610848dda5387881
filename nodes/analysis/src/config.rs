//! Settings of `analysis`.

use machine::Chain;
use serde::Deserialize;

/// As written in the cell file, section `[analysis]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawConfig {
    /// Standard uncertainty of the deviation of one touch.
    pub touch_standard_uncertainty_um: f64,
    /// Standard uncertainty that all touches share (calibration of the stylus, temperature), per radius or distance.
    pub common_standard_uncertainty_um: f64,
    /// Expanded uncertainty = this factor times the standard uncertainty.
    pub coverage_factor: f64,
    /// Repeated touches of one point that differ by more make the feature invalid.
    pub repeat_limit_um: f64,
    /// Sizes over several planes.
    pub widths: Vec<Width>,
    /// Steps from one plane to another that is nominally parallel to it: their mismatch.
    pub steps: Vec<Width>,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            touch_standard_uncertainty_um: 1.0,
            common_standard_uncertainty_um: 0.0,
            coverage_factor: 2.0,
            repeat_limit_um: 10.0,
            widths: Vec::new(),
            steps: Vec::new(),
        }
    }
}

/// A size over two parallel planes: the sum of their distances from the part's origin, or as a step their difference.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Width {
    /// Name of the size.
    pub id: String,
    /// The two planes.
    pub planes: [String; 2],
    /// Limits of the deviation of the size.
    pub tolerance_um: [f64; 2],
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// The machine, from its URDF.
    pub chain: Chain,
    /// m; of one touch.
    pub touch_uncertainty: f64,
    /// m; shared by all touches, per radius or distance.
    pub common_uncertainty: f64,
    /// Expanded over standard uncertainty.
    pub coverage_factor: f64,
    /// m; largest range of repeated touches of one point.
    pub repeat_limit: f64,
    /// Sizes over two planes.
    pub widths: Vec<Width>,
    /// Steps between two planes.
    pub steps: Vec<Width>,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("analysis.{key} = {value} must be a finite number {more}")]
pub struct ConfigError {
    key: &'static str,
    value: f64,
    more: &'static str,
}

impl RawConfig {
    /// Checks the settings.
    pub fn check(&self, chain: Chain) -> Result<Config, ConfigError> {
        for (key, value) in [
            (
                "touch_standard_uncertainty_um",
                self.touch_standard_uncertainty_um,
            ),
            ("coverage_factor", self.coverage_factor),
            ("repeat_limit_um", self.repeat_limit_um),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ConfigError {
                    key,
                    value,
                    more: "above 0",
                });
            }
        }
        let value = self.common_standard_uncertainty_um;
        if !(value.is_finite() && value >= 0.0) {
            return Err(ConfigError {
                key: "common_standard_uncertainty_um",
                value,
                more: "that is not negative",
            });
        }
        Ok(Config {
            chain,
            touch_uncertainty: self.touch_standard_uncertainty_um * 1e-6,
            common_uncertainty: value * 1e-6,
            coverage_factor: self.coverage_factor,
            repeat_limit: self.repeat_limit_um * 1e-6,
            widths: self.widths.clone(),
            steps: self.steps.clone(),
        })
    }
}
