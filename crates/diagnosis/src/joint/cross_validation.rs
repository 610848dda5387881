//! Cross-validation of a set of effects: how far it reduces the residuals of touches that were not used to fit.
//!
//! With withheld sessions: coefficients from the fitted ones, only the pose refitted. Without: blocks of touches of one
//! feature at one index, assigned to folds. Prior variances of the effects stay as the whole fit found them. Metres.

use inference::linear::projected_out;
use metrology::statistics::rms;

use super::blocks::BlockPool;
use effects::observation::Row;
use inference::cross_validation::{HeldOut, TouchBlocks};
use inference::gram::{BlockSet, Gram};

use super::rows::Joined;
use super::selection::Rows;
use crate::report::SessionGap;

/// Folds of the blocks.
const FOLDS: usize = 5;
/// Paired gains over blocks must exceed this many standard errors.
const STANDARD_ERRORS: f64 = 2.0;

/// The member without which held-out residuals grow least, where that is by no more than [`STANDARD_ERRORS`]; from the sizes of
/// [`HeldOutEvaluator::without_each`].
pub(super) fn superfluous(judged: &[HeldOutScores]) -> Option<usize> {
    let (whole, reduced) = judged.split_first()?;
    let gains = reduced.iter().map(|without| whole.gain(without));
    gains
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .filter(|&(_, gain)| gain <= STANDARD_ERRORS)
        .map(|(index, _)| index)
}

/// Held-out sizes of one set.
pub(super) struct HeldOutScores {
    pub(super) all: HeldOut,
    sessions: Vec<HeldOut>,
    /// Sum of squares and number of touches of each block.
    blocks: Vec<(f64, f64)>,
}

/// The rows that judge.
pub(super) struct HeldOutEvaluator<'a> {
    rows: &'a Rows<'a>,
    joined: &'a Joined,
    fitted: usize,
    /// Blocks of the rows that judge.
    blocks: TouchBlocks,
    withheld: bool,
}

impl<'a> HeldOutEvaluator<'a> {
    /// Judges by sessions from number `fitted` on where `withheld`, by blocks of the others elsewhere.
    pub(super) fn new(
        rows: &'a Rows<'a>,
        joined: &'a Joined,
        fitted: usize,
        withheld: bool,
    ) -> Self {
        let key = |(index, row): (usize, &Row)| {
            let session = joined.session[index];
            let judges = if withheld {
                session >= fitted
            } else {
                rows.active[index]
            };
            (judges && row.pose.is_some()).then_some((session, row.feature, row.index))
        };
        let blocks = TouchBlocks::new(rows.observations.rows.iter().enumerate().map(key));
        Self {
            rows,
            joined,
            fitted,
            blocks,
            withheld,
        }
    }

    /// Held-out sizes with no effect, the first, the first two, and so on.
    pub(super) fn prefixes(
        &self,
        pool: &BlockPool,
        gram: &Gram,
        set: &BlockSet,
    ) -> Vec<HeldOutScores> {
        let residuals = self.residuals(pool, gram, set);
        residuals
            .iter()
            .map(|residuals| self.size(residuals))
            .collect()
    }

    /// True for a row that judges.
    pub(super) fn judges(&self, row: usize) -> bool {
        self.blocks.block(row).is_some()
    }

    /// Held-out residuals of all rows with no effect, the first, the first two, and so on; only rows that judge count.
    pub(super) fn residuals(&self, pool: &BlockPool, gram: &Gram, set: &BlockSet) -> Vec<Vec<f64>> {
        self.of_fits(set.members.len() + 1, pool, gram, set, |training| {
            self.rows.prefixes(pool, gram, set, training)
        })
    }

    /// Held-out sizes of a set, then without each of its members.
    pub(super) fn without_each(
        &self,
        pool: &BlockPool,
        gram: &Gram,
        set: &BlockSet,
    ) -> Vec<HeldOutScores> {
        let count = set.members.len() + 1;
        let residuals = self.of_fits(count, pool, gram, set, |training| {
            match self.rows.without_each(pool, gram, set, training) {
                Some(fits) => fits.into_iter().map(Some).collect(),
                None => vec![None; count],
            }
        });
        residuals
            .iter()
            .map(|residuals| self.size(residuals))
            .collect()
    }

