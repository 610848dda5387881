//! Decides whether deviations along a profile are random: Moran's I with neighbours as weights.
//!
//! Values in any unit, at equal spacing along the profile. `docs/source_systems.md, B.4` (after Poniatowska and
//! Werner): W_ij = 1 for |i − j| = 1. For raw data the moments under randomisation-free normality; for residuals of a
//! regression those of Cliff and Ord (1981), which account for what the regression has already taken out.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// One-sided 5 % point of the normal distribution: the threshold of the test.
pub const THRESHOLD: f64 = 1.645;

/// Moran's I and its moments under randomness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moran {
    /// I: near 0 for random values, towards 1 for smooth ones.
    pub index: f64,
    /// E[I] of random values.
    pub expected: f64,
    /// Var[I] of random values.
    pub variance: f64,
}

impl Moran {
    /// (I − E)/√Var.
    pub fn score(&self) -> f64 {
        (self.index - self.expected) / self.variance.sqrt()
    }

    /// True unless neighbours resemble each other more than chance allows at 5 %.
    pub fn is_random(&self) -> bool {
        self.score() <= THRESHOLD
    }
}

/// I itself of centred values.
fn index(z: &[f64]) -> Option<f64> {
    let n = z.len() as f64;
    let squares: f64 = z.iter().map(|v| v * v).sum();
    let products: f64 = z.windows(2).map(|pair| pair[0] * pair[1]).sum();
    // S0 = 2(n − 1): both directions of each pair; zᵀWz has both as well.
    let value = n / (n - 1.0) * products / squares;
    value.is_finite().then_some(value)
}

/// Moran's I of raw values; `None` for fewer than four, for equal values or values that are not finite.
pub fn moran(values: &[f64]) -> Option<Moran> {
    let n = values.len() as f64;
    if values.len() < 4 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n;
    let centred: Vec<f64> = values.iter().map(|v| v - mean).collect();
    if centred
        .iter()
        .all(|z| z.abs() <= 4.0 * f64::EPSILON * mean.abs())
    {
        return None;
    }
    let s0 = 2.0 * (n - 1.0);
    // ½Σ(2)² over ordered neighbour pairs; (row + column sums)² = 16 inside, 4 at both ends.
    let s1 = 4.0 * (n - 1.0);
    let s2 = 16.0 * (n - 2.0) + 8.0;
    let expected = -1.0 / (n - 1.0);
    let second = (n * n * s1 - n * s2 + 3.0 * s0 * s0) / ((n * n - 1.0) * s0 * s0);
    Some(Moran {
        index: index(&centred)?,
        expected,
        variance: second - expected * expected,
    })
}

/// Moran's I of the `residuals` (n) of a least-squares regression on `basis` (n × k); `None` without degrees of freedom
/// or residuals to test, or if the basis has dependent columns.
pub fn moran_of_residuals(residuals: &[f64], basis: &DMatrix<f64>) -> Option<Moran> {
    let (n, k) = basis.shape();
    if residuals.len() != n || n < k + 3 {
        return None;
    }
    let q = basis.clone().qr().q();
    let weighted = neighbours_times(&q);
    // With M = I − QQᵀ: tr(MW) = −tr(QᵀWQ), and tr(MWMW) = tr(WW) − 2tr(QᵀWWQ) + tr((QᵀWQ)²).
    let inner = q.transpose() * &weighted;
    let trace = -inner.trace();
    let square = 2.0 * (n as f64 - 1.0) - 2.0 * weighted.norm_squared() + (&inner * &inner).trace();
    let (nf, freedom) = (n as f64, (n - k) as f64);
    let scale = nf / (2.0 * (nf - 1.0));
    let expected = scale * trace / freedom;
    let second = scale * scale * (2.0 * square + trace * trace) / (freedom * (freedom + 2.0));
    let variance = second - expected * expected;
    (variance > 0.0).then_some(Moran {
        index: index(residuals)?,
        expected,
        variance,
    })
}

/// W·B for the chain of neighbours.
fn neighbours_times(b: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(b.nrows(), b.ncols(), |i, j| {
        let before = if i > 0 { b[(i - 1, j)] } else { 0.0 };
        let after = if i + 1 < b.nrows() {
            b[(i + 1, j)]
        } else {
            0.0
        };
        before + after
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    /// B.4: "both variance formulas agree to 1e-15 for raw data", that is for a regression on the constant.
    #[test]
    fn both_variances_agree_for_a_constant_regression() {
        for n in [5, 20, 200] {
            let values: Vec<f64> = (0..n).map(|i| f64::from(i * i % 17)).collect();
            let raw = moran(&values).unwrap();
            let mean = values.iter().sum::<f64>() / f64::from(n);
            let residuals: Vec<f64> = values.iter().map(|v| v - mean).collect();
            let ones = DMatrix::from_element(n as usize, 1, 1.0);
            let regression = moran_of_residuals(&residuals, &ones).unwrap();
            assert!((raw.expected - regression.expected).abs() < 1e-15);
            assert!((raw.variance - regression.variance).abs() < 1e-15, "{n}");
            assert!((raw.index - regression.index).abs() < 1e-14);
        }
    }

    /// The traces against full matrices.
    #[test]
    fn moments_of_residuals_agree_with_the_definition() {
        let (n, k) = (12, 3);
        let basis = DMatrix::from_fn(n, k, |i, j| (i as f64 / 11.0).powi(j as i32));
        let inverse = (basis.transpose() * &basis).try_inverse().unwrap();
        let m = DMatrix::identity(n, n) - &basis * inverse * basis.transpose();
        let w = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from(i.abs_diff(j) == 1)));
        let s0 = w.sum();
        let mw = &m * &w;
        let expected = n as f64 / s0 * mw.trace() / (n - k) as f64;
        let second = (n as f64 / s0).powi(2) * (2.0 * (&mw * &mw).trace() + mw.trace().powi(2))
            / ((n - k) as f64 * (n - k + 2) as f64);
        let values: Vec<f64> = (m * nalgebra::DVector::from_fn(n, |i, _| (i * 7 % 5) as f64))
            .iter()
            .copied()
            .collect();
        let moran = moran_of_residuals(&values, &basis).unwrap();
        assert!((moran.expected - expected).abs() < 1e-13);
        assert!((moran.variance - (second - expected * expected)).abs() < 1e-13);
    }

    /// B.4: white noise is rejected in 5.4 % of cases.
    #[test]
    fn white_noise_is_rejected_at_the_stated_rate_and_smooth_data_always() {
        let mut rng = Pcg64::seed_from_u64(1);
        let rejected = (0..4000)
            .filter(|_| {
                let noise: Vec<f64> = (0..200).map(|_| StandardNormal.sample(&mut rng)).collect();
                !moran(&noise).unwrap().is_random()
            })
            .count();
        let rate = rejected as f64 / 4000.0;
        assert!((rate - 0.054).abs() < 0.011, "{rate}");
        let wave: Vec<f64> = (0..200).map(|i| (f64::from(i) * 0.1).sin()).collect();
        assert!(moran(&wave).unwrap().score() > 10.0);
    }

    #[test]
    fn nothing_to_test_gives_no_verdict() {
        assert_eq!(moran(&[1.0, 2.0, 3.0]), None);
        assert_eq!(moran(&[0.1; 50]), None);
        assert_eq!(moran(&[1.0, f64::NAN, 3.0, 2.0]), None);
        assert_eq!(
            moran_of_residuals(&[0.0; 4], &DMatrix::identity(4, 4)),
            None
        );
    }
}
