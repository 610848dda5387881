//! Evidence of a set of candidates: how probable the deviations are under it, all its sizes integrated out.
//!
//! y ~ N(0, σ²(I + Σ_j v_j Q_j Q_jᵀ)): each block's coefficients are Gaussian with their own variance v_j (in units
//! of σ²), found by maximising the evidence (MacKay 1992) and paid for; σ² is integrated against 1/σ². Works on inner
//! products only, so its cost does not depend on the number of touches. No decision is taken here.

use statrs::function::erf::erfc;

use crate::columns::{Columns, Rows};

/// Price of having chosen a block's size: a log-uniform prior over four decades of it, known to about a factor e.
pub(crate) const SIZE_PRICE: f64 = 1.5;
/// Rounds of the fixed-point iteration for the sizes.
const ROUNDS: usize = 6;
/// One pseudo-observation of noise at the resolution of a good controller, m: keeps perfect fits finite.
pub(crate) const RESOLUTION: f64 = 2e-8;
/// Sizes that change by less than this share have settled.
const SETTLED: f64 = 0.03;
/// Largest set of columns that is solved.
pub(crate) const MOST_COLUMNS: usize = 96;

/// Inner products of all candidate columns with one another and with the deviations.
#[derive(Debug, Clone)]
pub struct Products {
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
    /// Half the log-determinant of what the rows were whitened with, and the price of choosing it.
    pub offset: f64,
}

/// What a set of candidates says.
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
    pub sizes: Vec<f64>,
}

/// What a set is worth, and at which sizes.
#[derive(Debug, Clone)]
pub(crate) struct Sized {
    /// Log evidence.
    pub(crate) log_evidence: f64,
    /// Variance of each block's coefficients over that of the noise.
    pub(crate) sizes: Vec<f64>,
    /// Noise variance, m².
    pub(crate) variance: f64,
}

impl Products {
    /// Products of the blocks over the rows with positive weight in `active`.
    pub fn new(blocks: &[&[Vec<f64>]], y: &[f64], active: &[bool]) -> Self {
        Self::correlated(blocks, y, active, 0, 0.0)
    }

    /// The same where the noise of the first `touches` rows remembers a share `correlation` of the row before.
    pub fn correlated(
        blocks: &[&[Vec<f64>]],
        y: &[f64],
        active: &[bool],
        touches: usize,
        correlation: f64,
    ) -> Self {
        let rows = Rows {
            active: active.to_vec(),
            touches,
            correlation,
        };
        Columns::new(rows, blocks.iter().copied()).products(std::iter::empty(), y)
    }

