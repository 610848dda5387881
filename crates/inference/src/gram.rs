//! Evidence of sets of hundreds of columns, some of them unpenalised.
//!
//! Model and iteration are those of [`crate::evidence`]; added are nuisance columns with a nearly flat prior (the pose of
//! each of several sessions), matrices of `nalgebra`, and the evidence gained by one more block, from its Schur complement.
//! Works on inner products. Metres.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::fixed_point::{Blocks, RESOLUTION, RidgeSystem, State, Stop, maximise, noise_variance};
use crate::linear::add_scaled;

/// Prior precision of the nuisance columns, over that of the noise over one column's length.
const FLAT: f64 = 1e-9;
/// Prior variances of a new block that are compared, decades over the noise.
const DECADES: std::ops::Range<i32> = 0..9;

/// A block of columns over all rows.
pub type Block<'a> = &'a [Vec<f64>];

/// Inner products of nuisance columns and blocks over the rows in use.
pub struct Gram {
    rows: f64,
    yy: f64,
    qy: DVector<f64>,
    qq: DMatrix<f64>,
    nuisances: usize,
    spans: Vec<(usize, usize)>,
}

/// A set of blocks with the prior variance of each over that of the noise.
#[derive(Debug, Clone, Default)]
pub struct BlockSet {
    /// Indices of the blocks, in the order in which they entered.
    pub members: Vec<usize>,
    /// Prior variance of each of them over that of the noise.
    pub prior_variances: Vec<f64>,
}

impl BlockSet {
    /// The set without the member at `index`.
    #[must_use]
    pub fn without(&self, index: usize) -> Self {
        let mut rest = self.clone();
        rest.members.remove(index);
        rest.prior_variances.remove(index);
        rest
    }
}

/// The posterior of a set.
pub struct Solution {
    /// Columns of the set, the nuisances first.
    pub columns: Vec<usize>,
    factor: Cholesky<f64, Dyn>,
    /// Posterior mean of their coefficients, m.
    pub mean: DVector<f64>,
    half: DVector<f64>,
    /// Residual sum of squares with the pseudo-observation, m².
    residual: f64,
    rows: f64,
    /// Natural logarithm of the evidence, up to a constant of the rows.
    pub log_evidence: f64,
}

impl Solution {
    /// Noise variance, m².
    pub fn variance(&self) -> f64 {
        self.residual / (self.rows + 1.0)
    }

    /// Covariance of the coefficients over the noise variance, m⁻²: a row and a column for each solved column.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }

    /// Evidence that columns add, and the prior variance at which it is largest: from the Schur complement of the columns
    /// beside the solved ones, along its eigenvectors.
    fn gain(&self, cross: &DMatrix<f64>, gram: DMatrix<f64>, right: DVector<f64>) -> (f64, f64) {
        let Some(half) = self.factor.l_dirty().solve_lower_triangular(cross) else {
            return (f64::NEG_INFINITY, 1.0);
        };
        let complement = gram - half.tr_mul(&half);
        let along = right - half.tr_mul(&self.half);
        let eigen = complement.symmetric_eigen();
        let projected = eigen.eigenvectors.tr_mul(&along);
        let freedom = self.rows + 1.0;
        let at = |variance: f64| {
            let (mut explained, mut log_determinant) = (0.0, 0.0);
            for (power, g) in eigen.eigenvalues.iter().zip(projected.iter()) {
                let power = power.max(0.0);
                explained += variance * g * g / (1.0 + variance * power);
                log_determinant += (variance * power).ln_1p();
            }
            let residual = (self.residual - explained).max(RESOLUTION * RESOLUTION);
            0.5 * freedom * (self.residual / residual).ln() - 0.5 * log_determinant
        };
        DECADES
            .flat_map(|decade| [1.0, 3.0].map(|step| step * 10.0_f64.powi(decade)))
            .map(|variance| (at(variance), variance))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((f64::NEG_INFINITY, 1.0))
    }
}

