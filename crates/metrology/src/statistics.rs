//! Statistics that the other modules and the nodes share: quantiles, coverage factors, location and scale.
//!
//! Values are in any unit; results have the unit of the values. Distributions are those of `statrs`. Nothing here draws
//! random numbers.
//!
//! ```
//! use metrology::statistics::coverage_factor;
//!
//! // GUM table G.2: 12.71 for one degree of freedom, 1.96 for a standard uncertainty that is known exactly.
//! assert_eq!(format!("{:.2}", coverage_factor(0.95, 1.0)), "12.71");
//! assert_eq!(format!("{:.2}", coverage_factor(0.95, f64::INFINITY)), "1.96");
//! ```

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

/// Median absolute deviation to standard deviation of a normal distribution: 1/Φ⁻¹(3/4), with the four decimals that are
/// usually printed (Rousseeuw and Croux 1993).
pub const MAD_FACTOR: f64 = 1.4826;

/// Degrees of freedom beyond which Student's distribution is taken as normal.
const PRACTICALLY_INFINITE: f64 = 1e10;

/// Quantile of the standard normal distribution: the x with Φ(x) = `probability`; NaN outside 0 < probability < 1.
pub fn normal_quantile(probability: f64) -> f64 {
    if !(probability > 0.0 && probability < 1.0) {
        return f64::NAN;
    }
    Normal::standard().inverse_cdf(probability)
}

/// Quantile of Student's distribution: the x with P(T ≤ x) = `probability` for `degrees_of_freedom`, which need not be an
/// integer; infinite degrees of freedom give the normal distribution. NaN outside 0 < probability < 1 or
/// degrees_of_freedom > 0.
pub fn student_quantile(probability: f64, degrees_of_freedom: f64) -> f64 {
    if !(probability > 0.0 && probability < 1.0 && degrees_of_freedom > 0.0) {
        return f64::NAN;
    }
    if degrees_of_freedom > PRACTICALLY_INFINITE {
        return normal_quantile(probability);
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom).map_or(f64::NAN, |t| t.inverse_cdf(probability))
}

/// Two-sided coverage factor: the k with P(|T| ≤ k) = `probability` (GUM G.3.2, table G.2). Infinite degrees of freedom
/// give the normal distribution's, 1.96 for 0.95. NaN as [`student_quantile`].
pub fn coverage_factor(probability: f64, degrees_of_freedom: f64) -> f64 {
    student_quantile(f64::midpoint(1.0, probability), degrees_of_freedom)
}

/// Probability that a standard normal value is at most `value`.
pub fn normal_cdf(value: f64) -> f64 {
    Normal::standard().cdf(value)
}

/// The coverage factor that covers with `degrees_of_freedom` what `factor` covers with infinitely many (GUM G.6.4 with
/// k = 2 gives the usual table: 2.28 for 10). `factor` itself where the degrees of freedom are infinite.
pub fn student_factor(factor: f64, degrees_of_freedom: f64) -> f64 {
    if degrees_of_freedom > PRACTICALLY_INFINITE {
        return factor;
    }
    student_quantile(Normal::standard().cdf(factor), degrees_of_freedom)
}

/// Arithmetic mean; NaN of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Root mean square, divisor n; 0 of nothing.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Experimental standard deviation, divisor n − 1 (GUM 4.2.2); NaN of fewer than two values.
pub fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (values.len() as f64 - 1.0)).sqrt()
}

/// Median; NaN of nothing. Values that are not numbers sort to the ends.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => f64::midpoint(sorted[n / 2 - 1], sorted[n / 2]),
    }
}

/// [`MAD_FACTOR`] times the median absolute deviation from `centre`: estimates a normal standard deviation although up to
/// half of the values are outliers.
pub fn robust_deviation(values: &[f64], centre: f64) -> f64 {
    let deviations: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
    MAD_FACTOR * median(&deviations)
}

