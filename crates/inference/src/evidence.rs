//! Evidence of a set of candidates: the marginal likelihood of the deviations, all coefficients integrated out.
//!
//! y ~ N(0, σ²(I + Σ_j v_j Q_j Q_jᵀ)): spike-and-slab selection of grouped columns (George and McCulloch 1993) in which the
//! prior variance v_j of each block (over σ²) maximises the evidence ([`crate::fixed_point`]) and is paid for by
//! [`LOG_OCCAM_FACTOR`]; σ² is integrated against 1/σ². Works on inner products only, so its cost does not depend on the number of
//! touches. No decision is taken here.

use statrs::function::erf::erfc;
use statrs::function::gamma::ln_gamma;

use crate::fixed_point::{Blocks, RESOLUTION, RidgeSystem, State, Stop, maximise};
use crate::linear::{add_scaled, cholesky, dot, forward, inverse_diagonal, invert, solve_cholesky};

/// Log Occam factor of a block's prior variance: a log-uniform prior over four decades of it, known to about a factor e.
pub const LOG_OCCAM_FACTOR: f64 = 1.5;
/// When the iteration for the prior variances of a set ends.
const STOP: Stop = Stop {
    rounds: 6,
    tolerance: 0.03,
};
/// Largest set of columns that is solved.
pub const MAX_COLUMNS: usize = 96;

/// Natural logarithm of a sum of exponentials; −∞ for none.
pub fn log_sum(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = values.clone().fold(f64::NEG_INFINITY, f64::max);
    if most.is_infinite() {
        return most;
    }
    most + values.map(|value| (value - most).exp()).sum::<f64>().ln()
}

/// Inner products of all candidate columns with one another and with the deviations.
#[derive(Debug, Clone)]
pub struct InnerProducts {
    /// Number of active rows.
    pub rows: f64,
    /// yᵀy.
    pub yy: f64,
    /// Qᵀy.
    pub qy: Vec<f64>,
    /// QᵀQ, row-major.
    pub qq: Vec<f64>,
    /// First column and number of columns of each candidate.
    pub spans: Vec<(usize, usize)>,
    /// Largest variance of each column's coefficient that is plausible, m².
    pub caps: Vec<f64>,
    /// Columns whose coefficient is a square and so not negative.
    pub squares: Vec<bool>,
    /// Half the log-determinant of the whitening of the rows, and the log price of choosing it.
    pub offset: f64,
}

/// Posterior of the coefficients of a set of candidates.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Natural logarithm of the evidence, without the set's prior.
    pub log_evidence: f64,
    /// Posterior mean of the coefficients of the set's columns, m.
    pub coefficients: Vec<f64>,
    /// Posterior covariance over σ², row-major.
    pub covariance: Vec<f64>,
    /// Noise variance, m².
    pub variance: f64,
    /// Variance of each block's coefficients over that of the noise.
    pub prior_variances: Vec<f64>,
}

/// Log evidence of a set and the variances at which it is largest.
#[derive(Debug, Clone)]
pub struct Variances {
    /// Log evidence.
    pub log_evidence: f64,
    /// Variance of each block's coefficients over that of the noise.
    pub prior_variances: Vec<f64>,
    /// Noise variance, m².
    pub variance: f64,
}