    /// Products over the rows of all parts together: the same blocks over rows that no two parts share.
    pub(crate) fn together<'p>(mut parts: impl Iterator<Item = &'p Self>) -> Option<Self> {
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

    /// The same where no coefficient is larger than plausible: `plausible` holds its standard deviation per column, m.
    #[must_use]
    pub fn capped<'a>(mut self, plausible: impl Iterator<Item = &'a f64>) -> Self {
        for (cap, size) in self.caps.iter_mut().zip(plausible) {
            *cap = size * size;
        }
        self
    }

    /// The same with the last column of each of these candidates a square.
    #[must_use]
    pub fn squared(mut self, candidates: impl Iterator<Item = usize>) -> Self {
        for candidate in candidates {
            let (first, width) = self.spans[candidate];
            self.squares[first + width - 1] = true;
        }
        self
    }

    /// The products of some candidates only, in the given order.
    pub fn part(&self, members: &[usize]) -> Self {
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

    /// Products of each column with itself.
    pub(crate) fn powers(&self) -> Vec<f64> {
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

    /// Log evidence of the candidates in `set`, with the sizes at which it is largest.
    pub(crate) fn sized(&self, set: &[usize]) -> Sized {
        let unsolved = || Sized {
            log_evidence: f64::NEG_INFINITY,
            sizes: vec![1.0; set.len()],
            variance: self.yy / self.rows,
        };
        self.solve(set, false).map_or_else(unsolved, |fit| Sized {
            log_evidence: fit.log_evidence,
            sizes: fit.sizes,
            variance: fit.variance,
        })
    }

    fn solve(&self, set: &[usize], full: bool) -> Option<Fit> {
        let count = self.qy.len();
        let mut columns: Vec<usize> = Vec::with_capacity(2 * set.len());
        let mut owner: Vec<usize> = Vec::with_capacity(2 * set.len());
        for (place, &j) in set.iter().enumerate() {
            let (first, width) = self.spans[j];
            columns.extend(first..first + width);
            owner.extend(std::iter::repeat_n(place, width));
        }
        let n = columns.len();
        if n > MOST_COLUMNS {
            return None;
        }
        let mut gram = Vec::with_capacity(n * n);
        for &a in &columns {
            gram.extend(columns.iter().map(|&b| self.qq[a * count + b]));
        }
        let right: Vec<f64> = columns.iter().map(|&a| self.qy[a]).collect();
        let caps: Vec<f64> = columns.iter().map(|&a| self.caps[a]).collect();
        let pseudo = RESOLUTION * RESOLUTION;
        let freedom = self.rows + 1.0;
        let mut variance = self.yy / self.rows;
        let within = |size: f64, cap: f64, variance: f64| size.min(cap / variance.max(pseudo));
        let mut sizes = vec![self.yy / pseudo.max(self.yy / self.rows); set.len()];
        let mut matrix = gram.clone();
        let mut mean = right.clone();
        let mut inverse = vec![0.0; n * n];
        let (mut log_determinant, mut left) = (0.0, self.yy);
        let mut spreads = Vec::new();
        let rounds = if n == 0 { 0 } else { ROUNDS };
        let mut settled = false;
        for round in 0..=rounds {
            matrix.copy_from_slice(&gram);
            for (i, &place) in owner.iter().enumerate() {
                matrix[i * n + i] += 1.0 / within(sizes[place], caps[i], variance);
            }
            log_determinant = cholesky(&mut matrix, n)?;
            mean.copy_from_slice(&right);
            solve_cholesky(&matrix, n, &mut mean);
            left = (self.yy - right.iter().zip(&mean).map(|(q, m)| q * m).sum::<f64>()).max(0.0);
            if round == rounds || settled {
                break;
            }
            spreads = inverse_diagonal(&matrix, n, &mut inverse);
            let known = variance;
            variance = (left + pseudo) / freedom;
            settled = (variance - known).abs() < SETTLED * variance;
            for (place, &j) in set.iter().enumerate() {
                let width = self.spans[j].1;
                let own = (0..n).filter(|&i| owner[i] == place);
                let power: f64 = own.map(|i| mean[i] * mean[i] / variance + spreads[i]).sum();
                let size = (power / width as f64).max(1.0);
                settled &= (size - sizes[place]).abs() < SETTLED * size;
                sizes[place] = size;
            }
        }
        if full && n > 0 {
            invert(&matrix, n, &mut inverse);
        }
        let widths = owner.iter().zip(&caps);
        let spread: f64 = widths
            .map(|(&place, &cap)| within(sizes[place], cap, variance).ln())
            .sum();
        let log_evidence = ln_gamma(0.5 * freedom)
            - 0.5 * freedom * (std::f64::consts::PI * (left + pseudo)).ln()
            - 0.5 * (spread + log_determinant)
            - SIZE_PRICE * set.len() as f64
            - self.offset
            + self.of_squares(&columns, &mean, &spreads, variance);
        Some(Fit {
            log_evidence,
            coefficients: mean,
            covariance: if full { inverse } else { Vec::new() },
            variance: (left + pseudo) / freedom,
            sizes,
        })
    }

    /// What it is worth (natural log) that the prior of a square has no negative half.
    fn of_squares(&self, columns: &[usize], mean: &[f64], spreads: &[f64], variance: f64) -> f64 {
        let squares = (columns.iter().zip(mean).zip(spreads))
            .filter(|((column, _), _)| self.squares[**column]);
        squares
            .map(|((_, mean), spread)| {
                let away = mean / (2.0 * spread * variance).sqrt();
                // Twice the normal's share above zero; far below, what the share tends to.
                let positive = erfc(-away);
                if positive > 1e-300 {
                    positive.ln()
                } else {
                    -away * away
                }
            })
            .sum()
    }

    /// Log evidence of a set whose blocks have these sizes, their price included: a quick look, nothing is optimised.
    pub(crate) fn log_evidence_at(&self, set: &[usize], sizes: &[f64]) -> f64 {
        let count = self.qy.len();
        let mut columns: Vec<(usize, f64)> = Vec::with_capacity(2 * set.len());
        for (&j, &size) in set.iter().zip(sizes) {
            let (first, width) = self.spans[j];
            columns.extend((first..first + width).map(|column| (column, size)));
        }
        let n = columns.len();
        let mut matrix = vec![0.0; n * n];
        for (i, &(a, size)) in columns.iter().enumerate() {
            for (k, &(b, _)) in columns.iter().enumerate().take(i + 1) {
                matrix[i * n + k] = self.qq[a * count + b];
            }
            matrix[i * n + i] += 1.0 / size;
        }
        let Some(log_determinant) = cholesky(&mut matrix, n) else {
            return f64::NEG_INFINITY;
        };
        let mut seen: Vec<f64> = columns.iter().map(|&(a, _)| self.qy[a]).collect();
        forward(&matrix, n, &mut seen);
        let left = (self.yy - dot(&seen, &seen)).max(0.0) + RESOLUTION * RESOLUTION;
        let freedom = self.rows + 1.0;
        let spread: f64 = columns.iter().map(|(_, size)| size.ln()).sum();
        ln_gamma(0.5 * freedom)
            - 0.5 * freedom * (std::f64::consts::PI * left).ln()
            - 0.5 * (spread + log_determinant)
            - SIZE_PRICE * set.len() as f64
            - self.offset
    }
}

/// Diagonal of the inverse from a Cholesky factor; `scratch` holds at least n² values.
pub(crate) fn inverse_diagonal(factor: &[f64], n: usize, scratch: &mut [f64]) -> Vec<f64> {
    // Column by column the inverse of the factor; the inverse's diagonal is the sum of its squares.
    let mut diagonal = vec![0.0; n];
    for column in 0..n {
        for row in column..n {
            let sum = less(
                if row == column { 1.0 } else { 0.0 },
                &factor[row * n + column..row * n + row],
                &scratch[column * n + column..column * n + row],
            );
            let value = sum / factor[row * n + row];
            scratch[column * n + row] = value;
            diagonal[column] += value * value;
        }
    }
    diagonal
}

/// The rows in use; with a correlation, each touch less what the touch before foretells of its noise.
///
/// For noise that remembers a share `correlation` of the touch before (AR(1), touches in the order of time), this makes
/// it white with the same variance.
pub(crate) fn whitened(
    values: &[f64],
    active: &[bool],
    touches: usize,
    correlation: f64,
) -> Vec<f64> {
    let mut picked = pick(values, active);
    if correlation != 0.0 {
        let touched = active.iter().take(touches).filter(|&&used| used).count();
        let fresh = 1.0 / (1.0 - correlation * correlation).sqrt();
        for index in (1..touched).rev() {
            picked[index] = (picked[index] - correlation * picked[index - 1]) * fresh;
        }
    }
    picked
}

fn pick(values: &[f64], active: &[bool]) -> Vec<f64> {
    values
        .iter()
        .zip(active)
        .filter(|&(_, &used)| used)
        .map(|(&value, _)| value)
        .collect()
}

/// Inner product.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums side by side, since one alone waits for each addition.
    let mut sums = [0.0; 8];
    let (one, other) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = (one.remainder().iter().zip(other.remainder()))
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in one.zip(other) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    rest + sums.iter().sum::<f64>()
}