impl Gram {
    /// Inner products of the nuisances, then the blocks' columns, over the rows with a true in `active`.
    pub fn new<'b>(
        nuisances: &'b [Vec<f64>],
        blocks: impl Iterator<Item = Block<'b>>,
        y: &[f64],
        active: &[bool],
    ) -> Self {
        let mut columns: Vec<&Vec<f64>> = nuisances.iter().collect();
        let mut spans = Vec::new();
        for block in blocks {
            spans.push((columns.len(), block.len()));
            columns.extend(block);
        }
        let matrix = active_columns(&columns, active);
        let y = DVector::from_vec(active_values(y, active));
        Self {
            rows: y.len() as f64,
            yy: y.norm_squared(),
            qy: matrix.tr_mul(&y),
            qq: matrix.tr_mul(&matrix),
            nuisances: nuisances.len(),
            spans,
        }
    }

    /// Adds the blocks behind those that it has; `nuisances` and `blocks` are all there are by now.
    pub fn extend<'b>(
        &mut self,
        nuisances: &'b [Vec<f64>],
        blocks: impl Iterator<Item = Block<'b>>,
        y: &[f64],
        active: &[bool],
    ) {
        let known = self.qy.len();
        let mut all: Vec<&Vec<f64>> = nuisances.iter().collect();
        for (index, block) in blocks.enumerate() {
            if index >= self.spans.len() {
                self.spans.push((all.len(), block.len()));
            }
            all.extend(block);
        }
        let count = all.len();
        if count == known {
            return;
        }
        let old = active_columns(&all[..known], active);
        let new = active_columns(&all[known..], active);
        let cross = old.tr_mul(&new);
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
            .copy_from(&new.tr_mul(&new));
        let added = new.tr_mul(&DVector::from_vec(active_values(y, active)));
        self.qy = DVector::from_iterator(count, self.qy.iter().chain(added.iter()).copied());
    }

    /// Number of rows in use.
    pub fn rows(&self) -> f64 {
        self.rows
    }

    /// Columns of a set, the nuisances first, with their prior precisions over that of the noise.
    pub fn columns(&self, set: &BlockSet) -> (Vec<usize>, Vec<f64>) {
        let mut columns: Vec<usize> = (0..self.nuisances).collect();
        let mut precision = vec![FLAT; self.nuisances];
        for (&member, variance) in set.members.iter().zip(&set.prior_variances) {
            let (first, width) = self.spans[member];
            columns.extend(first..first + width);
            precision.extend(std::iter::repeat_n(1.0 / variance, width));
        }
        (columns, precision)
    }

    /// The posterior of a set at its prior variances; `None` where it is not positive definite.
    pub fn solve(&self, set: &BlockSet) -> Option<Solution> {
        let (columns, precision) = self.columns(set);
        let mut posterior = LargePosterior::new(self, columns);
        posterior.solve(&precision)?;
        posterior.solution
    }

    /// The posterior of a set after `rounds` updates of its prior variances towards the maximum of the evidence.
    pub fn maximise(&self, set: &mut BlockSet, rounds: usize) -> Option<Solution> {
        let (columns, _) = self.columns(set);
        let mut end = self.nuisances;
        let span = |&member: &usize| {
            let start = end;
            end += self.spans[member].1;
            start..end
        };
        let blocks = Blocks {
            fixed: vec![FLAT; self.nuisances],
            spans: set.members.iter().map(span).collect(),
            caps: vec![f64::INFINITY; columns.len()],
        };
        let start = State {
            prior_variances: set.prior_variances.clone(),
            noise_variance: noise_variance(self.yy, self.rows),
            covariance_diagonal: Vec::new(),
        };
        let stop = Stop {
            rounds,
            tolerance: 0.0,
        };
        let mut posterior = LargePosterior::new(self, columns);
        let state = maximise(&mut posterior, &blocks, start, self.rows, stop)?;
        set.prior_variances = state.prior_variances;
        posterior.solution
    }

    /// Log evidence that a block adds to a solved set, and the prior variance at which it adds most.
    pub fn gain(&self, solution: &Solution, block: usize) -> (f64, f64) {
        let (first, width) = self.spans[block];
        let n = solution.columns.len();
        let cross = DMatrix::from_fn(n, width, |i, j| self.qq[(solution.columns[i], first + j)]);
        let gram = DMatrix::from_fn(width, width, |i, j| self.qq[(first + i, first + j)]);
        let right = DVector::from_fn(width, |i, _| self.qy[first + i]);
        solution.gain(&cross, gram, right)
    }

    /// The same as [`Self::gain`] for groups of columns (over all rows) that are no blocks; `all` are the columns of the
    /// nuisances and blocks.
    pub fn gains_of(
        &self,
        solution: &Solution,
        all: &[&Vec<f64>],
        groups: &[Block<'_>],
        y: &[f64],
        active: &[bool],
    ) -> Vec<(f64, f64)> {
        let columns: Vec<&Vec<f64>> = solution.columns.iter().map(|&index| all[index]).collect();
        let columns = active_columns(&columns, active);
        let y = DVector::from_vec(active_values(y, active));
        let gain = |group: &Block<'_>| {
            let new = active_columns(&group.iter().collect::<Vec<_>>(), active);
            solution.gain(&columns.tr_mul(&new), new.tr_mul(&new), new.tr_mul(&y))
        };
        groups.iter().map(gain).collect()
    }
}

