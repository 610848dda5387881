//! Which effects of the best explanation are doubted although the evidence is for them: something else hides behind.
//!
//! Two signs, both without a size that is taken for typical. An effect that does not shrink the gap on touches that were
//! not used to fit it explains something that is not in the touches. And three or more effects that undo one another
//! over a good part of what they do stand for one cause that is not in the library: that independent effects have just
//! these sizes would be a coincidence for every feature that stays silent. Two effects that undo one another are left
//! alone: location errors of one axis do so by nature. Metres.

use std::collections::BTreeMap;

use crate::attribution::Attribution;
use crate::candidate::Candidate;
use crate::groups::signature;
use crate::observation::Observations;
use crate::shrinkage::Blocks;

/// An effect is supported when without it the held-out rms is so many times as large.
const SHRINKS: f64 = 1.1;
/// Fewest effects that make a crowd.
const CROWD: usize = 3;
/// A crowd undoes itself over this share of what its effects do alone.
const UNDONE: f64 = 1.0 / 3.0;
/// A feature at an index is silent when the effects together add less than this, in root sum of squares over the noise.
const SILENT: f64 = 3.0;
/// And less than this share of the power that they add alone.
const ALONE: f64 = 0.1;

/// Members of a set (ascending, not empty) that are doubted; `noise` in m.
pub(crate) fn doubted(
    observations: &Observations,
    attribution: &Attribution,
    set: &[usize],
    noise: f64,
) -> Vec<usize> {
    let mut doubted = unsupported(observations, attribution, set);
    doubted.extend(crowd(observations, attribution, set, noise));
    doubted.sort_unstable();
    doubted.dedup();
    doubted
}

/// Members without which the touches that were not used to fit are met as well, the least supported first.
fn unsupported(
    observations: &Observations,
    attribution: &Attribution,
    set: &[usize],
) -> Vec<usize> {
    let blocks = Blocks::new(observations, &attribution.active);
    let held_out = |set: &[usize]| {
        let candidates: Vec<&Candidate> = (set.iter())
            .map(|&member| &attribution.candidates[member])
            .collect();
        let left = blocks.residuals(&candidates, &attribution.y, &attribution.active);
        blocks.size(&left).rms
    };
    let mut kept = set.to_vec();
    let mut found = Vec::new();
    let mut with = held_out(&kept);
    while !kept.is_empty() {
        let without = |place: usize| {
            let mut rest = kept.clone();
            rest.remove(place);
            held_out(&rest)
        };
        let least = (0..kept.len())
            .map(|place| (without(place), place))
            .min_by(|one, other| one.0.total_cmp(&other.0));
        match least {
            Some((rms, place)) if rms < SHRINKS * with => {
                found.push(kept.remove(place));
                with = rms;
            }
            _ => break,
        }
    }
    found
}

/// Members of a crowd that undo one another.
fn crowd(
    observations: &Observations,
    attribution: &Attribution,
    set: &[usize],
    noise: f64,
) -> Vec<usize> {
    if set.len() < CROWD {
        return Vec::new();
    }
    let Some(fit) = attribution.products.fit(set) else {
        return Vec::new();
    };
    let mut start = 0;
    let mut alone: Vec<Vec<f64>> = Vec::with_capacity(set.len());
    for &member in set {
        let candidate = &attribution.candidates[member];
        let own = &fit.coefficients[start..start + candidate.block.len()];
        start += candidate.block.len();
        alone.push(signature(candidate, own));
    }
    let mut features: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (place, row) in observations.rows.iter().enumerate() {
        features
            .entry((row.feature, row.index))
            .or_default()
            .push(place);
    }
    let power =
        |values: &[f64], rows: &[usize]| rows.iter().map(|&row| values[row].powi(2)).sum::<f64>();
    let (mut silent, mut all) = (vec![0.0; set.len()], vec![0.0; set.len()]);
    for rows in features.values() {
        let together: f64 = (rows.iter())
            .map(|&row| alone.iter().map(|own| own[row]).sum::<f64>().powi(2))
            .sum();
        let own: Vec<f64> = alone.iter().map(|own| power(own, rows)).collect();
        let undone =
            together < (SILENT * noise).powi(2) && together < ALONE * own.iter().sum::<f64>();
        for (place, own) in own.into_iter().enumerate() {
            all[place] += own;
            silent[place] += if undone { own } else { 0.0 };
        }
    }
    if silent.iter().sum::<f64>() < UNDONE * all.iter().sum::<f64>() {
        return Vec::new();
    }
    let members: Vec<usize> = (0..set.len())
        .filter(|&place| silent[place] > UNDONE * all[place])
        .map(|place| set[place])
        .collect();
    if members.len() < CROWD {
        return Vec::new();
    }
    members
}
