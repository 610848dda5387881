//! Lines of the budget of what all touches share.

use metrology::uncertainty::Input;
use serde::Deserialize;

use super::error::ConfigError;

/// One line of the budget of what all touches share, as written: a standard uncertainty, readings, or limits.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawContribution {
    /// What it comes from.
    pub name: String,
    /// A standard uncertainty known from elsewhere, such as a certificate.
    pub standard_uncertainty_um: Option<f64>,
    /// Its degrees of freedom; none: known exactly.
    pub degrees_of_freedom: Option<f64>,
    /// Experimental standard deviation of one reading, with `readings`.
    pub deviation_um: Option<f64>,
    /// Number of readings that were averaged, at least 2.
    pub readings: Option<u32>,
    /// Limits ±, with `distribution`.
    pub half_width_um: Option<f64>,
    /// How values are distributed within the limits; none: `rectangular`.
    pub distribution: Option<Distribution>,
}

/// Distribution within limits (GUM 4.3.7, 4.3.9, JCGM 101 6.4.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// All values are equally probable.
    Rectangular,
    /// Values near the middle are more probable.
    Triangular,
    /// A sinusoidal variation, such as a controlled temperature.
    Arcsine,
}

impl RawContribution {
    pub(super) fn check(&self) -> Result<Input, ConfigError> {
        let Self {
            standard_uncertainty_um: standard,
            degrees_of_freedom,
            deviation_um: deviation,
            readings,
            half_width_um: half_width,
            distribution,
            ..
        } = *self;
        let input = match (standard, deviation.zip(readings), half_width) {
            (Some(standard), None, None) => Input::Normal {
                standard: standard * 1e-6,
                degrees_of_freedom: degrees_of_freedom.unwrap_or(f64::INFINITY),
            },
            (None, Some((deviation, count)), None) => Input::Readings {
                deviation: deviation * 1e-6,
                count,
            },
            (None, None, Some(half_width)) => {
                let half_width = half_width * 1e-6;
                match distribution.unwrap_or(Distribution::Rectangular) {
                    Distribution::Rectangular => Input::Rectangular { half_width },
                    Distribution::Triangular => Input::Triangular { half_width },
                    Distribution::Arcsine => Input::Arcsine { half_width },
                }
            }
            _ => return Err(ConfigError::Contribution(self.name.clone())),
        };
        // What belongs to another kind of line would have no effect.
        let superfluous = standard.is_none() && degrees_of_freedom.is_some()
            || half_width.is_none() && distribution.is_some()
            || deviation.is_some() != readings.is_some();
        if superfluous {
            return Err(ConfigError::Contribution(self.name.clone()));
        }
        input.check(&self.name)?;
        Ok(input)
    }
}
