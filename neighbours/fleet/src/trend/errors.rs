//! Errors of sessions as a mixture of normal distributions: Student's t, and rare false sessions.

use metrology::statistics::chi_squared_quantile;

/// One session in so many is false: its estimate says nothing (Huber 1964, contaminated normal distribution).
const FALSE: f64 = 0.01;
/// Standard deviation of a false session over that of a true one.
const WIDE: f64 = 10.0;
/// Cumulative probabilities between which the scales of Student's t are taken together.
const EDGES: [f64; PARTS + 1] = [0.0, 0.003, 0.03, 0.15, 0.5, 1.0];
const PARTS: usize = 5;

/// Distribution of errors of unit variance (false sessions aside).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Probability and variance of each normal distribution.
    parts: [(f64, f64); PARTS + 1],
}

impl Errors {
    /// Normal, without false sessions.
    pub const NORMAL: Self = {
        let mut parts = [(0.0, 1.0); PARTS + 1];
        parts[0].0 = 1.0;
        Self { parts }
    };

    /// Student's t with so many degrees of freedom (above 2; infinite: normal), and false sessions. The t distribution is a mixture
    /// of normal ones of variance ν / χ²; the tenths of it are taken together, those of large variance finely.
    pub fn student(freedom: f64) -> Self {
        let mut parts = [(0.0, 1.0); PARTS + 1];
        if freedom.is_finite() {
            for (part, edge) in parts.iter_mut().zip(EDGES.windows(2)) {
                let middle = chi_squared_quantile(f64::midpoint(edge[0], edge[1]), freedom);
                *part = (edge[1] - edge[0], freedom / middle);
            }
            let variance: f64 = parts.iter().map(|(weight, scale)| weight * scale).sum();
            for part in &mut parts {
                part.1 /= variance;
            }
        } else {
            parts[0].0 = 1.0;
        }
        for part in &mut parts {
            part.0 *= 1.0 - FALSE;
        }
        parts[PARTS] = (FALSE, WIDE * WIDE);
        Self { parts }
    }

    /// Of a value `off` its prediction, whose variance is `predicted`, with errors of `variance`: the logarithm of its density, the mean
    /// of the reciprocal variance given the value, and by how much of it the variance of the prediction falls.
    pub(super) fn density(&self, off: f64, predicted: f64, variance: f64) -> (f64, f64, f64) {
        let mut all = [(f64::NEG_INFINITY, 0.0); PARTS + 1];
        let mut largest = f64::NEG_INFINITY;
        for (one, (weight, scale)) in all.iter_mut().zip(self.parts) {
            if weight > 0.0 {
                let precision = (predicted + scale * variance)
                    .max(f64::MIN_POSITIVE)
                    .recip();
                let exponent = weight.ln() + 0.5 * precision.ln() - 0.5 * off * off * precision;
                *one = (exponent, precision);
                largest = largest.max(exponent);
            }
        }
        let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
        for (exponent, precision) in all {
            let share = (exponent - largest).exp();
            sum += share;
            first += share * precision;
            second += share * precision * precision;
        }
        let (first, second) = (first / sum, second / sum);
        let density = largest + sum.ln() - 0.5 * std::f64::consts::TAU.ln();
        (density, first, first - off * off * (second - first * first))
    }

    /// One error of unit variance, from a normal number and one that is uniform between 0 and 1.
    pub(super) fn draw(&self, normal: f64, uniform: f64) -> f64 {
        let mut left = uniform;
        for (weight, scale) in self.parts {
            if left < weight {
                return normal * scale.sqrt();
            }
            left -= weight;
        }
        normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Student's t density of 4 degrees of freedom, scaled to unit variance: (3 / 8) (1 + t² / 4)^(-5/2) sqrt 2 at t = sqrt 2 x.
    #[test]
    fn the_mixture_is_close_to_students_t() {
        let errors = Errors::student(4.0);
        for x in [0.0, 1.0, 2.0, 4.0, 6.0_f64] {
            let t = 2.0_f64.sqrt() * x;
            let student = 2.0_f64.sqrt() * 0.375 * (1.0 + t * t / 4.0).powf(-2.5);
            let wide = (-0.5 * x * x / 100.0).exp() / (10.0 * std::f64::consts::TAU.sqrt());
            let expected = 0.99 * student + 0.01 * wide;
            let (density, _, _) = errors.density(x, 0.0, 1.0);
            assert!(
                (density - expected.ln()).abs() < 0.25,
                "{x}: {} {expected}",
                density.exp()
            );
        }
    }

    #[test]
    fn a_density_of_normal_errors_is_the_normal_one() {
        let (density, mean, variation) = Errors::NORMAL.density(1.5, 0.5, 0.25);
        let expected = -0.5 * (1.5_f64.powi(2) / 0.75 + (std::f64::consts::TAU * 0.75).ln());
        assert!((density - expected).abs() < 1e-12);
        assert!((mean - 1.0 / 0.75).abs() < 1e-12 && (variation - mean).abs() < 1e-12);
    }
}
