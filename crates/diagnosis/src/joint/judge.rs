//! How far a growing set shrinks the gap on touches that were not used to fit.
//!
//! With withheld sessions: coefficients from the fitted ones, only the pose refitted. Without: blocks of touches of one
//! feature at one index, dealt to folds. Sizes of the effects stay as the whole fit found them. Metres.

use std::collections::BTreeMap;

use super::gram::{Gram, Set, rms};
use super::grow::Rows;
use super::linear::without;
use super::pool::Pool;
use super::rows::Joined;
use crate::report::OfSession;

/// Folds of the blocks.
const FOLDS: usize = 5;
/// Longest block, touches.
const LONGEST: usize = 8;
/// Paired gains over blocks must exceed this many standard errors.
const SURE: f64 = 2.0;

/// A held-out size with its 95 % interval from the scatter between blocks.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Size {
    pub(super) rms: f64,
    pub(super) ci95: [f64; 2],
}

/// Held-out sizes of one set.
pub(super) struct Judged {
    pub(super) all: Size,
    sessions: Vec<Size>,
    /// Sum of squares and number of touches of each block.
    blocks: Vec<(f64, f64)>,
}

/// The rows that judge.
pub(super) struct Judge<'a> {
    rows: &'a Rows<'a>,
    joined: &'a Joined,
    fitted: usize,
    /// Block of each row that judges.
    blocks: Vec<Option<usize>>,
    count: usize,
    withheld: bool,
}

impl<'a> Judge<'a> {
    /// Judges by sessions from number `fitted` on where `withheld`, by blocks of the others elsewhere.
    pub(super) fn new(
        rows: &'a Rows<'a>,
        joined: &'a Joined,
        fitted: usize,
        withheld: bool,
    ) -> Self {
        let mut open: BTreeMap<(usize, usize, usize), (usize, usize)> = BTreeMap::new();
        let mut count = 0;
        let blocks = (rows.observations.rows.iter().enumerate())
            .map(|(place, row)| {
                let session = joined.session[place];
                let judges = if withheld {
                    session >= fitted
                } else {
                    rows.active[place]
                };
                if !judges || row.pose.is_none() {
                    return None;
                }
                let block = open
                    .entry((session, row.feature, row.index))
                    .or_insert((usize::MAX, LONGEST));
                if block.1 == LONGEST {
                    *block = (count, 0);
                    count += 1;
                }
                block.1 += 1;
                Some(block.0)
            })
            .collect();
        Self {
            rows,
            joined,
            fitted,
            blocks,
            count,
            withheld,
        }
    }

    /// Held-out sizes with no effect, the first, the first two, and so on.
    pub(super) fn prefixes(&self, pool: &Pool, gram: &Gram, set: &Set) -> Vec<Judged> {
        let left = self.left(pool, gram, set);
        left.iter().map(|left| self.size(left)).collect()
    }

    /// True for a row that judges.
    pub(super) fn judges(&self, row: usize) -> bool {
        self.blocks[row].is_some()
    }

    /// Held-out residuals of all rows with no effect, the first, the first two, and so on; only rows that judge count.
    pub(super) fn left(&self, pool: &Pool, gram: &Gram, set: &Set) -> Vec<Vec<f64>> {
        let (columns, _) = gram.columns(set);
        let mut left = vec![self.rows.y.to_vec(); set.members.len() + 1];
        let folds = if self.withheld { 1 } else { FOLDS };
        for fold in 0..folds {
            let held = |row: usize| self.blocks[row].is_some_and(|block| block % folds == fold);
            let training: Vec<bool> = (0..self.blocks.len())
                .map(|row| self.rows.active[row] && !held(row))
                .collect();
            let fits = self.rows.prefixes(pool, gram, set, &training);
            for (left, mean) in left.iter_mut().zip(fits) {
                let Some(mut mean) = mean else { continue };
                if self.withheld {
                    // Poses of the fitted sessions say nothing of the withheld ones: their own are taken out below.
                    mean[..self.rows.free.len()].fill(0.0);
                }
                let own = self.rows.left(pool, &columns[..mean.len()], &mean);
                for row in (0..own.len()).filter(|&row| held(row)) {
                    left[row] = own[row];
                }
            }
        }
        if self.withheld {
            for left in &mut left {
                for pose in &self.joined.poses[self.fitted..] {
                    *left = without(std::mem::take(left), pose);
                }
            }
        }
        left
    }

    fn size(&self, left: &[f64]) -> Judged {
        let mut blocks = vec![(0.0, 0.0); self.count];
        let mut sessions = vec![0; self.count];
        for (row, block) in self.blocks.iter().enumerate() {
            if let Some(block) = *block {
                blocks[block].0 += left[row] * left[row];
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
        Judged {
            all: interval(&blocks),
            sessions: (first..last)
                .map(|session| interval(&of(session)))
                .collect(),
            blocks,
        }
    }
}

impl Judged {
    /// True when blocks agree that this set leaves less than another.
    pub(super) fn better(&self, than: &Self) -> bool {
        let gains: Vec<f64> = (than.blocks.iter().zip(&self.blocks))
            .map(|(before, after)| before.0 - after.0)
            .collect();
        let count = gains.len() as f64;
        let mean = gains.iter().sum::<f64>() / count.max(1.0);
        let around: Vec<f64> = gains.iter().map(|gain| gain - mean).collect();
        mean > SURE * rms(&around) / count.max(1.0).sqrt()
    }

    /// Sizes session by session, with the names of those that judge.
    pub(super) fn of_sessions(&self, before: &Self, names: &[String]) -> Vec<OfSession> {
        (names.iter().zip(self.sessions.iter().zip(&before.sessions)))
            .map(|(name, (after, before))| OfSession {
                bag: name.clone(),
                axis: None,
                rms_before: before.rms,
                rms_after: after.rms,
                ci95_after: after.ci95,
            })
            .collect()
    }
}

fn interval(blocks: &[(f64, f64)]) -> Size {
    let total: f64 = blocks.iter().map(|(_, touches)| touches).sum();
    if total == 0.0 {
        return Size::default();
    }
    let mean = blocks.iter().map(|(sum, _)| sum).sum::<f64>() / total;
    let count = blocks.len() as f64;
    let scatter: f64 = (blocks.iter())
        .map(|(sum, touches)| (sum - mean * touches).powi(2))
        .sum();
    let between = (scatter * count / (count - 1.0).max(1.0)).sqrt() / total;
    let half = 1.96 * between.max(mean * (2.0 / total).sqrt());
    Size {
        rms: mean.sqrt(),
        ci95: [(mean - half).max(0.0).sqrt(), (mean + half).sqrt()],
    }
}
