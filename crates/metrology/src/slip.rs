//! Decides which of repeatedly measured positions are corrupted by slip, transiently or persistently.
//!
//! Lengths in m. `docs/source_systems.md, C.5`. A *transient* slip is a reading more than six scales from the median
//! of its position, in a minority of the repeats; a *persistent* displacement is a position whose median differs from
//! the median of its four neighbours by more than a limit. Flagged positions are to be left out of straightness and
//! reported as events of the machine. The scale is the largest of the position's own 1.4826·MAD, that of all
//! positions pooled and the resolution: the own scale of five repeats alone would flag good readings by chance.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::statistics::{MAD_FACTOR, median, robust_deviation};

/// Rules of the detection.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlipRules {
    /// Scales beyond which a reading is a transient slip.
    pub scales: f64,
    /// Difference in m from the neighbours beyond which a position is displaced for good.
    pub persistent: f64,
    /// Smallest scale in m: the resolution of the readings.
    pub resolution: f64,
}

impl Default for SlipRules {
    /// The source's: six scales, 1 mm, resolution 1 µm.
    fn default() -> Self {
        Self {
            scales: 6.0,
            persistent: 1e-3,
            resolution: 1e-6,
        }
    }
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Slips {
    /// `(repeat, position, displacement in m)` of each transient slip, by repeat then position.
    pub transient: Vec<(usize, usize, f64)>,
    /// `(position, displacement in m)` of each persistent one.
    pub persistent: Vec<(usize, f64)>,
    /// Median over the repeats of each position, transient slips left out, m.
    pub medians: Vec<f64>,
}

impl Slips {
    /// Positions free of persistent displacement, with their medians: what straightness may be judged on.
    pub fn sound(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let displaced = |p: &usize| self.persistent.iter().any(|(q, _)| q == p);
        self.medians
            .iter()
            .copied()
            .enumerate()
            .filter(move |(p, _)| !displaced(p))
    }
}

/// Repeats that cannot be examined.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum SlipError {
    /// Fewer than three repeats.
    #[error("slip shows only over 3 or more repeats, {0} given")]
    TooFewRepeats(usize),
    /// Repeats of different length.
    #[error("repeat {0} has a different number of positions")]
    Length(usize),
    /// A reading is NaN or infinite.
    #[error("repeat {0}, position {1} is not a number")]
    NotFinite(usize, usize),
}

/// Applies the rules to `repeats`, each the readings (m) at the same positions.
///
/// # Errors
/// See [`SlipError`].
pub fn find_slips(repeats: &[Vec<f64>], rules: &SlipRules) -> Result<Slips, SlipError> {
    if repeats.len() < 3 {
        return Err(SlipError::TooFewRepeats(repeats.len()));
    }
    let positions = repeats[0].len();
    for (r, repeat) in repeats.iter().enumerate() {
        if repeat.len() != positions {
            return Err(SlipError::Length(r));
        }
        if let Some(p) = repeat.iter().position(|v| !v.is_finite()) {
            return Err(SlipError::NotFinite(r, p));
        }
    }
    let column = |p: usize| -> Vec<f64> { repeats.iter().map(|r| r[p]).collect() };
    let mut slips = Slips {
        medians: (0..positions).map(|p| median(&column(p))).collect(),
        ..Slips::default()
    };
    // Over a flat sample the pooled scale is zero; the resolution then is the scale.
    let pooled = pooled_deviation(repeats).max(rules.resolution);
    for p in 0..positions {
        let readings = column(p);
        let scale = robust_deviation(&readings, slips.medians[p]).max(pooled);
        let far = |v: f64| (v - slips.medians[p]).abs() > rules.scales * scale;
        let count = readings.iter().filter(|v| far(**v)).count();
        if count == 0 || 2 * count >= readings.len() {
            continue;
        }
        let kept: Vec<f64> = readings.iter().copied().filter(|v| !far(*v)).collect();
        let beyond = readings.iter().enumerate().filter(|(_, v)| far(**v));
        let found: Vec<(usize, usize, f64)> =
            beyond.map(|(r, v)| (r, p, v - slips.medians[p])).collect();
        slips.transient.extend(found);
        slips.medians[p] = median(&kept);
    }
    slips.transient.sort_by_key(|(r, p, _)| (*r, *p));
    slips.persistent = persistent(&slips.medians, rules.persistent);
    Ok(slips)
}

