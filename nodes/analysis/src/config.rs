//! Settings of `analysis`.

mod alignment;
mod budget;
mod error;

use std::collections::BTreeMap;

use machine::Chain;
use metrology::uncertainty::{Budget, Coverage, Input, Uncertainty, UncertaintyError};
use probecell_msgs::InspectionPlan;
use serde::Deserialize;

pub use self::alignment::{Alignment, Method, RawAlignment};
pub use self::budget::{Distribution, RawContribution};
pub use self::error::ConfigError;
use crate::feature::{Criterion, Rules, common_sensitivity};
use crate::tolerance::Tolerance;

/// As written in the cell file, section `[analysis]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawConfig {
    /// Standard uncertainty of the deviation of one touch.
    pub touch_standard_uncertainty_um: f64,
    /// Degrees of freedom of that: the touches of a repeatability test (ISO 230-10) less one. None: known exactly.
    pub touch_degrees_of_freedom: Option<f64>,
    /// Standard uncertainty that all touches share, per radius or distance, known exactly; in addition to `common`.
    pub common_standard_uncertainty_um: f64,
    /// Budget of what all touches share (calibration of the stylus, temperature), per radius or distance.
    pub common: Vec<RawContribution>,
    /// Coverage factor for infinitely many degrees of freedom; with fewer it is Student's t for the same probability.
    pub coverage_factor: f64,
    /// Largest range of repeated touches of one point; beyond it the feature is invalid.
    pub repeat_limit_um: f64,
    /// Sizes over several planes.
    pub widths: Vec<Width>,
    /// Steps from one plane to another that is nominally parallel to it: their mismatch.
    pub steps: Vec<Width>,
    /// Geometrical tolerances (ISO 1101).
    pub tolerances: Vec<Tolerance>,
    /// Features that are fitted in another way than by least squares of all touches.
    pub fits: Vec<RawFit>,
    /// Features by which the part is aligned before anything is reported; none: the part frame is as programmed.
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
    /// Touches farther from the fit than this many robust standard deviations are left out as outliers; none: all count.
    pub outlier_limit: Option<f64>,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            touch_standard_uncertainty_um: 1.0,
            touch_degrees_of_freedom: None,
            common_standard_uncertainty_um: 0.0,
            common: Vec::new(),
            coverage_factor: 2.0,
            repeat_limit_um: 10.0,
            widths: Vec::new(),
            steps: Vec::new(),
            tolerances: Vec::new(),
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
    /// m; standard uncertainty of the deviation of one touch.
    pub touch_uncertainty: f64,
    /// Degrees of freedom of that; infinite where it is known exactly.
    pub touch_degrees_of_freedom: f64,
    /// Budget of what all touches share, m per radius or distance.
    pub common: Budget,
    /// m; combined standard uncertainty of that.
    pub common_uncertainty: f64,
    /// Coverage factor for infinitely many degrees of freedom.
    pub coverage_factor: f64,
    /// m; largest range of repeated touches of one point.
    pub repeat_limit: f64,
    /// Sizes over two planes.
    pub widths: Vec<Width>,
    /// Steps between two planes.
    pub steps: Vec<Width>,
    /// Geometrical tolerances.
    pub tolerances: Vec<Tolerance>,
    /// How features are fitted, where not by least squares of all touches.
    pub fits: BTreeMap<String, Rules>,
    /// How the part is aligned, if it is.
    pub alignment: Option<Alignment>,
}

impl Config {
    /// The same where something more makes touches uncertain, each independently: `standard` (m), known exactly, is added to the
    /// uncertainty of a touch (GUM 5.1.2), whose effective degrees of freedom grow with it (GUM G.4).
    #[must_use]
    pub fn with_touch_contribution(self, standard: f64) -> Self {
        let combined = self.touch_uncertainty.hypot(standard);
        let share = (combined / self.touch_uncertainty).powi(4);
        Self {
            touch_uncertainty: combined,
            touch_degrees_of_freedom: self.touch_degrees_of_freedom * share,
            ..self
        }
    }

    /// How a feature is fitted.
    pub fn rules(&self, feature: &str) -> Rules {
        self.fits.get(feature).copied().unwrap_or_default()
    }

    /// The uncertainty of a size: `by_touches` is its standard uncertainty (m) by the touches alone, `sensitivity` its
    /// change per change of all deviations alike ([`common_sensitivity`]).
    ///
    /// # Errors
    /// An uncertainty that is not finite.
    pub(crate) fn stated(
        &self,
        by_touches: f64,
        sensitivity: f64,
    ) -> Result<Uncertainty, UncertaintyError> {
        let touches = Input::Normal {
            standard: by_touches,
            degrees_of_freedom: self.touch_degrees_of_freedom,
        };
        let mut budget = Budget::default().with("touches", touches, 1.0);
        for line in &self.common.contributions {
            budget = budget.with(
                line.name.as_str(),
                line.input,
                line.sensitivity * sensitivity,
            );
        }
        budget.combine(Coverage::NormalFactor(self.coverage_factor))
    }

    /// Change of each size of a plan by one standard uncertainty of what all touches share, m with its sign: of features,
    /// widths and steps, by name.
    pub fn common_components(&self, plan: &InspectionPlan) -> BTreeMap<String, f64> {
        let features = plan.features.iter();
        let features = features.map(|feature| {
            let sensitivity = common_sensitivity(feature.kind, feature.half_angle);
            (feature.id.clone(), sensitivity)
        });
        let widths = self.widths.iter().map(|width| (width.id.clone(), 2.0));
        let steps = self.steps.iter().map(|step| (step.id.clone(), 0.0));
        features
            .chain(widths)
            .chain(steps)
            .map(|(id, sensitivity)| (id, sensitivity * self.common_uncertainty))
            .collect()
    }
}

impl RawConfig {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`ConfigError`] names the key.
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
        let touch_degrees_of_freedom = self.touch_degrees_of_freedom.unwrap_or(f64::INFINITY);
        if !(touch_degrees_of_freedom > 0.0) {
            return Err(ConfigError::Number {
                key: "touch_degrees_of_freedom".to_owned(),
                value: touch_degrees_of_freedom,
                more: "above 0",
            });
        }
        let mut common = Budget::default().with("common", Input::exact(value * 1e-6), 1.0);
        for raw in &self.common {
            common = common.with(raw.name.as_str(), raw.check()?, 1.0);
        }
        let common_uncertainty = common
            .combine(Coverage::NormalFactor(self.coverage_factor))?
            .standard;
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
            touch_degrees_of_freedom,
            common,
            common_uncertainty,
            coverage_factor: self.coverage_factor,
            repeat_limit: self.repeat_limit_um * 1e-6,
            widths: self.widths.clone(),
            steps: self.steps.clone(),
            tolerances: self.tolerances.clone(),
            fits,
            alignment: alignment.transpose()?,
        })
    }
}

impl RawFit {
    /// Fewer robust deviations than this would leave out touches that only noise has moved.
    const MIN_LIMIT: f64 = 3.0;

    fn check(&self) -> Result<Rules, ConfigError> {
        if let Some(value) = self.outlier_limit
            && !(value.is_finite() && value >= Self::MIN_LIMIT)
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
