//! Evidence of a set of candidates: how probable the deviations are under it, all its sizes integrated out.
//!
//! y ~ N(0, σ²(I + Σ_j v_j Q_j Q_jᵀ)): each block's coefficients are Gaussian with their own variance v_j (in units
//! of σ²), found by maximising the evidence (MacKay 1992) and paid for; σ² is integrated against 1/σ². Works on inner
//! products only, so its cost does not depend on the number of touches. No decision is taken here.

/// Price of having chosen a block's size: a log-uniform prior over four decades of it, known to about a factor e.
const SIZE_PRICE: f64 = 1.5;
/// Rounds of the fixed-point iteration for the sizes.
const ROUNDS: usize = 6;
/// One pseudo-observation of noise at the resolution of a good controller, m: keeps perfect fits finite.
const RESOLUTION: f64 = 2e-8;
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
}

impl Products {
    /// Products of the blocks over the rows with positive weight in `active`.
    pub fn new(blocks: &[&[Vec<f64>]], y: &[f64], active: &[bool]) -> Self {
        let mut spans = Vec::with_capacity(blocks.len());
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for block in blocks {
            spans.push((columns.len(), block.len()));
            columns.extend(block.iter().map(|column| pick(column, active)));
        }
        let y = pick(y, active);
        let count = columns.len();
        let mut qq = vec![0.0; count * count];
        for one in 0..count {
            for other in one..count {
                let product = dot(&columns[one], &columns[other]);
                qq[one * count + other] = product;
                qq[other * count + one] = product;
            }
        }
        let qy = columns.iter().map(|column| dot(column, &y)).collect();
        Self {
            rows: y.len() as f64,
            yy: dot(&y, &y),
            qy,
            qq,
            spans,
            offset: 0.0,
        }
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
            offset: self.offset,
        }
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

    fn solve(&self, set: &[usize], full: bool) -> Option<Fit> {
        let count = self.qy.len();
        let columns: Vec<usize> = set
            .iter()
            .flat_map(|&j| self.spans[j].0..self.spans[j].0 + self.spans[j].1)
            .collect();
        let n = columns.len();
        if n > MOST_COLUMNS {
            return None;
        }
        let owner: Vec<usize> = set
            .iter()
            .enumerate()
            .flat_map(|(place, &j)| std::iter::repeat_n(place, self.spans[j].1))
            .collect();
        let pseudo = RESOLUTION * RESOLUTION;
        let freedom = self.rows + 1.0;
        let mut sizes = vec![self.yy / pseudo.max(self.yy / self.rows); set.len()];
        let mut matrix = vec![0.0; n * n];
        let mut mean = vec![0.0; n];
        let mut inverse = vec![0.0; n * n];
        let (mut log_determinant, mut left) = (0.0, self.yy);
        let rounds = if n == 0 { 0 } else { ROUNDS };
        for round in 0..=rounds {
            for (i, &a) in columns.iter().enumerate() {
                for (k, &b) in columns.iter().enumerate().take(i + 1) {
                    matrix[i * n + k] = self.qq[a * count + b];
                }
                matrix[i * n + i] += 1.0 / sizes[owner[i]];
            }
            log_determinant = cholesky(&mut matrix, n)?;
            for (value, &a) in mean.iter_mut().zip(&columns) {
                *value = self.qy[a];
            }
            solve_cholesky(&matrix, n, &mut mean);
            left = self.yy
                - columns
                    .iter()
                    .zip(&mean)
                    .map(|(&a, m)| self.qy[a] * m)
                    .sum::<f64>();
            left = left.max(0.0);
            if round == rounds {
                break;
            }
            invert(&matrix, n, &mut inverse);
            let variance = (left + pseudo) / freedom;
            for (place, &j) in set.iter().enumerate() {
                let width = self.spans[j].1;
                let own = (0..n).filter(|&i| owner[i] == place);
                let power: f64 = own
                    .map(|i| mean[i] * mean[i] / variance + inverse[i * n + i])
                    .sum();
                sizes[place] = (power / width as f64).max(1.0);
            }
        }
        if full && n > 0 {
            invert(&matrix, n, &mut inverse);
        }
        let spread: f64 = owner.iter().map(|&place| sizes[place].ln()).sum();
        let log_evidence = ln_gamma(0.5 * freedom)
            - 0.5 * freedom * (std::f64::consts::PI * (left + pseudo)).ln()
            - 0.5 * (spread + log_determinant)
            - SIZE_PRICE * set.len() as f64
            - self.offset;
        Some(Fit {
            log_evidence,
            coefficients: mean,
            covariance: if full { inverse } else { Vec::new() },
            variance: (left + pseudo) / freedom,
        })
    }
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
    a.iter().zip(b).map(|(x, y)| x * y).sum()
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
    let mut log_determinant = 0.0;
    for i in 0..n {
        for j in 0..=i {
            let mut sum = matrix[i * n + j];
            for k in 0..j {
                sum -= matrix[i * n + k] * matrix[j * n + k];
            }
            if i == j {
                if !(sum > 0.0) {
                    return None;
                }
                log_determinant += sum.ln();
                matrix[i * n + i] = sum.sqrt();
            } else {
                matrix[i * n + j] = sum / matrix[j * n + j];
            }
        }
    }
    Some(log_determinant)
}

/// Solves in place with a Cholesky factor.
pub(crate) fn solve_cholesky(factor: &[f64], n: usize, right: &mut [f64]) {
    for i in 0..n {
        let mut sum = right[i];
        for k in 0..i {
            sum -= factor[i * n + k] * right[k];
        }
        right[i] = sum / factor[i * n + i];
    }
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
