//! What several machines have in common.

/// Mean of sizes with their standard uncertainty, and the standard deviation between them: DerSimonian and Laird 1986, the
/// method of moments.
pub(super) fn random_effects(sizes: &[[f64; 2]]) -> ([f64; 2], f64) {
    let weighted = |between: f64| {
        let weights: Vec<f64> = sizes
            .iter()
            .map(|[_, u]| 1.0 / (u * u + between).max(f64::MIN_POSITIVE))
            .collect();
        let total: f64 = weights.iter().sum();
        let mean = sizes
            .iter()
            .zip(&weights)
            .map(|([size, _], weight)| size * weight)
            .sum::<f64>()
            / total;
        (mean, total, weights)
    };
    let (mean, total, weights) = weighted(0.0);
    let q: f64 = sizes
        .iter()
        .zip(&weights)
        .map(|([size, _], weight)| weight * (size - mean).powi(2))
        .sum();
    let squares: f64 = weights.iter().map(|weight| weight * weight).sum();
    let freedom = sizes.len().saturating_sub(1) as f64;
    let denominator = total - squares / total;
    let between = if denominator > 0.0 {
        ((q - freedom) / denominator).max(0.0)
    } else {
        0.0
    };
    let (mean, total, _) = weighted(between);
    ([mean, total.sqrt().recip()], between.sqrt())
}

#[cfg(test)]
mod tests {
    use super::random_effects;

    /// Two machines: Q = (1 − 3)² / 2 = 2 with unit variances, so that the variance between them is 1 by hand.
    #[test]
    fn machines_that_differ_make_the_common_size_less_certain() {
        let ([mean, uncertainty], between) = random_effects(&[[1.0, 1.0], [3.0, 1.0]]);
        assert!(
            (mean - 2.0).abs() < 1e-12
                && (between - 1.0).abs() < 1e-12
                && (uncertainty - 1.0).abs() < 1e-12
        );
        let ([_, alike], none) = random_effects(&[[2.0, 1.0], [2.0, 1.0]]);
        assert!(none == 0.0 && (alike - 0.5_f64.sqrt()).abs() < 1e-12);
    }
}
