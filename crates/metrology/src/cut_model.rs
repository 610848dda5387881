//! Models the size a cut leaves: tool error, spring-back, and deflection along the part.
//!
//! Lengths in m, sizes diametral. `docs/source_systems.md, A.4` (plant) and A.6 (error along the length); these are
//! assumptions by which a simulator runs, no cutting-force model. Scatter is added by the caller, who owns the random
//! numbers.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A tool that cuts wrong by a constant and by a share of the depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CutModel {
    /// w: size left beyond the command, m.
    pub tool_error: f64,
    /// κ: share of the depth of cut (on diameter) that springs back, dimensionless.
    pub elastic_share: f64,
}

impl Default for CutModel {
    fn default() -> Self {
        Self {
            tool_error: 20e-6,
            elastic_share: 0.0,
        }
    }
}

impl CutModel {
    /// D_new = cmd + w + κ(D_old − cmd − w) in m where the tool meets material, else D_old.
    pub fn cut(&self, commanded: f64, before: f64) -> f64 {
        let path = commanded + self.tool_error;
        if before > path {
            path + self.elastic_share * (before - path)
        } else {
            before
        }
    }
}

/// Size error along a part clamped at z = 0, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LengthError {
    /// e0: error at the clamping.
    pub base: f64,
    /// Error at the free end, without tilt.
    pub free_end: f64,
    /// L: free length.
    pub length: f64,
    /// Coefficient of z² from a tilt of the chuck, 1/m.
    pub tilt: f64,
}

/// The free length of a part is not positive.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("the free length is {0} m")]
pub struct LengthInvalid(
    /// The length in m.
    pub f64,
);

impl LengthError {
    /// Rough turning of the source's punch: 0.008 at the clamping to 0.035 mm at the free end of 90 mm.
    pub const ROUGH_TURNING: Self = Self {
        base: 8e-6,
        free_end: 35e-6,
        length: 90e-3,
        tilt: 0.0,
    };
    /// err(z) = e0 + (e_L − e0)(z/L)³ + tilt·z² in m at distance `z` (m) from the clamping.
    ///
    /// # Errors
    /// The length is not positive.
    pub fn at(&self, z: f64) -> Result<f64, LengthInvalid> {
        if self.length.is_nan() || self.length <= 0.0 {
            return Err(LengthInvalid(self.length));
        }
        let cubic = (self.free_end - self.base) * (z / self.length).powi(3);
        Ok(self.base + cubic + self.tilt * z * z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A.4, hazard 2: κ = 0.035, depth 0.5 on diameter.
    #[test]
    fn compensating_spring_back_overshoots_and_a_spring_pass_does_not() {
        let plant = CutModel {
            tool_error: 0.0,
            elastic_share: 0.035,
        };
        let nominal = 19.8e-3;
        let first = plant.cut(nominal, nominal + 0.5e-3);
        assert!((first - nominal - 17.5e-6).abs() < 1e-12);
        let compensated = plant.cut(nominal - (first - nominal), first);
        assert!((compensated - nominal + 16.3e-6).abs() < 0.05e-6);
        let spring = plant.cut(nominal, first);
        assert!((spring - nominal - 0.6e-6).abs() < 0.05e-6);
    }

    #[test]
    fn a_tool_that_meets_no_material_changes_nothing() {
        assert_eq!(CutModel::default().cut(0.02, 0.02), 0.02);
    }

    #[test]
    fn turning_error_grows_to_the_free_end_and_milling_error_does_not() {
        let turning: Vec<f64> = (0..=9)
            .map(|i| LengthError::ROUGH_TURNING.at(f64::from(i) * 0.01).unwrap())
            .collect();
        assert!(turning.is_sorted_by(|a, b| a < b));
        assert!((turning[9] - 35e-6).abs() < 1e-15 && turning[0] == 8e-6);
        // Rough milling with C locked: the same 0.018 mm everywhere (A.6).
        let milling = LengthError {
            base: 18e-6,
            free_end: 18e-6,
            ..LengthError::ROUGH_TURNING
        };
        assert_eq!(milling.at(0.0), milling.at(0.09));
        let pointless = LengthError {
            length: f64::NAN,
            ..LengthError::ROUGH_TURNING
        };
        assert!(pointless.at(0.01).is_err());
    }
}
