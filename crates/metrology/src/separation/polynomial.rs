//! Separation by a polynomial form of the part: equations (7)–(12) of `docs/source_systems.md, C.3`.
//!
//! Bias, not noise, dominates where the part is wavier than the polynomial (C.4, 6): use
//! [`super::least_squares`] unless only two passes at a large shift exist, and heed the warning.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{SeparationError, check};
use crate::autocorrelation::{Moran, moran_of_residuals};

/// A separation whose part is a polynomial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolynomialSeparation {
    /// a_1…a_n in R(z) = Σ aᵢ zⁱ, z in m from the first sample; a_0 cannot be known.
    pub coefficients: Vec<f64>,
    /// R at the N samples, m.
    pub part: Vec<f64>,
    /// S = K0 − R at the N samples, m.
    pub guideway: Vec<f64>,
    /// Root mean square in m of ΔK less the polynomial's.
    pub residual_rms: f64,
    /// True where those residuals are not random: the part is wavier than the polynomial, and the result is biased.
    pub bias_suspected: bool,
}

/// Equation (9) by least squares at the given order n ≥ 1, for a part moved by `shift` (m) between passes sampled every
/// `spacing` (m).
///
/// # Errors
/// See [`SeparationError`].
pub fn polynomial(
    first: &[f64],
    shifted: &[f64],
    spacing: f64,
    shift: f64,
    order: usize,
) -> Result<PolynomialSeparation, SeparationError> {
    check(&[first, shifted], 3)?;
    for length in [spacing, shift] {
        if !(length > 0.0 && length.is_finite()) {
            return Err(SeparationError::Spacing(length));
        }
    }
    let n = first.len();
    if order == 0 || order >= n {
        return Err(SeparationError::Order(order));
    }
    // Scaled to the length, so that the powers stay comparable.
    let length = spacing * (n - 1) as f64 + shift;
    let at = |i: usize| spacing * i as f64 / length;
    let step = shift / length;
    let matrix = DMatrix::from_fn(n, order, |i, j| {
        let power = j as i32 + 1;
        (at(i) + step).powi(power) - at(i).powi(power)
    });
    let difference = DVector::from_fn(n, |i, _| shifted[i] - first[i]);
    let qr = matrix.clone().qr();
    let scaled = qr
        .r()
        .solve_upper_triangular(&(qr.q().transpose() * &difference))
        .ok_or(SeparationError::Order(order))?;
    let residuals = difference - &matrix * &scaled;
    let part: Vec<f64> = (0..n)
        .map(|i| {
            let powers = scaled.iter().enumerate();
            powers.map(|(j, a)| a * at(i).powi(j as i32 + 1)).sum()
        })
        .collect();
    // Rounding left by an exact polynomial has no distribution to test.
    let exact = residuals.amax()
        <= 1e-12
            * first
                .iter()
                .chain(shifted)
                .fold(0.0, |m: f64, k| m.max(k.abs()));
    Ok(PolynomialSeparation {
        coefficients: scaled
            .iter()
            .enumerate()
            .map(|(j, a)| a / length.powi(j as i32 + 1))
            .collect(),
        guideway: first.iter().zip(&part).map(|(k, r)| k - r).collect(),
        part,
        residual_rms: (residuals.norm_squared() / n as f64).sqrt(),
        bias_suspected: !exact
            && moran_of_residuals(residuals.as_slice(), &matrix)
                .is_some_and(|m: Moran| !m.is_random()),
    })
}