/// Adds `factor` times `column` to `values`.
pub(crate) fn add_scaled(values: &mut [f64], factor: f64, column: &[f64]) {
    for (value, part) in values.iter_mut().zip(column) {
        *value += factor * part;
    }
}

/// Multiplies `values` by `factor`.
pub(crate) fn scale(values: &mut [f64], factor: f64) {
    for value in values {
        *value *= factor;
    }
}

/// Cholesky factor in the lower triangle of a row-major matrix; gives its log-determinant.
pub(crate) fn cholesky(matrix: &mut [f64], n: usize) -> Option<f64> {
    // One logarithm for many pivots, as long as their product keeps its precision.
    let (mut log_determinant, mut pivots) = (0.0, 1.0_f64);
    for i in 0..n {
        let (above, row) = matrix.split_at_mut(i * n);
        let row = &mut row[..=i];
        for j in 0..i {
            let known = &above[j * n..=j * n + j];
            let sum = less(row[j], &row[..j], &known[..j]);
            row[j] = sum / known[j];
        }
        let sum = less(row[i], &row[..i], &row[..i]);
        if !(sum > 0.0) {
            return None;
        }
        pivots *= sum;
        if !(1e-150..1e150).contains(&pivots) {
            log_determinant += pivots.ln();
            pivots = 1.0;
        }
        row[i] = sum.sqrt();
    }
    Some(log_determinant + pivots.ln())
}

/// A value less the products of two rows, in their order.
fn less(value: f64, one: &[f64], other: &[f64]) -> f64 {
    one.iter()
        .zip(other)
        .fold(value, |left, (a, b)| left - a * b)
}

/// Solves in place with the lower triangle only.
pub(crate) fn forward(factor: &[f64], n: usize, right: &mut [f64]) {
    for i in 0..n {
        let row = &factor[i * n..=i * n + i];
        let sum = less(right[i], &row[..i], &right[..i]);
        right[i] = sum / row[i];
    }
}

/// Solves in place with a Cholesky factor.
pub(crate) fn solve_cholesky(factor: &[f64], n: usize, right: &mut [f64]) {
    forward(factor, n, right);
    for i in (0..n).rev() {
        let mut sum = right[i];
        for k in i + 1..n {
            sum -= factor[k * n + i] * right[k];
        }
        right[i] = sum / factor[i * n + i];
    }
}

/// Inverse from a Cholesky factor.
pub(crate) fn invert(factor: &[f64], n: usize, inverse: &mut [f64]) {
    let mut unit = vec![0.0; n];
    for column in 0..n {
        unit.fill(0.0);
        unit[column] = 1.0;
        solve_cholesky(factor, n, &mut unit);
        for row in 0..n {
            inverse[row * n + column] = unit[row];
        }
    }
}

/// Logarithm of the gamma function for positive arguments (Stirling's series after a shift).
pub(crate) fn ln_gamma(x: f64) -> f64 {
    let mut shift = 0.0;
    let mut x = x;
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let square = x * x;
    let series =
        1.0 / (12.0 * x) - 1.0 / (360.0 * x * square) + 1.0 / (1260.0 * x * square * square);
    shift + (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series
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
            let products = Products::new(&[&block], &deviations(sign), &[true; 16]);
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
