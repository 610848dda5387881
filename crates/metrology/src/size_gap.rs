//! Decides whether readings differ from a reference by a constant or in proportion to the size.
//!
//! Lengths in m. `docs/source_systems.md, A.3`: the pairs (size, gap), gap = reading − reference, are compared with a
//! constant (a probe error 2e) and with a line through zero (a scale or temperature error); the slope of the free
//! line, with its standard uncertainty, shows whether the sizes suffice to separate the two.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::statistics::student_quantile;

/// What explains the gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum GapLaw {
    /// A constant, not a proportion.
    Offset,
    /// A proportion, not a constant.
    Scale,
    /// Neither is excluded: the sizes are too alike or the gaps scatter too much.
    Undecided,
    /// Both are excluded.
    Neither,
}

/// Both laws against the same pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeGap {
    /// Mean gap in m.
    pub offset: f64,
    /// Residual sum of squares about the mean, m².
    pub offset_squares: f64,
    /// Gap per size of the line through zero, dimensionless.
    pub scale: f64,
    /// Residual sum of squares about that line, m².
    pub scale_squares: f64,
    /// Slope of the line with an intercept, dimensionless.
    pub slope: f64,
    /// Standard uncertainty of that slope.
    pub slope_uncertainty: f64,
    /// Intercept of that line, m.
    pub intercept: f64,
    /// Standard uncertainty of the intercept, m.
    pub intercept_uncertainty: f64,
    /// What follows at a two-sided level of 5 %.
    pub law: GapLaw,
}

/// Pairs without an answer.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum SizeGapError {
    /// Fewer than three pairs.
    #[error("a gap that depends on size needs at least 3 pairs, {0} given")]
    TooFewPairs(usize),
    /// A size or gap is NaN or infinite.
    #[error("pair {0} has a value that is not a number")]
    NotFinite(usize),
    /// All sizes are equal.
    #[error("all sizes are equal, so a constant and a proportion cannot be distinguished")]
    EqualSizes,
}

/// Compares the constant and the proportional law on `(size, gap)` pairs in m.
///
/// # Errors
/// See [`SizeGapError`].
pub fn size_gap(pairs: &[(f64, f64)]) -> Result<SizeGap, SizeGapError> {
    if pairs.len() < 3 {
        return Err(SizeGapError::TooFewPairs(pairs.len()));
    }
    if let Some(index) = pairs
        .iter()
        .position(|(size, gap)| !(size.is_finite() && gap.is_finite()))
    {
        return Err(SizeGapError::NotFinite(index));
    }
    let n = pairs.len() as f64;
    let mean = |value: fn(&(f64, f64)) -> f64| pairs.iter().map(value).sum::<f64>() / n;
    let (size_mean, offset) = (mean(|p| p.0), mean(|p| p.1));
    let size_squares: f64 = pairs.iter().map(|p| p.0 * p.0).sum();
    let spread: f64 = pairs.iter().map(|p| (p.0 - size_mean).powi(2)).sum();
    if spread <= (4.0 * f64::EPSILON).powi(2) * size_squares {
        return Err(SizeGapError::EqualSizes);
    }
    let scale = pairs.iter().map(|p| p.0 * p.1).sum::<f64>() / size_squares;
    let covariance: f64 = pairs
        .iter()
        .map(|p| (p.0 - size_mean) * (p.1 - offset))
        .sum();
    let slope = covariance / spread;
    let intercept = offset - slope * size_mean;
    let squares =
        |law: &dyn Fn(f64) -> f64| -> f64 { pairs.iter().map(|p| (p.1 - law(p.0)).powi(2)).sum() };
    let variance = squares(&|size| intercept + slope * size) / (n - 2.0);
    let slope_uncertainty = (variance / spread).sqrt();
    let intercept_uncertainty = (variance * (1.0 / n + size_mean * size_mean / spread)).sqrt();
    let coverage = student_quantile(0.975, n - 2.0);
    let sloped = slope.abs() > coverage * slope_uncertainty;
    let shifted = intercept.abs() > coverage * intercept_uncertainty;
    Ok(SizeGap {
        offset,
        offset_squares: squares(&|_| offset),
        scale,
        scale_squares: squares(&|size| scale * size),
        slope,
        slope_uncertainty,
        intercept,
        intercept_uncertainty,
        law: match (shifted, sloped) {
            (true, false) => GapLaw::Offset,
            (false, true) => GapLaw::Scale,
            (false, false) => GapLaw::Undecided,
            (true, true) => GapLaw::Neither,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZES: [f64; 5] = [19.8, 23.5, 17.8, 17.8, 17.8];

    fn table(gaps: [f64; 5]) -> SizeGap {
        let pairs: Vec<(f64, f64)> = SIZES
            .iter()
            .zip(gaps)
            .map(|(size, gap)| (size * 1e-3, gap * 1e-6))
            .collect();
        size_gap(&pairs).unwrap()
    }

    /// A.3 prints 88 / 605 and 0.8 / 4.3 µm², −1.06 ± 0.90 and −0.06 ± 0.10 µm/mm.
    #[test]
    fn the_figures_of_tables_3_and_4_follow() {
        let before = table([75.0, 65.0, 73.0, 67.0, 75.0]);
        assert!((before.offset - 71e-6).abs() < 1e-12);
        assert!((before.offset_squares * 1e12 - 88.0).abs() < 0.5);
        assert!(
            (before.scale_squares * 1e12 - 605.0).abs() < 0.5,
            "{before:?}"
        );
        assert!((before.slope * 1e3 + 1.06).abs() < 0.005);
        assert!((before.slope_uncertainty * 1e3 - 0.90).abs() < 0.005);
        let after = table([6.0, 6.0, 6.0, 6.0, 7.0]);
        assert!((after.offset_squares * 1e12 - 0.8).abs() < 0.05);
        assert!((after.scale_squares * 1e12 - 4.3).abs() < 0.05, "{after:?}");
        assert!((after.slope * 1e3 + 0.06).abs() < 0.005);
        assert!((after.slope_uncertainty * 1e3 - 0.10).abs() < 0.005);
        assert_eq!((before.law, after.law), (GapLaw::Offset, GapLaw::Offset));
    }

    #[test]
    fn a_scale_error_is_called_a_scale_error() {
        let scatter = [0.1e-6, -0.2e-6, 0.15e-6, -0.1e-6, 0.05e-6];
        let pairs: Vec<(f64, f64)> = [0.01, 0.05, 0.1, 0.15, 0.2]
            .iter()
            .zip(scatter)
            .map(|(size, noise)| (*size, 100e-6 * size + noise))
            .collect();
        assert_eq!(size_gap(&pairs).unwrap().law, GapLaw::Scale);
        let both: Vec<(f64, f64)> = pairs.iter().map(|p| (p.0, p.1 + 20e-6)).collect();
        assert_eq!(size_gap(&both).unwrap().law, GapLaw::Neither);
    }

    #[test]
    fn sizes_too_alike_decide_nothing() {
        let alike = [(0.0178, 70e-6), (0.0179, 75e-6), (0.0180, 66e-6)];
        assert_eq!(size_gap(&alike).unwrap().law, GapLaw::Undecided);
        assert_eq!(size_gap(&[(0.01, 1e-6); 4]), Err(SizeGapError::EqualSizes));
        assert_eq!(size_gap(&alike[..2]), Err(SizeGapError::TooFewPairs(2)));
        assert_eq!(
            size_gap(&[(0.01, 1e-6), (f64::NAN, 0.0), (0.02, 0.0)]),
            Err(SizeGapError::NotFinite(1))
        );
    }
}
