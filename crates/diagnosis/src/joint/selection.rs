//! Forward selection of effects by evidence, one at a time, then backward elimination.

use super::blocks::BlockPool;
use inference::evidence::LOG_OCCAM_FACTOR;
use inference::gram::{BlockSet, Gram, Solution, active_columns, active_values, combination};

use effects::observation::Observations;
use nalgebra::{DMatrix, DVector};

/// Most effects of a set.
const MOST: usize = 30;
/// An effect enters only when the set with it is this many times as probable (natural log).
const REFUTED: f64 = 2.303;
/// And only when it takes at least this share off the remaining rms: among thousands of touches, whose errors are never
/// quite independent, everything is significant.
const WORTH: f64 = 0.01;

/// Rounds of refitting the sizes after each step.
const ROUNDS: usize = 2;
/// Most columns of an effect with few parameters.
const FEW: usize = 8;

/// A selected set with its products and its posterior.
pub(super) struct Selection {
    pub(super) set: BlockSet,
    pub(super) gram: Gram,
    pub(super) solution: Solution,
}

/// The rows of a selection.
pub(super) struct Rows<'a> {
    pub(super) observations: &'a Observations,
    pub(super) free: &'a [Vec<f64>],
    pub(super) y: &'a [f64],
    pub(super) active: &'a [bool],
}

impl Rows<'_> {
    /// All columns there are, in the order of the products.
    pub(super) fn columns<'a>(&'a self, pool: &'a BlockPool) -> Vec<&'a Vec<f64>> {
        let blocks = pool.blocks.iter().flat_map(|block| &block.columns);
        self.free.iter().chain(blocks).collect()
    }

    /// Selects a set from a smaller one on, in two ways: whatever gains most, or first the effects with few parameters,
    /// which flexible ones would otherwise absorb. The more probable result counts.
    pub(super) fn select(&self, pool: &mut BlockPool, start: &BlockSet) -> Option<Selection> {
        let mut gram = Gram::new(self.free, pool.columns(), self.y, self.active);
        let mut best: Option<(f64, BlockSet, Solution)> = None;
        for widths in [&[usize::MAX][..], &[FEW, usize::MAX]] {
            let mut set = start.clone();
            let mut solution = gram.maximise(&mut set, ROUNDS)?;
            for &widest in widths {
                self.add_while_evidence_rises(pool, &mut gram, &mut set, &mut solution, widest)?;
            }
            eliminate(pool, &gram, &mut set, &mut solution)?;
            let prices: f64 = set.members.iter().map(|&member| price(pool, member)).sum();
            let score = solution.log_evidence - prices;
            if best.as_ref().is_none_or(|(known, _, _)| score > *known) {
                best = Some((score, set, solution));
            }
        }
        best.map(|(_, set, solution)| Selection {
            set,
            gram,
            solution,
        })
    }

    /// Adds blocks of at most `widest` columns while the evidence rises.
    fn add_while_evidence_rises(
        &self,
        pool: &mut BlockPool,
        gram: &mut Gram,
        set: &mut BlockSet,
        solution: &mut Solution,
        widest: usize,
    ) -> Option<()> {
        while set.members.len() < MOST {
            self.scan(pool, gram, solution);
            let best = (0..pool.blocks.len())
                .filter(|&block| !contains_effect(pool, set, block))
                .filter(|&block| pool.blocks[block].columns.len() <= widest)
                .map(|block| {
                    let (gain, size) = gram.gain(solution, block);
                    (gain - price(pool, block), block, size)
                })
                .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            let Some((_, block, size)) = best.filter(|(gain, _, _)| *gain > least(gram)) else {
                break;
            };
            set.members.push(block);
            set.prior_variances.push(size);
            *solution = gram.maximise(set, ROUNDS)?;
        }
        Some(())
    }

    /// Adds the nonlinear parameters that best explain the residuals of a set.
    fn scan(&self, pool: &mut BlockPool, gram: &mut Gram, solution: &Solution) {
        let gains = gram.gains_of(
            solution,
            &self.columns(pool),
            &pool.trials(),
            self.y,
            self.active,
        );
        pool.add_best(self.observations, &gains);
        gram.extend(self.free, pool.columns(), self.y, self.active);
    }

    /// Weighted deviations of all rows less what coefficients of some columns predict.
    pub(super) fn residuals(&self, pool: &BlockPool, columns: &[usize], mean: &[f64]) -> Vec<f64> {
        let all = self.columns(pool);
        let columns: Vec<&Vec<f64>> = columns.iter().map(|&column| all[column]).collect();
        if columns.is_empty() {
            return self.y.to_vec();
        }
        let predicted = combination(&columns, mean);
        self.y.iter().zip(&predicted).map(|(y, p)| y - p).collect()
    }

    /// Normal equations of a set over the rows in `training` only: products with their prior precisions, and projections.
    fn normal_equations(
        &self,
        pool: &BlockPool,
        gram: &Gram,
        set: &BlockSet,
        training: &[bool],
    ) -> (DMatrix<f64>, DVector<f64>) {
        let (columns, precision) = gram.columns(set);
        let all = self.columns(pool);
        let chosen: Vec<&Vec<f64>> = columns.iter().map(|&column| all[column]).collect();
        let matrix = active_columns(&chosen, training);
        let right = matrix.tr_mul(&DVector::from_vec(active_values(self.y, training)));
        let mut normal = matrix.tr_mul(&matrix);
        for (index, precision) in precision.iter().enumerate() {
            normal[(index, index)] += precision;
        }
        (normal, right)
    }

    /// Coefficients of the first one, two, … members of a set, fitted to the rows in `training` only.
    pub(super) fn prefixes(
        &self,
        pool: &BlockPool,
        gram: &Gram,
        set: &BlockSet,
        training: &[bool],
    ) -> Vec<Option<Vec<f64>>> {
        let (normal, right) = self.normal_equations(pool, gram, set, training);
        let mut width = self.free.len();
        let mut widths = vec![width];
        for &member in &set.members {
            width += pool.blocks[member].columns.len();
            widths.push(width);
        }
        widths
            .into_iter()
            .map(|width| {
                let part = normal.view((0, 0), (width, width)).into_owned();
                let right = right.rows(0, width).into_owned();
                let mean = nalgebra::Cholesky::new(part)?.solve(&right);
                Some(mean.as_slice().to_vec())
            })
            .collect()
    }

    /// Coefficients of a set fitted to the rows in `training` only: of the whole set, then without each of its members, whose
    /// own are zero there.
    pub(super) fn without_each(
        &self,
        pool: &BlockPool,
        gram: &Gram,
        set: &BlockSet,
        training: &[bool],
    ) -> Option<Vec<Vec<f64>>> {
        let (normal, right) = self.normal_equations(pool, gram, set, training);
        let factor = nalgebra::Cholesky::new(normal)?;
        let mean = factor.solve(&right);
        let covariance = factor.inverse();
        let mut all = vec![mean.as_slice().to_vec()];
        let mut first = self.free.len();
        for &member in &set.members {
            let width = pool.blocks[member].columns.len();
            let rest = without(&mean, &covariance, first..first + width)?;
            all.push(rest.as_slice().to_vec());
            first += width;
        }
        Some(all)
    }
}

