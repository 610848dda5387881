//! Cross-validation by blocks: the size of residuals of touches that were not used to fit.
//!
//! A block is a run of touches of one feature at one index; whole blocks are assigned to folds, since neighbouring touches
//! are correlated (Roberts et al. 2017). Coefficients are refitted for each fold, shapes stay. Metres.

use std::collections::BTreeMap;

use metrology::statistics::coverage_factor;

use crate::candidate::Candidate;
use crate::evidence::{Fit, InnerProducts};

/// Number of folds.
const FOLDS: usize = 8;
/// Longest block, touches.
const LONGEST: usize = 8;

/// Blocks of the touches, one number per row; references are not held out and have none.
#[derive(Debug, Clone)]
pub struct TouchBlocks {
    of: Vec<Option<usize>>,
    count: usize,
}

/// Held-out sizes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HeldOut {
    /// Root mean square, m.
    pub rms: f64,
    /// 95 % interval from the scatter between blocks, m.
    pub ci95: [f64; 2],
}

impl TouchBlocks {
    /// Assigns rows to blocks: runs of at most eight rows with the same key; rows without a key are never held out.
    pub fn new<K: Ord>(keys: impl Iterator<Item = Option<K>>) -> Self {
        let mut open: BTreeMap<K, (usize, usize)> = BTreeMap::new();
        let mut count = 0;
        let of = keys
            .map(|key| {
                let block = open.entry(key?).or_insert((usize::MAX, LONGEST));
                if block.1 == LONGEST {
                    *block = (count, 0);
                    count += 1;
                }
                block.1 += 1;
                Some(block.0)
            })
            .collect();
        Self { of, count }
    }

    /// Held-out residuals of a set of candidates; `None` for rows that are never held out.
    ///
    /// `y` are the deviations of all rows, weighted as the blocks of the candidates are, m; the residuals have the same weights.
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
        let parts: Vec<InnerProducts> = (0..=folds)
            .map(|fold| {
                let in_fold: Vec<bool> = (0..y.len())
                    .map(|row| active[row] && fold_of(row) == fold)
                    .collect();
                InnerProducts::new(&blocks, y, &in_fold)
            })
            .collect();
        let fits: Vec<Option<Fit>> = (0..folds)
            .map(|fold| {
                let training = parts.iter().enumerate().filter(|(other, _)| *other != fold);
                InnerProducts::combined(training.map(|(_, part)| part))?.fit(&set)
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

    /// Root mean square of held-out residuals (m; `None`: not held out), and its interval.
    pub fn size(&self, residuals: &[Option<f64>]) -> HeldOut {
        let mut sums = vec![(0.0, 0.0); self.count];
        for (residual, block) in residuals.iter().zip(&self.of) {
            if let (Some(residual), Some(block)) = (residual, block) {
                sums[*block].0 += residual * residual;
                sums[*block].1 += 1.0;
            }
        }
        HeldOut::of_blocks(&sums)
    }

    /// Block of a row; `None` for a row that is never held out.
    pub fn block(&self, row: usize) -> Option<usize> {
        self.of[row]
    }

    /// Number of blocks.
    pub fn count(&self) -> usize {
        self.count
    }
}

impl HeldOut {
    /// The size over blocks, each with its sum of squares (m²) and its number of touches.
    ///
    /// The interval is that of a ratio estimator from the scatter between blocks, with Student's t for one degree of freedom
    /// less than there are blocks; it is never shorter than that of as many independent normal residuals.
    pub fn of_blocks(blocks: &[(f64, f64)]) -> Self {
        let total: f64 = blocks.iter().map(|(_, touches)| touches).sum();
        if total == 0.0 {
            return Self::default();
        }
        let mean = blocks.iter().map(|(sum, _)| sum).sum::<f64>() / total;
        let count = blocks.len() as f64;
        let scatter: f64 = blocks
            .iter()
            .map(|(sum, touches)| (sum - mean * touches).powi(2))
            .sum();
        let independent = coverage_factor(0.95, f64::INFINITY) * mean * (2.0 / total).sqrt();
        let half = if blocks.len() > 1 {
            let between = (scatter * count / (count - 1.0)).sqrt() / total;
            independent.max(coverage_factor(0.95, count - 1.0) * between)
        } else {
            independent
        };
        Self {
            rms: mean.sqrt(),
            ci95: [(mean - half).max(0.0).sqrt(), (mean + half).sqrt()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two blocks of eight touches with mean squares 1 and 3 m²: standard error 1, one degree of freedom, t = 12.706
    /// (GUM table G.2), so that the mean square of 2 lies within 0 and 14.706.
    #[test]
    fn the_interval_of_two_blocks_takes_student_t_of_one_degree_of_freedom() {
        let size = HeldOut::of_blocks(&[(8.0, 8.0), (24.0, 8.0)]);
        assert!((size.rms - 2.0_f64.sqrt()).abs() < 1e-12);
        assert!(
            size.ci95[0] == 0.0 && (size.ci95[1].powi(2) - 14.7062).abs() < 1e-3,
            "{size:?}"
        );
    }

    /// Equal blocks: the interval of independent normal residuals, 1.96·√(2/n) of the mean square.
    #[test]
    fn equal_blocks_give_the_interval_of_independent_residuals() {
        let size = HeldOut::of_blocks(&[(8.0, 8.0); 4]);
        let half = 1.959_964 * (2.0_f64 / 32.0).sqrt();
        assert!((size.ci95[1].powi(2) - 1.0 - half).abs() < 1e-6, "{size:?}");
        let single = HeldOut::of_blocks(&[(8.0, 8.0)]);
        assert!(single.ci95[1].is_finite() && single.ci95[0] < 1.0);
    }
}