/// The posterior of a large set.
struct LargePosterior<'g> {
    gram: &'g Gram,
    columns: Vec<usize>,
    products: DMatrix<f64>,
    projections: DVector<f64>,
    solution: Option<Solution>,
}

impl<'g> LargePosterior<'g> {
    fn new(gram: &'g Gram, columns: Vec<usize>) -> Self {
        let n = columns.len();
        Self {
            products: DMatrix::from_fn(n, n, |i, j| gram.qq[(columns[i], columns[j])]),
            projections: DVector::from_iterator(n, columns.iter().map(|&c| gram.qy[c])),
            gram,
            columns,
            solution: None,
        }
    }
}

impl RidgeSystem for LargePosterior<'_> {
    fn solve(&mut self, precision: &[f64]) -> Option<()> {
        let mut matrix = self.products.clone();
        for (index, precision) in precision.iter().enumerate() {
            matrix[(index, index)] += precision;
        }
        let factor = Cholesky::new(matrix)?;
        let half = factor.l_dirty().solve_lower_triangular(&self.projections)?;
        let mean = factor.solve(&self.projections);
        let gram = self.gram;
        let residual = (gram.yy - half.norm_squared()).max(0.0) + RESOLUTION * RESOLUTION;
        let diagonal = factor.l_dirty().diagonal();
        let log_determinant: f64 = diagonal.iter().map(|value| 2.0 * value.ln()).sum();
        let log_prior: f64 = precision.iter().map(|precision| precision.ln()).sum();
        let log_evidence =
            -0.5 * (gram.rows + 1.0) * residual.ln() - 0.5 * (log_determinant - log_prior);
        self.solution = Some(Solution {
            columns: self.columns.clone(),
            factor,
            mean,
            half,
            residual,
            rows: gram.rows,
            log_evidence,
        });
        Some(())
    }

    fn mean(&self) -> &[f64] {
        (self.solution.as_ref()).map_or(&[], |solution| solution.mean.as_slice())
    }

    fn residual(&self) -> f64 {
        (self.solution.as_ref()).map_or(self.gram.yy, |solution| {
            (self.gram.yy - solution.half.norm_squared()).max(0.0)
        })
    }

    /// Squared lengths of the columns of L⁻¹.
    fn covariance_diagonal(&mut self) -> Vec<f64> {
        let Some(solution) = &self.solution else {
            return Vec::new();
        };
        let lower = solution.factor.l_dirty();
        let n = lower.nrows();
        let mut unit = vec![0.0; n];
        (0..n)
            .map(|first| {
                unit[first..].fill(0.0);
                unit[first] = 1.0;
                let mut sum = 0.0;
                for k in first..n {
                    let column = lower.column(k);
                    let element = unit[k] / column[k];
                    sum += element * element;
                    for (value, part) in unit[k + 1..].iter_mut().zip(&column.as_slice()[k + 1..]) {
                        *value -= element * part;
                    }
                }
                sum
            })
            .collect()
    }
}