impl InnerProducts {
    /// Inner products over the rows of all parts: the same blocks over disjoint rows; `None` of no parts.
    pub fn combined<'p>(mut parts: impl Iterator<Item = &'p Self>) -> Option<Self> {
        let mut sum = parts.next()?.clone();
        for part in parts {
            sum.rows += part.rows;
            sum.yy += part.yy;
            sum.offset += part.offset;
            add_scaled(&mut sum.qy, 1.0, &part.qy);
            add_scaled(&mut sum.qq, 1.0, &part.qq);
        }
        Some(sum)
    }

    /// Bounds the prior variances: `plausible` holds the largest plausible size of each column's coefficient, m.
    #[must_use]
    pub fn capped<'a>(mut self, plausible: impl Iterator<Item = &'a f64>) -> Self {
        for (cap, size) in self.caps.iter_mut().zip(plausible) {
            *cap = size * size;
        }
        self
    }

    /// Marks the last column of each of these candidates as a square.
    #[must_use]
    pub fn squared(mut self, candidates: impl Iterator<Item = usize>) -> Self {
        for candidate in candidates {
            let (first, width) = self.spans[candidate];
            self.squares[first + width - 1] = true;
        }
        self
    }

    /// Inner products of some candidates only, in the given order.
    pub fn subset(&self, members: &[usize]) -> Self {
        let count = self.qy.len();
        let mut spans = Vec::with_capacity(members.len());
        let mut columns = Vec::new();
        for &member in members {
            let (first, width) = self.spans[member];
            spans.push((columns.len(), width));
            columns.extend(first..first + width);
        }
        let qq = columns
            .iter()
            .flat_map(|&a| columns.iter().map(move |&b| self.qq[a * count + b]));
        Self {
            rows: self.rows,
            yy: self.yy,
            qy: columns.iter().map(|&column| self.qy[column]).collect(),
            qq: qq.collect(),
            spans,
            caps: columns.iter().map(|&column| self.caps[column]).collect(),
            squares: columns.iter().map(|&column| self.squares[column]).collect(),
            offset: self.offset,
        }
    }

    /// Inner products of each column with itself.
    pub fn squared_norms(&self) -> Vec<f64> {
        let count = self.qy.len();
        (0..count)
            .map(|column| self.qq[column * count + column])
            .collect()
    }

    /// Evidence and fit of the candidates in `set`; `None` for more columns than can be solved.
    pub fn fit(&self, set: &[usize]) -> Option<Fit> {
        self.solve(set, true)
    }

    /// Log evidence of the candidates in `set`.
    pub fn log_evidence(&self, set: &[usize]) -> f64 {
        self.solve(set, false)
            .map_or(f64::NEG_INFINITY, |fit| fit.log_evidence)
    }

    /// Log evidence of the candidates in `set`, with the prior variances at which it is largest.
    pub fn variances(&self, set: &[usize]) -> Variances {
        let unsolved = || Variances {
            log_evidence: f64::NEG_INFINITY,
            prior_variances: vec![1.0; set.len()],
            variance: self.yy / self.rows,
        };
        self.solve(set, false)
            .map_or_else(unsolved, |fit| Variances {
                log_evidence: fit.log_evidence,
                prior_variances: fit.prior_variances,
                variance: fit.variance,
            })
    }

    fn solve(&self, set: &[usize], full: bool) -> Option<Fit> {
        let (columns, blocks) = self.blocks(set);
        if columns.len() > MAX_COLUMNS {
            return None;
        }
        let mut posterior = SmallPosterior::new(self, &columns);
        let noise_variance = self.yy / self.rows;
        let start = State {
            prior_variances: vec![self.yy / noise_variance.max(RESOLUTION * RESOLUTION); set.len()],
            noise_variance,
            covariance_diagonal: Vec::new(),
        };
        let state = maximise(&mut posterior, &blocks, start, self.rows, STOP)?;
        let log_priors: f64 = blocks.prior_variances(&state).map(f64::ln).sum();
        let freedom = self.rows + 1.0;
        let residual = posterior.residual() + RESOLUTION * RESOLUTION;
        let log_evidence = ln_gamma(0.5 * freedom)
            - 0.5 * freedom * (std::f64::consts::PI * residual).ln()
            - 0.5 * (log_priors + posterior.log_determinant)
            - LOG_OCCAM_FACTOR * set.len() as f64
            - self.offset
            + self.log_share_of_squares(&columns, posterior.mean(), &state);
        Some(Fit {
            log_evidence,
            covariance: if full {
                posterior.covariance()
            } else {
                Vec::new()
            },
            coefficients: posterior.mean,
            variance: residual / freedom,
            prior_variances: state.prior_variances,
        })
    }

    /// Columns of a set in its order, and its blocks among them.
    fn blocks(&self, set: &[usize]) -> (Vec<usize>, Blocks) {
        let mut columns: Vec<usize> = Vec::with_capacity(2 * set.len());
        let mut spans = Vec::with_capacity(set.len());
        for &member in set {
            let (first, width) = self.spans[member];
            spans.push(columns.len()..columns.len() + width);
            columns.extend(first..first + width);
        }
        let blocks = Blocks {
            fixed: Vec::new(),
            spans,
            caps: columns.iter().map(|&column| self.caps[column]).collect(),
        };
        (columns, blocks)
    }

    /// Log evidence gained because the prior of a square has no negative half.
    fn log_share_of_squares(&self, columns: &[usize], mean: &[f64], state: &State) -> f64 {
        let squares = (columns.iter().zip(mean).zip(&state.covariance_diagonal))
            .filter(|((column, _), _)| self.squares[**column]);
        squares
            .map(|((_, mean), spread)| {
                let standardised = mean / (2.0 * spread * state.noise_variance).sqrt();
                // Twice the normal probability above zero; far below, its asymptote.
                let positive = erfc(-standardised);
                if positive > 1e-300 {
                    positive.ln()
                } else {
                    -standardised * standardised
                }
            })
            .sum()
    }

    /// Log evidence of a set at these variances of the coefficients of its blocks, m², their price included.
    ///
    /// `variance` is that of the noise beside which they were found, m²; here it is what they leave. Nothing else is optimised.
    pub fn log_evidence_at_sizes(&self, set: &[usize], sizes: &[f64], variance: f64) -> f64 {
        let mut columns: Vec<(usize, f64)> = Vec::with_capacity(2 * set.len());
        for (&j, &size) in set.iter().zip(sizes) {
            let (first, width) = self.spans[j];
            columns.extend((first..first + width).map(|column| (column, size)));
        }
        let (_, left) = self.evidence_and_variance(&columns, set.len(), variance);
        self.evidence_and_variance(&columns, set.len(), left).0
    }

    /// Log evidence of `blocks` blocks of columns, each with its size (m²), over noise of a variance; and the variance left.
    fn evidence_and_variance(
        &self,
        columns: &[(usize, f64)],
        blocks: usize,
        variance: f64,
    ) -> (f64, f64) {
        let count = self.qy.len();
        let over = |size: f64| (size / variance).max(1.0);
        let n = columns.len();
        let mut matrix = vec![0.0; n * n];
        for (i, &(a, size)) in columns.iter().enumerate() {
            for (k, &(b, _)) in columns.iter().enumerate().take(i + 1) {
                matrix[i * n + k] = self.qq[a * count + b];
            }
            matrix[i * n + i] += 1.0 / over(size);
        }
        let Some(log_determinant) = cholesky(&mut matrix, n) else {
            return (f64::NEG_INFINITY, variance);
        };
        let mut projected: Vec<f64> = columns.iter().map(|&(a, _)| self.qy[a]).collect();
        forward(&matrix, n, &mut projected);
        let residual = (self.yy - dot(&projected, &projected)).max(0.0) + RESOLUTION * RESOLUTION;
        let freedom = self.rows + 1.0;
        let spread: f64 = columns.iter().map(|&(_, size)| over(size).ln()).sum();
        let log_evidence = ln_gamma(0.5 * freedom)
            - 0.5 * freedom * (std::f64::consts::PI * residual).ln()
            - 0.5 * (spread + log_determinant)
            - LOG_OCCAM_FACTOR * blocks as f64
            - self.offset;
        (log_evidence, residual / freedom)
    }
}

