//! Detection limits: the noncentrality of a χ² test with a given risk and power.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Terms of the mixture; its weights sum to one long before.
const TERMS: usize = 2000;

/// Squared length, over the variance of the noise, of a signature of `columns` columns that a χ² test at `risk` finds
/// with probability `power`.
///
/// The noncentral χ² is the Poisson mixture of central ones (Johnson, Kotz and Balakrishnan 1995, chapter 29).
pub fn noncentrality(columns: usize, risk: f64, power: f64) -> f64 {
    let Ok(central) = ChiSquared::new(columns.max(1) as f64) else {
        return f64::INFINITY;
    };
    let bound = central.inverse_cdf(1.0 - risk.clamp(1e-12, 0.5));
    let wanted = power.clamp(0.01, 0.999_999);
    let (mut low, mut high) = (0.0, 1.0);
    while power_of_test(columns, bound, high) < wanted && high < 1e6 {
        high *= 2.0;
    }
    for _ in 0..80 {
        let middle = f64::midpoint(low, high);
        if power_of_test(columns, bound, middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Probability that a noncentral χ² exceeds a bound.
fn power_of_test(columns: usize, bound: f64, noncentrality: f64) -> f64 {
    let half = 0.5 * noncentrality;
    let (mut log_weight, mut spent, mut below) = (-half, 0.0, 0.0);
    for term in 0..TERMS {
        let weight = f64::exp(log_weight);
        if let Ok(central) = ChiSquared::new((columns.max(1) + 2 * term) as f64) {
            below += weight * central.cdf(bound);
        }
        spent += weight;
        if spent > 1.0 - 1e-12 {
            break;
        }
        log_weight += half.ln() - ((term + 1) as f64).ln();
    }
    1.0 - below
}

#[cfg(test)]
mod tests {
    use super::noncentrality;

    #[test]
    fn noncentralities_agree_with_published_ones() {
        // Haynam, Govindarajulu and Leone (1970), risk 0.05 and 0.01, power 0.9.
        for (columns, risk, published) in [(1, 0.05, 10.507), (2, 0.05, 12.654), (1, 0.01, 14.879)]
        {
            let found = noncentrality(columns, risk, 0.9);
            assert!(
                (found - published).abs() < 2e-3,
                "{columns}, {risk}: {found}"
            );
        }
    }
}