/// The values of the rows in use.
pub fn active_values(values: &[f64], active: &[bool]) -> Vec<f64> {
    (values.iter().zip(active))
        .filter(|&(_, &used)| used)
        .map(|(&value, _)| value)
        .collect()
}

/// Columns over the rows in use, as a matrix.
pub fn active_columns(columns: &[&Vec<f64>], active: &[bool]) -> DMatrix<f64> {
    let rows = active.iter().filter(|&&used| used).count();
    let values = (columns.iter()).flat_map(|column| active_values(column, active));
    DMatrix::from_iterator(rows, columns.len(), values)
}

/// The linear combination of columns with these coefficients, row by row.
pub fn combination(columns: &[&Vec<f64>], coefficients: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; columns.first().map_or(0, |column| column.len())];
    for (column, coefficient) in columns.iter().zip(coefficients) {
        add_scaled(&mut sum, *coefficient, column);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{InnerProducts, LOG_OCCAM_FACTOR};
    use statrs::function::gamma::ln_gamma;

    fn column(number: usize) -> Vec<f64> {
        (0..40)
            .map(|row| {
                ((row * 37 + number * 101 + row * row * (number + 3)) % 23) as f64 / 23.0 - 0.4
            })
            .collect()
    }

    /// Both engines give a set the same evidence, but for the constant of the rows and the price of the variances.
    #[test]
    fn both_engines_agree() {
        let blocks: Vec<Vec<Vec<f64>>> = vec![vec![column(1), column(2)], vec![column(3)]];
        let noise = column(9);
        let y: Vec<f64> = (0..40)
            .map(|row| 3e-5 * blocks[0][0][row] - 2e-5 * blocks[1][0][row] + 1e-6 * noise[row])
            .collect();
        let active: Vec<bool> = (0..40).map(|row| row % 9 != 4).collect();
        let views: Vec<&[Vec<f64>]> = blocks.iter().map(Vec::as_slice).collect();
        let small = InnerProducts::new(&views, &y, &active);
        let large = Gram::new(&[], views.iter().copied(), &y, &active);
        let variances = small.variances(&[0, 1]).prior_variances;
        let set = BlockSet {
            members: vec![0, 1],
            prior_variances: variances.clone(),
        };
        let solution = large.solve(&set).expect("positive definite");
        let half = 0.5 * (large.rows() + 1.0);
        let constant = ln_gamma(half) - half * std::f64::consts::PI.ln() - 2.0 * LOG_OCCAM_FACTOR;
        // The other engine takes sizes, over the noise that they leave.
        let noise = solution.variance();
        let sizes: Vec<f64> = variances.iter().map(|variance| variance * noise).collect();
        let expected = small.log_evidence_at_sizes(&[0, 1], &sizes, noise);
        assert!((solution.log_evidence + constant - expected).abs() < 1e-9);
    }

    /// The gain of a block is what solving the larger set adds.
    #[test]
    fn the_gain_of_a_block_is_the_difference_of_two_solutions() {
        let nuisances = [column(5)];
        let blocks: Vec<Vec<Vec<f64>>> = vec![vec![column(1), column(2)], vec![column(3)]];
        let y: Vec<f64> = (0..40)
            .map(|row| 1e-5 * column(3)[row] + 1e-6 * column(7)[row])
            .collect();
        let gram = Gram::new(
            &nuisances,
            blocks.iter().map(Vec::as_slice),
            &y,
            &[true; 40],
        );
        let mut set = BlockSet {
            members: vec![0],
            prior_variances: vec![100.0],
        };
        let before = gram.solve(&set).expect("positive definite");
        let (gain, variance) = gram.gain(&before, 1);
        set.members.push(1);
        set.prior_variances.push(variance);
        let after = gram.solve(&set).expect("positive definite");
        assert!((after.log_evidence - before.log_evidence - gain).abs() < 1e-9);
    }
}