/// Backward elimination: removes what the rest has made superfluous, the least first.
fn eliminate(
    pool: &BlockPool,
    gram: &Gram,
    set: &mut BlockSet,
    solution: &mut Solution,
) -> Option<()> {
    loop {
        let mut weakest: Option<(f64, usize, BlockSet)> = None;
        for index in 0..set.members.len() {
            let reduced = set.without(index);
            let member = set.members[index];
            let loss = gram.gain(&gram.solve(&reduced)?, member).0 - price(pool, member);
            if loss < least(gram) && weakest.as_ref().is_none_or(|(known, _, _)| loss < *known) {
                weakest = Some((loss, index, reduced));
            }
        }
        let Some((_, _, mut reduced)) = weakest else {
            return Some(());
        };
        *solution = gram.maximise(&mut reduced, ROUNDS)?;
        *set = reduced;
    }
}

/// True when the set contains a block of the same effect.
pub(super) fn contains_effect(pool: &BlockPool, set: &BlockSet, block: usize) -> bool {
    let effect = &pool.blocks[block].effect;
    set.members
        .iter()
        .any(|&member| pool.blocks[member].effect == *effect)
}

/// Least gain of evidence that is worth an effect.
pub(super) fn least(gram: &Gram) -> f64 {
    REFUTED.max(WORTH * gram.rows())
}

/// Log price of choosing a block.
pub(super) fn price(pool: &BlockPool, block: usize) -> f64 {
    LOG_OCCAM_FACTOR + pool.blocks[block].price
}

/// Coefficients where those in `own` are zero, from the mean of all and their covariance over that of the noise: the
/// conditional mean of a joint normal distribution.
fn without(
    mean: &DVector<f64>,
    covariance: &DMatrix<f64>,
    own: std::ops::Range<usize>,
) -> Option<DVector<f64>> {
    let (first, width) = (own.start, own.len());
    let block = covariance.view((first, first), (width, width));
    let taken = nalgebra::Cholesky::new(block.into_owned())?.solve(&mean.rows(first, width));
    let mut rest = mean - covariance.columns(first, width) * taken;
    rest.rows_mut(first, width).fill(0.0);
    Some(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the normal equations solved without the block.
    #[test]
    fn the_conditional_mean_is_that_of_the_smaller_fit() {
        let value = |i: usize, j: usize| ((i * 37 + j * 101 + i * j * 7) % 23) as f64 / 23.0 - 0.4;
        let matrix = DMatrix::from_fn(30, 6, value);
        let y = DVector::from_fn(30, |row, _| value(row, 11));
        let normal = matrix.tr_mul(&matrix) + DMatrix::identity(6, 6) * 0.3;
        let right = matrix.tr_mul(&y);
        let factor = nalgebra::Cholesky::new(normal.clone()).expect("positive definite");
        let found = without(&factor.solve(&right), &factor.inverse(), 2..4).expect("solvable");
        let kept = [0, 1, 4, 5];
        let smaller = normal.select_rows(&kept).select_columns(&kept);
        let expected = nalgebra::Cholesky::new(smaller)
            .expect("positive definite")
            .solve(&right.select_rows(&kept));
        for (&place, expected) in kept.iter().zip(&expected) {
            assert!((found[place] - expected).abs() < 1e-12);
        }
        assert_eq!((found[2], found[3]), (0.0, 0.0));
    }
}
