//! Growth of the set of effects: the one that adds most evidence beside what is there, one at a time, then pruning.

use super::gram::{Gram, Set, Solved, pick, picked, predict};
use super::pool::Pool;
use crate::observation::Observations;

/// Most effects of a set.
const MOST: usize = 30;
/// An effect enters only when the set with it is this many times as probable (natural log).
const REFUTED: f64 = 2.303;
/// And only when it takes at least this share off the remaining rms: among thousands of touches, whose errors are never
/// quite independent, everything is significant.
const WORTH: f64 = 0.01;
/// Price of a block's own size: a log-uniform prior over four decades, known to about a factor e.
const SIZE_PRICE: f64 = 1.5;
/// Rounds of refitting the sizes after each step.
const ROUNDS: usize = 2;
/// Most columns of an effect with few parameters.
const FEW: usize = 8;

/// A grown set, what belongs to it, and what was tried.
pub(super) struct Grown {
    pub(super) set: Set,
    pub(super) gram: Gram,
    pub(super) solved: Solved,
}

/// The rows a growth works on.
pub(super) struct Rows<'a> {
    pub(super) observations: &'a Observations,
    pub(super) free: &'a [Vec<f64>],
    pub(super) y: &'a [f64],
    pub(super) active: &'a [bool],
}

impl Rows<'_> {
    /// All columns there are, in the order of the products.
    pub(super) fn columns<'a>(&'a self, pool: &'a Pool) -> Vec<&'a Vec<f64>> {
        let blocks = pool.blocks.iter().flat_map(|block| &block.columns);
        self.free.iter().chain(blocks).collect()
    }

    /// Grows a set from a smaller one, along two roads: whatever gains most, or first the effects with few parameters,
    /// which flexible ones would otherwise swallow. The more probable end counts.
    pub(super) fn grow(&self, pool: &mut Pool, start: &Set) -> Option<Grown> {
        let mut gram = Gram::new(self.free, &pool.blocks, self.y, self.active);
        let mut best: Option<(f64, Set, Solved)> = None;
        for roads in [&[usize::MAX][..], &[FEW, usize::MAX]] {
            let mut set = start.clone();
            let mut solved = gram.resize(&mut set, ROUNDS)?;
            for &widest in roads {
                self.climb(pool, &mut gram, &mut set, &mut solved, widest)?;
            }
            prune(pool, &gram, &mut set, &mut solved)?;
            let prices: f64 = set.members.iter().map(|&member| price(pool, member)).sum();
            let score = solved.log_evidence - prices;
            if best.as_ref().is_none_or(|(known, _, _)| score > *known) {
                best = Some((score, set, solved));
            }
        }
        best.map(|(_, set, solved)| Grown { set, gram, solved })
    }

    /// Adds blocks of at most `widest` columns while the evidence rises.
    fn climb(
        &self,
        pool: &mut Pool,
        gram: &mut Gram,
        set: &mut Set,
        solved: &mut Solved,
        widest: usize,
    ) -> Option<()> {
        while set.members.len() < MOST {
            self.scan(pool, gram, solved);
            let best = (0..pool.blocks.len())
                .filter(|&block| !taken(pool, set, block))
                .filter(|&block| pool.blocks[block].columns.len() <= widest)
                .map(|block| {
                    let (gain, size) = gram.gain(solved, block);
                    (gain - price(pool, block), block, size)
                })
                .max_by(|one, other| one.0.total_cmp(&other.0).then(other.1.cmp(&one.1)));
            let Some((_, block, size)) = best.filter(|(gain, _, _)| *gain > least(gram)) else {
                break;
            };
            set.members.push(block);
            set.sizes.push(size);
            *solved = gram.resize(set, ROUNDS)?;
        }
        Some(())
    }

    /// Adds the nonlinear constants that best explain what a set leaves.
    fn scan(&self, pool: &mut Pool, gram: &mut Gram, solved: &Solved) {
        let gains = gram.foreign(
            solved,
            &self.columns(pool),
            &pool.trials(),
            self.y,
            self.active,
        );
        pool.add_best(self.observations, &gains);
        gram.extend(self.free, &pool.blocks, self.y, self.active);
    }

    /// Weighted deviations less what a solved set predicts, all rows.
    pub(super) fn left(&self, pool: &Pool, columns: &[usize], mean: &[f64]) -> Vec<f64> {
        let all = self.columns(pool);
        let columns: Vec<&Vec<f64>> = columns.iter().map(|&column| all[column]).collect();
        if columns.is_empty() {
            return self.y.to_vec();
        }
        let predicted = predict(&columns, mean);
        self.y.iter().zip(&predicted).map(|(y, p)| y - p).collect()
    }

    /// Coefficients of the first one, two, … members of a set, fitted to the rows in `training` only.
    pub(super) fn prefixes(
        &self,
        pool: &Pool,
        gram: &Gram,
        set: &Set,
        training: &[bool],
    ) -> Vec<Option<Vec<f64>>> {
        let (columns, precision) = gram.columns(set);
        let all = self.columns(pool);
        let chosen: Vec<&Vec<f64>> = columns.iter().map(|&column| all[column]).collect();
        let matrix = picked(&chosen, training);
        let right = matrix.tr_mul(&nalgebra::DVector::from_vec(pick(self.y, training)));
        let mut normal = matrix.tr_mul(&matrix);
        for (place, own) in precision.iter().enumerate() {
            normal[(place, place)] += own;
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

/// Takes out what the rest has made superfluous, the least first.
fn prune(pool: &Pool, gram: &Gram, set: &mut Set, solved: &mut Solved) -> Option<()> {
    loop {
        let mut weakest: Option<(f64, usize, Set)> = None;
        for place in 0..set.members.len() {
            let rest = without(set, place);
            let member = set.members[place];
            let loss = gram.gain(&gram.solve(&rest)?, member).0 - price(pool, member);
            if loss < least(gram) && weakest.as_ref().is_none_or(|(known, _, _)| loss < *known) {
                weakest = Some((loss, place, rest));
            }
        }
        let Some((_, _, mut rest)) = weakest else {
            return Some(());
        };
        *solved = gram.resize(&mut rest, ROUNDS)?;
        *set = rest;
    }
}

/// True when the block or another of its effect stands in the set.
pub(super) fn taken(pool: &Pool, set: &Set, block: usize) -> bool {
    let own = &pool.blocks[block].effect;
    set.members
        .iter()
        .any(|&member| pool.blocks[member].effect == *own)
}

/// Least gain of evidence that is worth an effect.
pub(super) fn least(gram: &Gram) -> f64 {
    REFUTED.max(WORTH * gram.rows())
}

/// What choosing a block costs, natural log.
pub(super) fn price(pool: &Pool, block: usize) -> f64 {
    SIZE_PRICE + pool.blocks[block].price
}

/// A set without one of its members.
pub(super) fn without(set: &Set, place: usize) -> Set {
    let mut rest = set.clone();
    rest.members.remove(place);
    rest.sizes.remove(place);
    rest
}