/// Standard deviation of one reading in m from the median difference between two repeats at the same position, which,
/// unlike residuals from a median of few, is not too small.
fn pooled_deviation(repeats: &[Vec<f64>]) -> f64 {
    let differences: Vec<f64> = repeats
        .iter()
        .enumerate()
        .flat_map(|(i, a)| repeats[..i].iter().map(move |b| (a, b)))
        .flat_map(|(a, b)| a.iter().zip(b).map(|(x, y)| (x - y).abs()))
        .collect();
    if differences.is_empty() {
        return 0.0;
    }
    MAD_FACTOR * median(&differences) / 2.0_f64.sqrt()
}

/// Positions whose value differs by more than `limit` from the median of the four nearest others.
fn persistent(medians: &[f64], limit: f64) -> Vec<(usize, f64)> {
    let n = medians.len();
    if n < 5 {
        return Vec::new();
    }
    (0..n)
        .filter_map(|p| {
            let start = p.saturating_sub(2).min(n - 5);
            let around: Vec<f64> = (start..start + 5)
                .filter(|q| *q != p)
                .map(|q| medians[q])
                .collect();
            let displacement = medians[p] - median(&around);
            (displacement.abs() > limit).then_some((p, displacement))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64;

    /// C.5, the bore: 11 points every 100 mm, 5 repeats within ±1 mm, 5 mm at 300.
    fn bore(rng: &mut Pcg64) -> Vec<Vec<f64>> {
        let noise = Normal::new(0.0, 0.05e-3).unwrap();
        let form: Vec<f64> = (0..11).map(|_| rng.random_range(-0.4e-3..0.4e-3)).collect();
        (0..5)
            .map(|_| form.iter().map(|f| f + noise.sample(rng)).collect())
            .collect()
    }

    #[test]
    fn a_jump_in_one_repeat_is_transient_and_flags_exactly_that_reading() {
        let mut rng = Pcg64::seed_from_u64(3);
        for _ in 0..500 {
            let mut repeats = bore(&mut rng);
            let repeat = rng.random_range(0..5);
            repeats[repeat][3] += 5e-3;
            let slips = find_slips(&repeats, &SlipRules::default()).unwrap();
            let found: Vec<(usize, usize)> =
                slips.transient.iter().map(|(r, p, _)| (*r, *p)).collect();
            assert_eq!(found, [(repeat, 3)]);
            assert!((slips.transient[0].2 - 5e-3).abs() < 0.3e-3);
            assert!(slips.persistent.is_empty());
            assert!(slips.medians[3].abs() < 0.6e-3);
        }
    }

    #[test]
    fn a_jump_in_all_repeats_is_persistent_and_flags_exactly_that_position() {
        let mut rng = Pcg64::seed_from_u64(4);
        for position in (0..11).cycle().take(500) {
            let mut repeats = bore(&mut rng);
            for repeat in &mut repeats {
                repeat[position] += 5e-3;
            }
            let slips = find_slips(&repeats, &SlipRules::default()).unwrap();
            assert!(slips.transient.is_empty());
            let found: Vec<usize> = slips.persistent.iter().map(|(p, _)| *p).collect();
            assert_eq!(found, [position]);
            assert_eq!(slips.sound().count(), 10);
        }
    }

    #[test]
    fn clean_repeats_flag_nothing() {
        let mut rng = Pcg64::seed_from_u64(5);
        let flagged = (0..2000)
            .filter(|_| {
                let slips = find_slips(&bore(&mut rng), &SlipRules::default()).unwrap();
                !slips.transient.is_empty() || !slips.persistent.is_empty()
            })
            .count();
        // Six scales of a normal distribution, the scale itself known to a few per cent.
        assert!(flagged <= 2, "{flagged}");
    }

    #[test]
    fn identical_repeats_and_bad_input() {
        let same = vec![vec![0.0, 1e-6, 2e-6, 1e-6, 0.0, 1e-6]; 4];
        let slips = find_slips(&same, &SlipRules::default()).unwrap();
        assert!(slips.transient.is_empty() && slips.persistent.is_empty());
        assert_eq!(
            find_slips(&same[..2], &SlipRules::default()),
            Err(SlipError::TooFewRepeats(2))
        );
        let mut uneven = same.clone();
        uneven[1].pop();
        assert_eq!(
            find_slips(&uneven, &SlipRules::default()),
            Err(SlipError::Length(1))
        );
        let mut broken = same;
        broken[2][4] = f64::NAN;
        assert_eq!(
            find_slips(&broken, &SlipRules::default()),
            Err(SlipError::NotFinite(2, 4))
        );
    }
}
