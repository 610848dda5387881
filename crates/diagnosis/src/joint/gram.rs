//! Evidence of sets of many columns: each block's coefficients are Gaussian with one size of their own.
//!
//! y ~ N(0, σ²(I + Σ_j v_j Q_j Q_jᵀ)), sizes by MacKay's fixed point, σ² integrated against 1/σ², as in `evidence`; but
//! for hundreds of columns, and with a part (each session's pose) whose size is unbounded. Works on inner products.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::pool::Block;
use crate::evidence::dot;

/// Precision of the unbounded part, in units of the noise over one column's length.
const FREE: f64 = 1e-9;
/// Sizes of a new block that are compared, decades of the noise.
const DECADES: std::ops::Range<i32> = 0..9;
/// One pseudo-observation of noise at the resolution of a good controller, m.
const RESOLUTION: f64 = 2e-8;

/// Inner products over the rows in use.
pub(super) struct Gram {
    rows: f64,
    yy: f64,
    qy: DVector<f64>,
    qq: DMatrix<f64>,
    free: usize,
    spans: Vec<(usize, usize)>,
}

/// A set of blocks with their sizes.
#[derive(Debug, Clone, Default)]
pub(super) struct Set {
    pub(super) members: Vec<usize>,
    pub(super) sizes: Vec<f64>,
}

/// A set solved.
pub(super) struct Solved {
    pub(super) columns: Vec<usize>,
    factor: Cholesky<f64, Dyn>,
    pub(super) mean: DVector<f64>,
    half: DVector<f64>,
    left: f64,
    /// Natural logarithm of the evidence, up to a constant of the rows.
    pub(super) log_evidence: f64,
}

impl Solved {
    /// Noise variance, m².
    pub(super) fn variance(&self, rows: f64) -> f64 {
        self.left / (rows + 1.0)
    }

    /// Diagonal of the covariance over the noise variance: squared lengths of the columns of L⁻¹.
    fn diagonal(&self) -> Vec<f64> {
        let lower = self.factor.l_dirty();
        let n = lower.nrows();
        let mut unit = vec![0.0; n];
        (0..n)
            .map(|first| {
                unit[first..].fill(0.0);
                unit[first] = 1.0;
                let mut sum = 0.0;
                for k in first..n {
                    let column = lower.column(k);
                    let own = unit[k] / column[k];
                    sum += own * own;
                    for (value, part) in unit[k + 1..].iter_mut().zip(&column.as_slice()[k + 1..]) {
                        *value -= own * part;
                    }
                }
                sum
            })
            .collect()
    }

    /// Covariance of the coefficients over the noise variance.
    pub(super) fn covariance(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }
}

impl Gram {
    /// Products of the free columns, then the blocks', over the rows with a true in `active`.
    pub(super) fn new(free: &[Vec<f64>], blocks: &[Block], y: &[f64], active: &[bool]) -> Self {
        let columns: Vec<&Vec<f64>> = free
            .iter()
            .chain(blocks.iter().flat_map(|block| &block.columns))
            .collect();
        let matrix = picked(&columns, active);
        let y = DVector::from_vec(pick(y, active));
        let mut spans = Vec::new();
        let mut next = free.len();
        for block in blocks {
            spans.push((next, block.columns.len()));
            next += block.columns.len();
        }
        Self {
            rows: y.len() as f64,
            yy: y.norm_squared(),
            qy: matrix.tr_mul(&y),
            qq: matrix.tr_mul(&matrix),
            free: free.len(),
            spans,
        }
    }

