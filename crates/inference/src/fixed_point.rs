//! Evidence maximisation: the prior variances of blocks of coefficients by fixed-point iteration.
//!
//! Model: y ~ N(0, σ²(I + Σ_j v_j Q_j Q_jᵀ)). At given prior variances v_j the coefficients have the posterior mean μ and
//! the covariance σ²Σ of a ridge; the evidence is stationary where v_j is the mean of μ²/σ² + Σ_ii over block j
//! (MacKay 1992, Bayesian interpolation, 4.2; Tipping 2001, sparse Bayesian learning, for a variance per coefficient).
//! The noise variance σ² = (yᵀy − bᵀμ + ε²)/(n + 1) is the mode under a prior 1/σ².

use std::ops::Range;

/// Standard deviation of one pseudo-observation of noise, the resolution of a good controller, m: keeps perfect fits finite.
pub const RESOLUTION: f64 = 2e-8;
/// Least prior variance of a block over that of the noise.
const MIN_VARIANCE: f64 = 1.0;

/// The normal equations of a set of columns, solved for one choice of prior precisions after another.
pub trait RidgeSystem {
    /// Solves with a prior precision (over that of the noise) for each coefficient; `None` where the matrix is not positive
    /// definite.
    fn solve(&mut self, precision: &[f64]) -> Option<()>;

    /// Posterior mean of the coefficients at the last precisions, in the unit of the data.
    fn mean(&self) -> &[f64];

    /// yᵀy − bᵀμ at the last precisions, not negative, in the unit of the data squared.
    fn residual(&self) -> f64;

    /// Diagonal of the posterior covariance over the noise variance at the last precisions.
    fn covariance_diagonal(&mut self) -> Vec<f64>;
}

/// The blocks of a set of columns and what is known of their coefficients.
#[derive(Debug, Clone)]
pub struct Blocks {
    /// Fixed prior precision of the leading coefficients, over that of the noise.
    pub fixed: Vec<f64>,
    /// Coefficients of each block: successive ranges behind the fixed ones.
    pub spans: Vec<Range<usize>>,
    /// Largest prior variance of each coefficient, in the unit of the data squared; infinite where there is none.
    pub caps: Vec<f64>,
}

impl Blocks {
    /// Prior variance over that of the noise of a coefficient whose block has this one.
    fn capped(&self, coefficient: usize, variance: f64, noise: f64) -> f64 {
        variance.min(self.caps[coefficient] / noise.max(RESOLUTION * RESOLUTION))
    }

    /// Prior variances of the coefficients of all blocks over that of the noise.
    pub fn prior_variances<'a>(&'a self, state: &'a State) -> impl Iterator<Item = f64> + 'a {
        (self.spans.iter().zip(&state.prior_variances)).flat_map(move |(span, &variance)| {
            span.clone()
                .map(move |coefficient| self.capped(coefficient, variance, state.noise_variance))
        })
    }

    fn precision(&self, state: &State) -> Vec<f64> {
        let blocks = self.prior_variances(state).map(|variance| 1.0 / variance);
        self.fixed.iter().copied().chain(blocks).collect()
    }
}

/// Where the iteration stands.
#[derive(Debug, Clone)]
pub struct State {
    /// Prior variance of each block over that of the noise.
    pub prior_variances: Vec<f64>,
    /// Noise variance, in the unit of the data squared.
    pub noise_variance: f64,
    /// Diagonal of the covariance over the noise variance before the last update; empty before the first.
    pub covariance_diagonal: Vec<f64>,
}

/// When the iteration ends.
#[derive(Debug, Clone, Copy)]
pub struct Stop {
    /// Updates at most.
    pub rounds: usize,
    /// All variances change by less than this share; 0: never for this reason.
    pub tolerance: f64,
}

