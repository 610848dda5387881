//! How far the gap shrinks on touches that were not used to fit: blocks held out by feature, index and time.
//!
//! A block is a run of touches of one feature at one index; blocks are dealt to folds so that each fold leaves whole
//! blocks out. Coefficients are refitted for each fold, shapes stay. Metres.

use std::collections::BTreeMap;

use crate::candidate::Candidate;
use crate::evidence::{Fit, Products};
use crate::observation::Observations;

/// Number of folds.
const FOLDS: usize = 8;
/// Longest block, touches.
const LONGEST: usize = 8;

/// Blocks of the touches, one number per row; references are not held out and have none.
#[derive(Debug, Clone)]
pub struct Blocks {
    of: Vec<Option<usize>>,
    count: usize,
}

/// Held-out sizes.
#[derive(Debug, Clone, Copy)]
pub struct HeldOut {
    /// Root mean square, m.
    pub rms: f64,
    /// 95 % interval from the scatter between blocks.
    pub ci95: [f64; 2],
}

impl Blocks {
    /// Divides the active touches.
    pub fn new(observations: &Observations, active: &[bool]) -> Self {
        let mut open: BTreeMap<(usize, usize), (usize, usize)> = BTreeMap::new();
        let mut count = 0;
        let of = observations
            .rows
            .iter()
            .zip(active)
            .map(|(row, &used)| {
                if !used || row.pose.is_none() {
                    return None;
                }
                let block = open
                    .entry((row.feature, row.index))
                    .or_insert((usize::MAX, 0));
                if block.0 == usize::MAX || block.1 == LONGEST {
                    *block = (count, 0);
                    count += 1;
                }
                block.1 += 1;
                Some(block.0)
            })
            .collect();
        Self { of, count }
    }

    /// Held-out residuals of a set of candidates; `None` rows were not judged.
    pub fn residuals(
        &self,
        candidates: &[&Candidate],
        y: &[f64],
        active: &[bool],
    ) -> Vec<Option<f64>> {
        let mut residuals = vec![None; y.len()];
        let folds = FOLDS.min(self.count).max(1);
        let blocks: Vec<&[Vec<f64>]> = candidates
            .iter()
            .map(|candidate| candidate.block.as_slice())
            .collect();
        let set: Vec<usize> = (0..candidates.len()).collect();
        let fold_of = |row: usize| self.of[row].map_or(folds, |block| block % folds);
        // References are in no fold: they always train.
        let parts: Vec<Products> = (0..=folds)
            .map(|fold| {
                let own: Vec<bool> = (0..y.len())
                    .map(|row| active[row] && fold_of(row) == fold)
                    .collect();
                Products::new(&blocks, y, &own)
            })
            .collect();
        let fits: Vec<Option<Fit>> = (0..folds)
            .map(|fold| {
                let training = parts.iter().enumerate().filter(|(own, _)| *own != fold);
                Products::together(training.map(|(_, part)| part))?.fit(&set)
            })
            .collect();
        for row in 0..y.len() {
            let Some(fit) = fits.get(fold_of(row)) else {
                continue;
            };
            let columns = candidates.iter().flat_map(|candidate| &candidate.block);
            let predicted: f64 = fit.as_ref().map_or(0.0, |fit| {
                columns
                    .zip(&fit.coefficients)
                    .map(|(column, coefficient)| column[row] * coefficient)
                    .sum()
            });
            residuals[row] = Some(y[row] - predicted);
        }
        residuals
    }

    /// Size of held-out residuals and its interval.
    pub fn size(&self, residuals: &[Option<f64>]) -> HeldOut {
        let mut sums = vec![(0.0, 0.0); self.count];
        for (residual, block) in residuals.iter().zip(&self.of) {
            if let (Some(residual), Some(block)) = (residual, block) {
                sums[*block].0 += residual * residual;
                sums[*block].1 += 1.0;
            }
        }
        let total: f64 = sums.iter().map(|(_, touches)| touches).sum();
        if total == 0.0 {
            return HeldOut {
                rms: 0.0,
                ci95: [0.0, 0.0],
            };
        }
        let mean = sums.iter().map(|(sum, _)| sum).sum::<f64>() / total;
        let count = self.count as f64;
        let scatter: f64 = sums
            .iter()
            .map(|(sum, touches)| (sum - mean * touches).powi(2))
            .sum();
        let between = (scatter * count / (count - 1.0).max(1.0)).sqrt() / total;
        let spread = 1.96 * between.max(mean * (2.0 / total).sqrt());
        HeldOut {
            rms: mean.sqrt(),
            ci95: [(mean - spread).max(0.0).sqrt(), (mean + spread).sqrt()],
        }
    }
}