    /// Held-out residuals of all rows under each of `count` fits to training rows.
    fn of_fits(
        &self,
        count: usize,
        pool: &BlockPool,
        gram: &Gram,
        set: &BlockSet,
        fits: impl Fn(&[bool]) -> Vec<Option<Vec<f64>>>,
    ) -> Vec<Vec<f64>> {
        let (columns, _) = gram.columns(set);
        let mut residuals = vec![self.rows.y.to_vec(); count];
        let folds = if self.withheld { 1 } else { FOLDS };
        for fold in 0..folds {
            let held = |row: usize| {
                self.blocks
                    .block(row)
                    .is_some_and(|block| block % folds == fold)
            };
            let training: Vec<bool> = (0..self.rows.y.len())
                .map(|row| self.rows.active[row] && !held(row))
                .collect();
            for (residuals, mean) in residuals.iter_mut().zip(fits(&training)) {
                let Some(mut mean) = mean else { continue };
                if self.withheld {
                    // Poses of the fitted sessions say nothing of the withheld ones: their own are taken out below.
                    mean[..self.rows.free.len()].fill(0.0);
                }
                let fitted = self.rows.residuals(pool, &columns[..mean.len()], &mean);
                for row in (0..fitted.len()).filter(|&row| held(row)) {
                    residuals[row] = fitted[row];
                }
            }
        }
        if self.withheld {
            for residuals in &mut residuals {
                for pose in &self.joined.poses[self.fitted..] {
                    *residuals = projected_out(std::mem::take(residuals), pose);
                }
            }
        }
        residuals
    }

    fn size(&self, residuals: &[f64]) -> HeldOutScores {
        let mut blocks = vec![(0.0, 0.0); self.blocks.count()];
        let mut sessions = vec![0; self.blocks.count()];
        for (row, residual) in residuals.iter().enumerate() {
            if let Some(block) = self.blocks.block(row) {
                blocks[block].0 += residual * residual;
                blocks[block].1 += 1.0;
                sessions[block] = self.joined.session[row];
            }
        }
        let first = if self.withheld { self.fitted } else { 0 };
        let last = if self.withheld {
            self.joined.sessions
        } else {
            self.fitted
        };
        let of = |session: usize| -> Vec<(f64, f64)> {
            (blocks.iter().zip(&sessions))
                .filter(|&(_, &of)| of == session)
                .map(|(block, _)| *block)
                .collect()
        };
        HeldOutScores {
            all: HeldOut::of_blocks(&blocks),
            sessions: (first..last)
                .map(|session| HeldOut::of_blocks(&of(session)))
                .collect(),
            blocks,
        }
    }
}

impl HeldOutScores {
    /// By how many standard errors of the paired differences of blocks this set leaves smaller residuals than another.
    fn gain(&self, than: &Self) -> f64 {
        let gains: Vec<f64> = (than.blocks.iter().zip(&self.blocks))
            .map(|(before, after)| before.0 - after.0)
            .collect();
        let count = gains.len().max(1) as f64;
        let mean = gains.iter().sum::<f64>() / count;
        let around: Vec<f64> = gains.iter().map(|gain| gain - mean).collect();
        mean / (rms(&around) / count.sqrt()).max(f64::MIN_POSITIVE)
    }

    /// Sizes session by session, with the names of those that judge.
    pub(super) fn of_sessions(&self, before: &Self, names: &[String]) -> Vec<SessionGap> {
        (names.iter().zip(self.sessions.iter().zip(&before.sessions)))
            .map(|(name, (after, before))| SessionGap {
                bag: name.clone(),
                axis: None,
                rms_before: before.rms,
                rms_after: after.rms,
                ci95_after: after.ci95,
            })
            .collect()
    }
}