    /// Adds blocks that came later; `free` and `blocks` are all there are by now.
    pub(super) fn extend(
        &mut self,
        free: &[Vec<f64>],
        blocks: &[Block],
        y: &[f64],
        active: &[bool],
    ) {
        let known = self.qy.len();
        let all: Vec<&Vec<f64>> = free
            .iter()
            .chain(blocks.iter().flat_map(|block| &block.columns))
            .collect();
        if all.len() == known {
            return;
        }
        for block in &blocks[self.spans.len()..] {
            let next = self.spans.last().map_or(self.free, |(f, w)| f + w);
            self.spans.push((next, block.columns.len()));
        }
        let (old, new) = (picked(&all[..known], active), picked(&all[known..], active));
        let y = pick(y, active);
        let cross = old.tr_mul(&new);
        let own = new.tr_mul(&new);
        let count = all.len();
        let before = std::mem::replace(&mut self.qq, DMatrix::zeros(0, 0));
        self.qq = before.resize(count, count, 0.0);
        self.qq
            .view_mut((0, known), (known, count - known))
            .copy_from(&cross);
        self.qq
            .view_mut((known, 0), (count - known, known))
            .copy_from(&cross.transpose());
        self.qq
            .view_mut((known, known), (count - known, count - known))
            .copy_from(&own);
        let added = new.tr_mul(&DVector::from_vec(y));
        self.qy = DVector::from_iterator(count, self.qy.iter().chain(added.iter()).copied());
    }

    /// Number of rows in use.
    pub(super) fn rows(&self) -> f64 {
        self.rows
    }

    /// Columns of a set: the free ones first.
    pub(super) fn columns(&self, set: &Set) -> (Vec<usize>, Vec<f64>) {
        let mut columns: Vec<usize> = (0..self.free).collect();
        let mut precision = vec![FREE; self.free];
        for (&member, size) in set.members.iter().zip(&set.sizes) {
            let (first, width) = self.spans[member];
            columns.extend(first..first + width);
            precision.extend(std::iter::repeat_n(1.0 / size, width));
        }
        (columns, precision)
    }

    /// Solves a set; `None` where it is not positive definite.
    pub(super) fn solve(&self, set: &Set) -> Option<Solved> {
        let (columns, precision) = self.columns(set);
        let n = columns.len();
        let mut matrix = DMatrix::from_fn(n, n, |i, j| self.qq[(columns[i], columns[j])]);
        for (place, own) in precision.iter().enumerate() {
            matrix[(place, place)] += own;
        }
        let right = DVector::from_iterator(n, columns.iter().map(|&column| self.qy[column]));
        let factor = Cholesky::new(matrix)?;
        let half = factor.l_dirty().solve_lower_triangular(&right)?;
        let mean = factor.solve(&right);
        let left = (self.yy - half.norm_squared()).max(0.0) + RESOLUTION * RESOLUTION;
        let diagonal = factor.l_dirty().diagonal();
        let log_determinant: f64 = diagonal.iter().map(|value| 2.0 * value.ln()).sum();
        let spread: f64 = precision.iter().map(|own| own.ln()).sum();
        let log_evidence = -0.5 * (self.rows + 1.0) * left.ln() - 0.5 * (log_determinant - spread);
        Some(Solved {
            columns,
            factor,
            mean,
            half,
            left,
            log_evidence,
        })
    }

    /// Refits the sizes of a set.
    pub(super) fn resize(&self, set: &mut Set, rounds: usize) -> Option<Solved> {
        for _ in 0..rounds {
            let solved = self.solve(set)?;
            let spread = solved.diagonal();
            let variance = solved.variance(self.rows);
            let mut next = self.free;
            for (&member, size) in set.members.iter().zip(&mut set.sizes) {
                let width = self.spans[member].1;
                let power: f64 = (next..next + width)
                    .map(|i| solved.mean[i].powi(2) / variance + spread[i])
                    .sum();
                *size = (power / width as f64).max(1.0);
                next += width;
            }
        }
        self.solve(set)
    }

    /// Log evidence that a block adds to a solved set, and the size at which it adds most.
    pub(super) fn gain(&self, solved: &Solved, block: usize) -> (f64, f64) {
        let (first, width) = self.spans[block];
        let columns: Vec<usize> = (first..first + width).collect();
        self.gain_of(solved, &columns)
    }

