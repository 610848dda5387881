//! Input quantities: what is known of each, as a probability distribution about its estimate.

use rand::Rng;
use rand_distr::{Distribution as _, StandardNormal, StudentT};
use serde::{Deserialize, Serialize};

use super::UncertaintyError;

/// How one input quantity is distributed about its estimate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Input {
    /// Type A: mean of `count` ≥ 2 readings whose experimental standard deviation is `deviation` (GUM 4.2).
    Readings {
        /// Experimental standard deviation of one reading.
        deviation: f64,
        /// Number of readings that the estimate is the mean of.
        count: u32,
    },
    /// A normal distribution known from elsewhere, with its degrees of freedom (infinite where it is known exactly).
    Normal {
        /// Standard uncertainty.
        standard: f64,
        /// Degrees of freedom; ½·(Δu/u)⁻² where u is itself known to Δu (GUM G.4.2): 8 for a quarter of u.
        degrees_of_freedom: f64,
    },
    /// Uniform within ±`half_width` (GUM 4.3.7): a resolution, a catalogue limit.
    Rectangular {
        /// Half of the full width.
        half_width: f64,
    },
    /// Triangular within ±`half_width` (GUM 4.3.9).
    Triangular {
        /// Half of the full width.
        half_width: f64,
    },
    /// Sinusoidal within ±`half_width` (JCGM 101 6.4.6): a temperature under control.
    Arcsine {
        /// Amplitude.
        half_width: f64,
    },
}

impl Input {
    /// A standard uncertainty that is known exactly.
    pub fn exact(standard: f64) -> Self {
        Self::Normal {
            standard,
            degrees_of_freedom: f64::INFINITY,
        }
    }

    /// Standard uncertainty.
    pub fn standard(&self) -> f64 {
        match *self {
            Self::Readings { deviation, count } => deviation / f64::from(count).sqrt(),
            Self::Normal { standard, .. } => standard,
            Self::Rectangular { half_width } => half_width / 3.0_f64.sqrt(),
            Self::Triangular { half_width } => half_width / 6.0_f64.sqrt(),
            Self::Arcsine { half_width } => half_width / 2.0_f64.sqrt(),
        }
    }

    /// Degrees of freedom of the standard uncertainty.
    pub fn degrees_of_freedom(&self) -> f64 {
        match *self {
            Self::Readings { count, .. } => f64::from(count) - 1.0,
            Self::Normal {
                degrees_of_freedom, ..
            } => degrees_of_freedom,
            Self::Rectangular { .. } | Self::Triangular { .. } | Self::Arcsine { .. } => {
                f64::INFINITY
            }
        }
    }

    /// A deviation from the estimate, drawn from this distribution (JCGM 101 6.4; readings and normal distributions with
    /// finite degrees of freedom from Student's t, 6.4.9). NaN of an input that [`Self::check`] refuses.
    pub fn draw(&self, random: &mut impl Rng) -> f64 {
        match *self {
            Self::Readings { .. } | Self::Normal { .. } => {
                let degrees_of_freedom = self.degrees_of_freedom();
                let unit = if degrees_of_freedom.is_finite() {
                    StudentT::new(degrees_of_freedom).map_or(f64::NAN, |t| t.sample(random))
                } else {
                    StandardNormal.sample(random)
                };
                self.standard() * unit
            }
            Self::Rectangular { half_width } => half_width * random.random_range(-1.0..=1.0),
            Self::Triangular { half_width } => {
                half_width * (random.random::<f64>() - random.random::<f64>())
            }
            Self::Arcsine { half_width } => {
                half_width * (std::f64::consts::TAU * random.random::<f64>()).sin()
            }
        }
    }

    /// Refuses what is no distribution; `name` is what the error calls it.
    ///
    /// # Errors
    /// A standard uncertainty that is negative or not finite, or degrees of freedom that are not positive.
    pub fn check(&self, name: &str) -> Result<(), UncertaintyError> {
        let standard = self.standard();
        if !(standard.is_finite() && standard >= 0.0) {
            return Err(UncertaintyError::Standard(name.into(), standard));
        }
        let degrees_of_freedom = self.degrees_of_freedom();
        if degrees_of_freedom.is_nan() || degrees_of_freedom <= 0.0 {
            return Err(UncertaintyError::DegreesOfFreedom(
                name.into(),
                degrees_of_freedom,
            ));
        }
        Ok(())
    }
}
