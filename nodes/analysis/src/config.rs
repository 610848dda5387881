//! Settings of `analysis`.

use std::collections::BTreeMap;

use machine::Chain;
use serde::Deserialize;

use crate::feature::{Criterion, Rules};

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
    /// Features that are fitted in another way than by least squares of all touches.
    pub fits: Vec<RawFit>,
    /// By which features the part is placed before anything is said of it; none: it lies where the plan has it.
    pub alignment: Option<RawAlignment>,
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawFit {
    /// The feature.
    pub feature: String,
    /// What the fitted shape has to be.
    #[serde(default)]
    pub criterion: Criterion,
    /// Touches farther from the others than so many robust standard deviations are left out; none: all touches count.
    pub outlier_limit: Option<f64>,
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawAlignment {
    /// Datum features in order of precedence (ISO 5459).
    #[serde(default)]
    pub datums: Vec<String>,
    /// Instead: features whose touches together say where the part lies.
    #[serde(default)]
    pub best_fit: Vec<String>,
    /// What a best fit may move: shifts along `x`, `y`, `z`, turns `a`, `b`, `c` about them.
    #[serde(default = "all_free")]
    pub free: Vec<String>,
}

/// Shifts along the axes of the part frame and turns about them.
const DISPLACEMENTS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

fn all_free() -> Vec<String> {
    DISPLACEMENTS.map(str::to_owned).to_vec()
}

/// How the part is placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// By datums in order of precedence.
    Datums,
    /// By least squares of the deviations.
    BestFit,
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Alignment {
    /// How.
    pub method: Method,
    /// By which features, in order of precedence.
    pub features: Vec<String>,
    /// Shifts along and turns about x, y and z that a best fit may find.
    pub free: [bool; 6],
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
            fits: Vec::new(),
            alignment: None,
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
    /// How features are fitted, where not by least squares of all touches.
    pub fits: BTreeMap<String, Rules>,
    /// How the part is placed, if it is.
    pub alignment: Option<Alignment>,
}

impl Config {
    /// How a feature is fitted.
    pub fn rules(&self, feature: &str) -> Rules {
        self.fits.get(feature).copied().unwrap_or_default()
    }
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A number out of range.
    #[error("analysis.{key} = {value} must be a finite number {more}")]
    Number {
        /// The key.
        key: String,
        /// As written.
        value: f64,
        /// What else it must be.
        more: &'static str,
    },
    /// Two fits of one feature.
    #[error("analysis.fits: feature {0:?} stands there twice")]
    FitTwice(String),
    /// No way, or two, to place the part.
    #[error("analysis.alignment needs either datums or best_fit")]
    Method,
    /// An unknown displacement.
    #[error("analysis.alignment.free = {0:?} is none of x, y, z, a, b, c")]
    Displacement(String),
    /// A datum system is rigid.
    #[error("analysis.alignment.free belongs to best_fit: a datum system places the part whole")]
    FreeDatums,
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
                return Err(ConfigError::Number {
                    key: key.to_owned(),
                    value,
                    more: "above 0",
                });
            }
        }
        let value = self.common_standard_uncertainty_um;
        if !(value.is_finite() && value >= 0.0) {
            return Err(ConfigError::Number {
                key: "common_standard_uncertainty_um".to_owned(),
                value,
                more: "that is not negative",
            });
        }
        let mut fits = BTreeMap::new();
        for raw in &self.fits {
            if fits.insert(raw.feature.clone(), raw.check()?).is_some() {
                return Err(ConfigError::FitTwice(raw.feature.clone()));
            }
        }
        let alignment = self.alignment.as_ref().map(RawAlignment::check);
        Ok(Config {
            chain,
            touch_uncertainty: self.touch_standard_uncertainty_um * 1e-6,
            common_uncertainty: value * 1e-6,
            coverage_factor: self.coverage_factor,
            repeat_limit: self.repeat_limit_um * 1e-6,
            widths: self.widths.clone(),
            steps: self.steps.clone(),
            fits,
            alignment: alignment.transpose()?,
        })
    }
}

impl RawFit {
    /// Fewer robust deviations than this would leave out touches that only noise has moved.
    const LEAST_LIMIT: f64 = 3.0;

    fn check(&self) -> Result<Rules, ConfigError> {
        if let Some(value) = self.outlier_limit
            && !(value.is_finite() && value >= Self::LEAST_LIMIT)
        {
            return Err(ConfigError::Number {
                key: format!("fits.{}.outlier_limit", self.feature),
                value,
                more: "of at least 3",
            });
        }
        Ok(Rules {
            criterion: self.criterion,
            outlier_limit: self.outlier_limit,
        })
    }
}

impl RawAlignment {
    fn check(&self) -> Result<Alignment, ConfigError> {
        let (method, features) = match (&self.datums[..], &self.best_fit[..]) {
            ([], features @ [_, ..]) => (Method::BestFit, features),
            (datums @ [_, ..], []) => (Method::Datums, datums),
            _ => return Err(ConfigError::Method),
        };
        let mut free = [false; 6];
        for name in &self.free {
            let place = DISPLACEMENTS.iter().position(|known| known == name);
            free[place.ok_or_else(|| ConfigError::Displacement(name.clone()))?] = true;
        }
        if method == Method::Datums && free != [true; 6] {
            return Err(ConfigError::FreeDatums);
        }
        Ok(Alignment {
            method,
            features: features.to_vec(),
            free,
        })
    }
}
