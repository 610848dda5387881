//! Samples over time are correlated: what counts are blocks of them, and the independent share.

use inference::linear::dot;
use metrology::statistics::coverage_factor;

/// Number of standard errors from which a difference is significant.
const SURE: f64 = 2.0;
/// Longest lag of the autocorrelation, samples.
const LONGEST: usize = 300;
/// An autocorrelation below this counts as zero, and so do those behind it.
const DIED_OUT: f64 = 0.05;

/// 95 % interval of a root mean square from the scatter between blocks, with Student's t; no wider than a point for a
/// single block.
pub(crate) fn interval(squares: &[f64]) -> [f64; 2] {
    let count = squares.len() as f64;
    let mean = squares.iter().sum::<f64>() / count.max(1.0);
    let around: Vec<f64> = squares.iter().map(|square| square - mean).collect();
    let scatter = dot(&around, &around) / (count - 1.0).max(1.0);
    let half = if squares.len() > 1 {
        coverage_factor(0.95, count - 1.0) * (scatter / count).sqrt()
    } else {
        0.0
    };
    [(mean - half).max(0.0).sqrt(), (mean + half).sqrt()]
}

/// True when the blocks agree that it is better: by more than two standard errors of their differences, or of the
/// logarithms of their ratios, where a few blocks hold most of the motion.
pub(crate) fn better(before: &[f64], after: &[f64]) -> bool {
    let sure = |gains: &[f64]| {
        let count = gains.len() as f64;
        let mean = gains.iter().sum::<f64>() / count.max(1.0);
        let around: Vec<f64> = gains.iter().map(|gain| gain - mean).collect();
        let scatter = dot(&around, &around) / (count - 1.0).max(1.0);
        mean > SURE * (scatter / count.max(1.0)).sqrt()
    };
    let pairs = || before.iter().zip(after);
    let differences: Vec<f64> = pairs().map(|(a, b)| a - b).collect();
    let ratios: Vec<f64> = pairs()
        .map(|(a, b)| (a.max(1e-12) / b.max(1e-12)).ln())
        .collect();
    sure(&differences) || (differences.iter().sum::<f64>() > 0.0 && sure(&ratios))
}

/// Share of samples that are independent: the inverse of the integrated autocorrelation, up to the lag where it has died
/// out.
pub(crate) fn independent_share(residuals: &[f64]) -> f64 {
    let power = dot(residuals, residuals).max(f64::MIN_POSITIVE);
    let mut sum = 1.0;
    for lag in 1..(residuals.len() / 10).min(LONGEST) {
        let correlation = dot(&residuals[lag..], &residuals[..residuals.len() - lag]) / power;
        if correlation < DIED_OUT {
            break;
        }
        sum += 2.0 * correlation;
    }
    1.0 / sum
}
