//! Capability of a characteristic over parts.
//!
//! Estimators of ISO 22514-2:2017: Cp = (U − L) / 6 s, Cpk = min(U − x̄, x̄ − L) / 3 s, with the standard deviation s of the
//! sample; intervals at 95 %: of Cp by the χ² distribution of s² (Montgomery, *Introduction to Statistical Quality
//! Control*, 6th ed., section 8.3.5), of Cpk by the normal approximation of Bissell (*Applied Statistics* 39, 1990, 331–340). They
//! presume a stable and normal process, which the run chart shows or refutes. Lengths in m; indices are ratios.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Parts from which on an index is given: with fewer the interval is too wide to be of use.
pub const FEWEST: usize = 8;
/// Parts from which on an index may be stated as a capability by common practice; from fewer it is an estimate.
pub const STATEMENT: usize = 25;
/// 97.5 % quantile of the standard normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// Capability indices with their intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capability {
    /// Number of parts.
    pub parts: usize,
    /// Mean deviation, m.
    pub mean: f64,
    /// Standard deviation, m.
    pub deviation: f64,
    /// Cp.
    pub cp: f64,
    /// Its 95 % interval.
    pub cp_ci95: [f64; 2],
    /// Cpk.
    pub cpk: f64,
    /// Its 95 % interval.
    pub cpk_ci95: [f64; 2],
}

/// Capability of deviations from nominal (m) between limits of the deviation (m); none with too few parts, without spread,
/// or without limits.
pub fn capability(values: &[f64], lower: f64, upper: f64) -> Option<Capability> {
    let count = values.len();
    if count < FEWEST || !(upper > lower) || values.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let n = count as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square = values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>();
    let deviation = (square / (n - 1.0)).sqrt();
    let cp = (upper - lower) / (6.0 * deviation);
    let cpk = (upper - mean).min(mean - lower) / (3.0 * deviation);
    if !cp.is_finite() {
        return None;
    }
    Some(Capability {
        parts: count,
        mean,
        deviation,
        cp,
        cp_ci95: cp_interval(cp, n)?,
        cpk,
        cpk_ci95: cpk_interval(cpk, n),
    })
}

fn cp_interval(cp: f64, n: f64) -> Option<[f64; 2]> {
    let chi = ChiSquared::new(n - 1.0).ok()?;
    let end = |share: f64| cp * (chi.inverse_cdf(share) / (n - 1.0)).sqrt();
    Some([end(0.025), end(0.975)])
}

fn cpk_interval(cpk: f64, n: f64) -> [f64; 2] {
    let half = Z * (1.0 / (9.0 * n) + cpk * cpk / (2.0 * (n - 1.0))).sqrt();
    [cpk - half, cpk + half]
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    use super::*;

    /// Montgomery, 6th ed., section 8.3.5: limits 38 and 62, s = 1.75, n = 20.
    #[test]
    fn the_interval_of_cp_is_that_of_the_textbook() {
        let cp = (62.0 - 38.0) / (6.0 * 1.75);
        let told = [1.57, 3.01];
        for (found, told) in cp_interval(cp, 20.0).unwrap().iter().zip(told) {
            assert!((found - told).abs() < 0.006, "{found} for {told}");
        }
    }

    /// Of seeded normal samples of a process with Cpk = 1.33, about 95 % have an interval that holds it.
    #[test]
    fn the_interval_of_cpk_covers_what_it_claims() {
        let mut source = rand_pcg::Pcg64::seed_from_u64(7);
        let process = Normal::new(0.0, 1.0).unwrap();
        let trials = 4000;
        let mut held = 0;
        for _ in 0..trials {
            let values: Vec<f64> = (0..20).map(|_| process.sample(&mut source)).collect();
            // Nearer limit at 3 · 1.33 standard deviations.
            let [low, high] = capability(&values, -6.0, 3.99).unwrap().cpk_ci95;
            held += u32::from(low <= 1.33 && 1.33 <= high);
        }
        let share = f64::from(held) / f64::from(trials);
        assert!((0.93..0.975).contains(&share), "{share}");
    }

    #[test]
    fn a_process_off_its_middle_is_less_capable_than_it_could_be() {
        let values: Vec<f64> = (0..9).map(|i| 2e-6 + 1e-6 * f64::from(i % 3)).collect();
        let found = capability(&values, -10e-6, 10e-6).unwrap();
        // Mean 3 µm, s = sqrt(6/8) µm.
        assert!((found.mean - 3e-6).abs() < 1e-15);
        assert!((found.cp - 20.0 / (6.0 * 0.75_f64.sqrt())).abs() < 1e-9);
        assert!((found.cpk - 7.0 / (3.0 * 0.75_f64.sqrt())).abs() < 1e-9);
        assert!(capability(&values[..7], -10e-6, 10e-6).is_none());
        assert!(capability(&[1e-6; 9], -10e-6, 10e-6).is_none());
    }
}