    fn gain_of(&self, solved: &Solved, columns: &[usize]) -> (f64, f64) {
        let (n, width) = (solved.columns.len(), columns.len());
        let cross = DMatrix::from_fn(n, width, |i, j| self.qq[(solved.columns[i], columns[j])]);
        let own = DMatrix::from_fn(width, width, |i, j| self.qq[(columns[i], columns[j])]);
        let right = DVector::from_fn(width, |i, _| self.qy[columns[i]]);
        gain(solved, &cross, own, right, self.rows)
    }

    /// Log evidence that groups of foreign columns (over all rows) would each add to a solved set.
    pub(super) fn foreign(
        &self,
        solved: &Solved,
        all: &[&Vec<f64>],
        groups: &[&[Vec<f64>]],
        y: &[f64],
        active: &[bool],
    ) -> Vec<(f64, f64)> {
        let known: Vec<&Vec<f64>> = solved.columns.iter().map(|&column| all[column]).collect();
        let known = picked(&known, active);
        let y = DVector::from_vec(pick(y, active));
        let of_group = |columns: &&[Vec<f64>]| {
            let new = picked(&columns.iter().collect::<Vec<_>>(), active);
            let (cross, right) = (known.tr_mul(&new), new.tr_mul(&y));
            gain(solved, &cross, new.tr_mul(&new), right, self.rows)
        };
        groups.iter().map(of_group).collect()
    }
}

/// Schur complement of the new columns beside the solved ones, and the best size along its eigenvectors.
fn gain(
    solved: &Solved,
    cross: &DMatrix<f64>,
    own: DMatrix<f64>,
    right: DVector<f64>,
    rows: f64,
) -> (f64, f64) {
    let Some(half) = solved.factor.l_dirty().solve_lower_triangular(cross) else {
        return (f64::NEG_INFINITY, 1.0);
    };
    let free = own - half.tr_mul(&half);
    let along = right - half.tr_mul(&solved.half);
    let eigen = free.symmetric_eigen();
    let seen = eigen.eigenvectors.tr_mul(&along);
    let freedom = rows + 1.0;
    let at = |size: f64| {
        let (mut explained, mut spread) = (0.0, 0.0);
        for (power, g) in eigen.eigenvalues.iter().zip(seen.iter()) {
            let power = power.max(0.0);
            explained += size * g * g / (1.0 + size * power);
            spread += (size * power).ln_1p();
        }
        let left = (solved.left - explained).max(RESOLUTION * RESOLUTION);
        0.5 * freedom * (solved.left / left).ln() - 0.5 * spread
    };
    DECADES
        .flat_map(|decade| [1.0, 3.0].map(|step| step * 10.0_f64.powi(decade)))
        .map(|size| (at(size), size))
        .max_by(|one, other| one.0.total_cmp(&other.0))
        .unwrap_or((f64::NEG_INFINITY, 1.0))
}

/// The values of the rows in use.
pub(super) fn pick(values: &[f64], active: &[bool]) -> Vec<f64> {
    (values.iter().zip(active))
        .filter(|&(_, &used)| used)
        .map(|(&value, _)| value)
        .collect()
}

/// Columns over the rows in use, as a matrix.
pub(super) fn picked(columns: &[&Vec<f64>], active: &[bool]) -> DMatrix<f64> {
    let rows = active.iter().filter(|&&used| used).count();
    let values = columns.iter().flat_map(|column| pick(column, active));
    DMatrix::from_iterator(rows, columns.len(), values)
}

/// What coefficients of columns predict, row by row.
pub(super) fn predict(columns: &[&Vec<f64>], coefficients: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; columns.first().map_or(0, |column| column.len())];
    for (column, coefficient) in columns.iter().zip(coefficients) {
        crate::evidence::add_scaled(&mut sum, *coefficient, column);
    }
    sum
}

/// Root mean square.
pub(super) fn rms(values: &[f64]) -> f64 {
    (dot(values, values) / values.len().max(1) as f64).sqrt()
}
