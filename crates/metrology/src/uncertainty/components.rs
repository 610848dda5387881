//! Values that share one component of their uncertainty: sums, differences and means of them (GUM 5.2.2, F.1.2.3).

use serde::{Deserialize, Serialize};

/// A standard uncertainty in two parts: what is the value's alone, and what it shares fully with others.
///
/// Two sizes of 0.2 µm alone and 1.0 µm shared (the calibration of one stylus): their mean is no better known than the
/// calibration, and their difference does not depend on it.
///
/// ```
/// use metrology::uncertainty::Components;
///
/// let size = Components { independent: 0.2e-6, common: 1.0e-6 };
/// let mean = Components::linear_combination([(0.5, size), (0.5, size)]);
/// assert_eq!(format!("{:.2} µm", mean.standard() * 1e6), "1.01 µm");
/// let difference = Components::linear_combination([(1.0, size), (-1.0, size)]);
/// assert_eq!(format!("{:.2} µm", difference.standard() * 1e6), "0.28 µm");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Components {
    /// Standard uncertainty that is independent of all other values, not negative.
    pub independent: f64,
    /// Change of the value by one standard uncertainty of what is shared; its sign is that of the sensitivity.
    pub common: f64,
}

impl Components {
    /// Splits the combined `standard` uncertainty of which `common` (with sign) is shared. A common part larger than the
    /// whole, as rounding may leave it, leaves an independent part of 0.
    pub fn split(standard: f64, common: f64) -> Self {
        Self {
            independent: (standard.powi(2) - common.powi(2)).max(0.0).sqrt(),
            common,
        }
    }

    /// Combined standard uncertainty.
    pub fn standard(&self) -> f64 {
        self.independent.hypot(self.common)
    }

    /// Of Σ wᵢxᵢ for `(wᵢ, components of xᵢ)`: independent parts add in squares, common parts with their signs
    /// (GUM 5.2.2 with correlation coefficients +1 between them).
    pub fn linear_combination(terms: impl IntoIterator<Item = (f64, Self)>) -> Self {
        let (variance, common) =
            terms
                .into_iter()
                .fold((0.0, 0.0), |(variance, common), (weight, term)| {
                    (
                        variance + (weight * term.independent).powi(2),
                        common + weight * term.common,
                    )
                });
        Self {
            independent: f64::sqrt(variance),
            common,
        }
    }
}
