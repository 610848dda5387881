//! Forward selection of effects by evidence, one at a time, then backward elimination.

use super::blocks::BlockPool;
use inference::evidence::SIZE_PRICE;
use inference::gram::{BlockSet, Gram, Solution, active_columns, active_values, combination};

use effects::observation::Observations;

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

    /// Adds the nonlinear constants that best explain the residuals of a set.
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

    /// Coefficients of the first one, two, … members of a set, fitted to the rows in `training` only.
    pub(super) fn prefixes(
        &self,
        pool: &BlockPool,
        gram: &Gram,
        set: &BlockSet,
        training: &[bool],
    ) -> Vec<Option<Vec<f64>>> {
        let (columns, precision) = gram.columns(set);
        let all = self.columns(pool);
        let chosen: Vec<&Vec<f64>> = columns.iter().map(|&column| all[column]).collect();
        let matrix = active_columns(&chosen, training);
        let right = matrix.tr_mul(&nalgebra::DVector::from_vec(active_values(
            self.y, training,
        )));
        let mut normal = matrix.tr_mul(&matrix);
        for (index, precision) in precision.iter().enumerate() {
            normal[(index, index)] += precision;
        }
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
    SIZE_PRICE + pool.blocks[block].price
}