/// Quantile of the chi-squared distribution: the x with P(χ² ≤ x) = `probability`; NaN outside 0 < probability < 1 or
/// degrees_of_freedom > 0.
pub fn chi_squared_quantile(probability: f64, degrees_of_freedom: f64) -> f64 {
    if !(probability > 0.0 && probability < 1.0 && degrees_of_freedom > 0.0) {
        return f64::NAN;
    }
    ChiSquared::new(degrees_of_freedom).map_or(f64::NAN, |chi| chi.inverse_cdf(probability))
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution as _, StandardNormal};
    use rand_pcg::Pcg64;

    use super::*;

    /// Against SciPy 1.17, `stats.t.ppf`.
    #[test]
    fn student_quantiles_agree_with_scipy() {
        for (p, freedom, value) in [
            (0.975, 1.0, 12.706204736174694),
            (0.975, 3.0, 3.1824463052837078),
            (0.97725, 10.0, 2.28368161329964),
            (0.975, 7.5, 2.333039626864974),
            (0.995, 50.0, 2.677793270940844),
            (0.025, 3.0, -3.1824463052837078),
            (0.975, f64::INFINITY, 1.959963984540054),
        ] {
            let quantile = student_quantile(p, freedom);
            assert!(
                (quantile / value - 1.0).abs() < 1e-9,
                "t({p}, {freedom}) = {quantile}"
            );
        }
        assert!(student_quantile(1.0, 3.0).is_nan() && student_quantile(0.9, 0.0).is_nan());
    }

    /// GUM (JCGM 100:2008) table G.2, printed to two decimals: t_p(ν) for p = 68.27, 90, 95, 95.45, 99 and 99.73 %.
    #[test]
    fn coverage_factors_are_those_of_table_g2_of_the_gum() {
        let probabilities = [0.6827, 0.90, 0.95, 0.9545, 0.99, 0.9973];
        for (freedom, row) in [
            (1.0, [1.84, 6.31, 12.71, 13.97, 63.66, 235.80]),
            (2.0, [1.32, 2.92, 4.30, 4.53, 9.92, 19.21]),
            (3.0, [1.20, 2.35, 3.18, 3.31, 5.84, 9.22]),
            (5.0, [1.11, 2.02, 2.57, 2.65, 4.03, 5.51]),
            (10.0, [1.05, 1.81, 2.23, 2.28, 3.17, 3.96]),
            (20.0, [1.03, 1.72, 2.09, 2.13, 2.85, 3.42]),
            (50.0, [1.01, 1.68, 2.01, 2.05, 2.68, 3.16]),
            (100.0, [1.005, 1.660, 1.984, 2.025, 2.626, 3.077]),
            (f64::INFINITY, [1.000, 1.645, 1.960, 2.000, 2.576, 3.000]),
        ] {
            for (probability, printed) in probabilities.into_iter().zip(row) {
                let factor = coverage_factor(probability, freedom);
                // The table's own probabilities are rounded to four digits, which shows in the last column.
                let allowed = if probability > 0.997 {
                    4e-4 * printed
                } else {
                    0.0
                };
                let unit = if freedom >= 100.0 { 0.0006 } else { 0.0051 };
                assert!(
                    (factor - printed).abs() <= unit + allowed,
                    "k({probability}, {freedom}) = {factor}, printed {printed}"
                );
            }
        }
    }

    /// NIST/SEMATECH e-Handbook, 1.3.6.7.4, critical values of the chi-squared distribution.
    #[test]
    fn chi_squared_quantiles_are_those_of_the_nist_handbook() {
        for (probability, freedom, printed) in [
            (0.95, 1.0, 3.841),
            (0.95, 2.0, 5.991),
            (0.95, 10.0, 18.307),
            (0.975, 10.0, 20.483),
            (0.99, 30.0, 50.892),
            (0.025, 10.0, 3.247),
            (0.05, 100.0, 77.929),
            (0.999, 5.0, 20.515),
        ] {
            let quantile = chi_squared_quantile(probability, freedom);
            assert!(
                (quantile - printed).abs() < 6e-4,
                "χ²({probability}, {freedom}) = {quantile}, printed {printed}"
            );
        }
        assert!(chi_squared_quantile(0.5, 0.0).is_nan());
    }

    /// GUM table G.2, fraction 95.45 %.
    #[test]
    fn a_factor_of_two_grows_with_few_degrees_of_freedom() {
        for (freedom, printed) in [
            (1.0, 13.97),
            (2.0, 4.53),
            (5.0, 2.65),
            (10.0, 2.28),
            (50.0, 2.05),
        ] {
            assert!((student_factor(2.0, freedom) - printed).abs() < 0.0051);
        }
        assert_eq!(student_factor(2.0, f64::INFINITY), 2.0);
    }

    /// The mean of n readings ± k·s/√n holds the true value as often as it says: with Student's factor, and visibly less
    /// often with the normal one.
    #[test]
    fn a_mean_of_few_readings_is_covered_as_often_as_stated() {
        let mut random = Pcg64::seed_from_u64(11);
        let runs = 20_000;
        for (count, normal_covers) in [(2, 0.700), (3, 0.811), (6, 0.893)] {
            let freedom = f64::from(count) - 1.0;
            let factors = [coverage_factor(0.95, freedom), normal_quantile(0.975)];
            let mut covered = [0_u32; 2];
            for _ in 0..runs {
                let readings: Vec<f64> = (0..count)
                    .map(|_| StandardNormal.sample(&mut random))
                    .collect();
                let standard = standard_deviation(&readings) / f64::from(count).sqrt();
                for (covered, factor) in covered.iter_mut().zip(factors) {
                    *covered += u32::from(mean(&readings).abs() <= factor * standard);
                }
            }
            let [student, normal] = covered.map(|times| f64::from(times) / f64::from(runs));
            // Three standard deviations of the count are 0.0046 at 0.95 and 0.0097 at 0.7.
            assert!((student - 0.95).abs() < 0.0046, "{count}: {student}");
            assert!((normal - normal_covers).abs() < 0.0100, "{count}: {normal}");
        }
    }

    #[test]
    fn location_and_scale_of_few_values() {
        assert_eq!(mean(&[1.0, 2.0, 6.0]), 3.0);
        assert_eq!(rms(&[3.0, -4.0]), (12.5_f64).sqrt());
        assert_eq!(rms(&[]), 0.0);
        assert_eq!(standard_deviation(&[1.0, 3.0]), 2.0_f64.sqrt());
        assert!(mean(&[]).is_nan() && standard_deviation(&[1.0]).is_nan());
        assert!((MAD_FACTOR * normal_quantile(0.75) - 1.0).abs() < 2e-6);
    }

    #[test]
    fn one_outlier_moves_neither_median_nor_scale() {
        let mut values = vec![1.0, 1.1, 0.9, 1.05, 0.95, 1.02, 0.98];
        let before = robust_deviation(&values, median(&values));
        values.push(1e9);
        let after = robust_deviation(&values, median(&values));
        assert!((median(&values) - 1.01).abs() < 1e-12);
        assert!(after < 2.0 * before);
    }
}