/// Maximises the evidence of `samples` data from `state` on; the posterior stays solved at the variances of the result.
///
/// `None` where the posterior cannot be solved.
pub fn maximise(
    posterior: &mut impl RidgeSystem,
    blocks: &Blocks,
    mut state: State,
    samples: f64,
    stop: Stop,
) -> Option<State> {
    let mut converged = blocks.spans.is_empty();
    for round in 0..=stop.rounds {
        posterior.solve(&blocks.precision(&state))?;
        if round == stop.rounds || converged {
            break;
        }
        state.covariance_diagonal = posterior.covariance_diagonal();
        let change = |from: f64, to: f64| (to - from).abs() < stop.tolerance * to;
        let noise = noise_variance(posterior.residual(), samples);
        converged = change(state.noise_variance, noise);
        state.noise_variance = noise;
        let mean = posterior.mean();
        for (span, variance) in blocks.spans.iter().zip(&mut state.prior_variances) {
            let energy: f64 = (span.clone())
                .map(|i| mean[i] * mean[i] / noise + state.covariance_diagonal[i])
                .sum();
            let updated = (energy / span.len() as f64).max(MIN_VARIANCE);
            converged &= change(*variance, updated);
            *variance = updated;
        }
    }
    Some(state)
}

/// Most probable noise variance for a residual sum of squares of `samples` data, with the pseudo-observation.
pub fn noise_variance(residual: f64, samples: f64) -> f64 {
    (residual + RESOLUTION * RESOLUTION) / (samples + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Orthonormal columns: every coefficient is shrunk by v/(1 + v), whatever the others do.
    struct Orthonormal {
        projections: Vec<f64>,
        yy: f64,
        shrinkage: Vec<f64>,
        mean: Vec<f64>,
    }

    impl RidgeSystem for Orthonormal {
        fn solve(&mut self, precision: &[f64]) -> Option<()> {
            self.shrinkage = precision.iter().map(|p| 1.0 / (1.0 + p)).collect();
            self.mean = (self.shrinkage.iter().zip(&self.projections))
                .map(|(s, b)| s * b)
                .collect();
            Some(())
        }

        fn mean(&self) -> &[f64] {
            &self.mean
        }

        fn residual(&self) -> f64 {
            let explained: f64 = (self.mean.iter().zip(&self.projections))
                .map(|(m, b)| m * b)
                .sum();
            self.yy - explained
        }

        fn covariance_diagonal(&mut self) -> Vec<f64> {
            self.shrinkage.clone()
        }
    }

    /// At the fixed point of one orthonormal column, v = μ²/σ² + v/(1 + v) with μ = b·v/(1 + v): v = b²/σ² − 1.
    #[test]
    fn the_fixed_point_of_an_orthonormal_column_is_known_in_closed_form() {
        let mut posterior = Orthonormal {
            projections: vec![3.0e-4],
            yy: 9.0e-8 + 4.0e-9,
            shrinkage: Vec::new(),
            mean: Vec::new(),
        };
        let blocks = Blocks {
            fixed: Vec::new(),
            spans: std::iter::once(0..1).collect(),
            caps: vec![f64::INFINITY],
        };
        let start = State {
            prior_variances: vec![100.0],
            noise_variance: 1e-9,
            covariance_diagonal: Vec::new(),
        };
        let stop = Stop {
            rounds: 200,
            tolerance: 1e-14,
        };
        let state = maximise(&mut posterior, &blocks, start, 40.0, stop).expect("solvable");
        let expected = 9.0e-8 / state.noise_variance - 1.0;
        let variance = state.prior_variances[0];
        assert!(
            (variance / expected - 1.0).abs() < 1e-9,
            "{variance} for {expected}"
        );
        assert!(
            (state.noise_variance / noise_variance(posterior.residual(), 40.0) - 1.0).abs() < 1e-9
        );
    }

    /// A cap bounds the prior variance in the unit of the data, not over the noise.
    #[test]
    fn a_cap_bounds_the_prior_variance() {
        let blocks = Blocks {
            fixed: vec![1e-9],
            spans: std::iter::once(1..2).collect(),
            caps: vec![f64::INFINITY, 4e-12],
        };
        let state = State {
            prior_variances: vec![1e6],
            noise_variance: 1e-12,
            covariance_diagonal: Vec::new(),
        };
        let variances: Vec<f64> = blocks.prior_variances(&state).collect();
        assert_eq!(variances, [4e-12 / 1e-12]);
        assert_eq!(blocks.precision(&state).len(), 2);
    }
}
