//! Splits measured deviations into a deterministic part worth correcting and a random rest.
//!
//! Deviations in m at equal spacing. `docs/source_systems.md, B.4` (after Poniatowska and Werner): least-squares
//! cubic B-splines of growing number of control points, until Moran's I finds the residuals random.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::{ProfileError, uniform_basis};
use crate::autocorrelation::{moran, moran_of_residuals};

/// Deterministic and random part of deviations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Split {
    /// D in m: what to correct with; zero everywhere if the deviations are random already.
    pub deterministic: Vec<f64>,
    /// T − D in m.
    pub random: Vec<f64>,
    /// Control points of the regression; 0 if there is nothing to correct.
    pub control_points: usize,
    /// False if no regression passed the test, as happens when the noise itself is not random; the split is then the one
    /// whose rest comes closest.
    pub passed: bool,
}

/// B.4 on deviations (m) at equal spacing, with at most half as many control points as deviations.
///
/// # Errors
/// Fewer than ten deviations, or one that is not finite.
pub fn split(deviations: &[f64]) -> Result<Split, ProfileError> {
    let n = deviations.len();
    if n < 10 {
        return Err(ProfileError::TooFewPoints {
            needed: 10,
            given: n,
        });
    }
    if let Some(index) = deviations.iter().position(|t| !t.is_finite()) {
        return Err(ProfileError::NotFinite(index));
    }
    // Equal deviations have no index; nothing random varies about them.
    if moran(deviations).is_some_and(|m| m.is_random()) {
        return Ok(Split {
            deterministic: vec![0.0; n],
            random: deviations.to_vec(),
            control_points: 0,
            passed: true,
        });
    }
    let parameters: Vec<f64> = (0..n).map(|i| i as f64 / (n - 1) as f64).collect();
    let right = DVector::from_column_slice(deviations);
    let mut closest: Option<(f64, Split)> = None;
    for control in 4..=n / 2 {
        let Ok(basis) = uniform_basis(control, &parameters) else {
            break;
        };
        let q = basis.clone().qr().q();
        let fitted = &q * (q.transpose() * &right);
        let residuals = &right - &fitted;
        // What rounding leaves of an exact fit has no neighbours to resemble.
        let exact = residuals.amax() <= 1e-12 * right.amax();
        let moran = moran_of_residuals(residuals.as_slice(), &basis);
        let passed = exact || moran.is_some_and(|m| m.is_random());
        let score = moran.map_or(f64::INFINITY, |m| m.score());
        if passed || closest.as_ref().is_none_or(|(lowest, _)| score < *lowest) {
            let found = Split {
                deterministic: fitted.iter().copied().collect(),
                random: residuals.iter().copied().collect(),
                control_points: control,
                passed,
            };
            if passed {
                return Ok(found);
            }
            closest = Some((score, found));
        }
    }
    closest
        .map(|(_, split)| split)
        .ok_or(ProfileError::Undetermined)
}
