//! The few statistics the other modules share: quantiles, medians, robust scale.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Quantile of Student's distribution: the x with P(T ≤ x) = `probability` for `freedom` degrees of freedom, which
/// need not be whole; infinite degrees of freedom give the normal distribution. NaN outside 0 < probability < 1 or
/// freedom > 0.
pub fn student_quantile(probability: f64, freedom: f64) -> f64 {
    if !(probability > 0.0 && probability < 1.0 && freedom > 0.0) {
        return f64::NAN;
    }
    if freedom > 1e10 {
        return Normal::standard().inverse_cdf(probability);
    }
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::NAN, |t| t.inverse_cdf(probability))
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

/// 1.4826 times the median absolute deviation from `centre`: estimates a normal standard deviation from the better half
/// of the values.
pub fn robust_deviation(values: &[f64], centre: f64) -> f64 {
    let deviations: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
    1.4826 * median(&deviations)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against SciPy 1.17, `stats.t.ppf`; GUM table G.2 prints the same to two decimals.
    #[test]
    fn student_quantiles_agree_with_published_ones() {
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

    #[test]
    fn one_wild_value_moves_neither_median_nor_scale() {
        let mut values = vec![1.0, 1.1, 0.9, 1.05, 0.95, 1.02, 0.98];
        let before = robust_deviation(&values, median(&values));
        values.push(1e9);
        let after = robust_deviation(&values, median(&values));
        assert!((median(&values) - 1.01).abs() < 1e-12);
        assert!(after < 2.0 * before);
    }
}