/// The posterior of a small set, on row-major slices: faster than a matrix library below some hundred columns.
struct SmallPosterior {
    yy: f64,
    gram: Vec<f64>,
    projections: Vec<f64>,
    /// Cholesky factor of the Gram matrix plus the prior precisions, in its lower triangle.
    factor: Vec<f64>,
    log_determinant: f64,
    mean: Vec<f64>,
    scratch: Vec<f64>,
}

impl SmallPosterior {
    fn new(products: &InnerProducts, columns: &[usize]) -> Self {
        let (n, count) = (columns.len(), products.qy.len());
        let mut gram = Vec::with_capacity(n * n);
        for &a in columns {
            gram.extend(columns.iter().map(|&b| products.qq[a * count + b]));
        }
        let projections: Vec<f64> = columns.iter().map(|&a| products.qy[a]).collect();
        Self {
            yy: products.yy,
            factor: gram.clone(),
            gram,
            log_determinant: 0.0,
            mean: projections.clone(),
            projections,
            scratch: vec![0.0; n * n],
        }
    }

    /// Posterior covariance over the noise variance, row-major.
    fn covariance(&mut self) -> Vec<f64> {
        invert(&self.factor, self.mean.len(), &mut self.scratch);
        self.scratch.clone()
    }
}

impl RidgeSystem for SmallPosterior {
    fn solve(&mut self, precision: &[f64]) -> Option<()> {
        let n = self.mean.len();
        self.factor.copy_from_slice(&self.gram);
        for (i, precision) in precision.iter().enumerate() {
            self.factor[i * n + i] += precision;
        }
        self.log_determinant = cholesky(&mut self.factor, n)?;
        self.mean.copy_from_slice(&self.projections);
        solve_cholesky(&self.factor, n, &mut self.mean);
        Some(())
    }

    fn mean(&self) -> &[f64] {
        &self.mean
    }

    fn residual(&self) -> f64 {
        let explained = self.projections.iter().zip(&self.mean);
        (self.yy - explained.map(|(q, m)| q * m).sum::<f64>()).max(0.0)
    }

    fn covariance_diagonal(&mut self) -> Vec<f64> {
        inverse_diagonal(&self.factor, self.mean.len(), &mut self.scratch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square that would have to be negative explains less than one that is positive, by the half of its prior that it
    /// lacks; far from zero on the right side it is worth ln 2 more than a coefficient of either sign.
    #[test]
    fn a_square_is_not_negative() {
        let block = vec![vec![1.0 / 4.0; 16]];
        let noise = |row: usize| 1e-6 * ((row * 7 % 5) as f64 - 2.0);
        let deviations =
            |sign: f64| -> Vec<f64> { (0..16).map(|row| sign * 2e-5 + noise(row)).collect() };
        let evidence = |sign: f64, square: bool| {
            let products = InnerProducts::new(&[&block], &deviations(sign), &[true; 16]);
            let products = if square {
                products.squared(std::iter::once(0))
            } else {
                products
            };
            products.log_evidence(&[0])
        };
        let gained = evidence(1.0, true) - evidence(1.0, false);
        assert!((gained - std::f64::consts::LN_2).abs() < 1e-9, "{gained}");
        assert!(evidence(-1.0, true) < evidence(-1.0, false) - 20.0);
    }
}
