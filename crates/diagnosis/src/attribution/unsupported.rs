//! Rejects effects that raise the evidence but fail cross-validation or cancel one another.
//!
//! Neither test assumes a typical size. An effect that does not reduce the residuals of touches that were not used to fit it
//! is not supported. And three or more effects that cancel one another over a good part of their energy stand for one cause
//! outside the library: that independent effects have just these sizes would be a coincidence for every feature where they
//! cancel. Two effects that cancel are kept: location errors of one axis do so by nature. Metres.

use std::collections::BTreeMap;

use super::blocks;
use effects::observation::Observations;
use inference::candidate::Candidate;
use inference::posterior::ModelPosterior;

/// An effect is supported when the held-out rms without it is larger at least by this share, in a usual session.
const SHRINKS: f64 = 0.1;
/// Touches of a usual session; over more of them a smaller share is as well supported.
const USUAL: f64 = 120.0;
/// Least share, whatever the number of touches: errors of thousands of touches are never quite independent.
const LEAST: f64 = 0.01;
/// Fewest effects that cancel one another for one unknown cause.
const FEWEST: usize = 3;
/// Share of the energy of its effects over which such a group cancels.
const CANCELLED: f64 = 1.0 / 3.0;
/// Effects cancel on a feature at an index when their root sum of squares together is below this many times the noise.
const SILENT: f64 = 3.0;
/// And below this share of the energy that they have alone.
const ALONE: f64 = 0.1;

/// Members of a set (ascending, not empty) that are unsupported; `noise` in m.
pub(crate) fn unsupported_effects(
    observations: &Observations,
    attribution: &ModelPosterior,
    set: &[usize],
    noise: f64,
) -> Vec<usize> {
    let mut unsupported = not_cross_validated(observations, attribution, set);
    unsupported.extend(cancelling(observations, attribution, set, noise));
    unsupported.sort_unstable();
    unsupported.dedup();
    unsupported
}

/// Share by which the held-out rms must be larger without an effect that is supported.
pub(crate) fn least_share(attribution: &ModelPosterior) -> f64 {
    let touches = attribution.active.iter().filter(|&&used| used).count() as f64;
    (SHRINKS * (USUAL / touches).min(1.0)).max(LEAST)
}

/// Members without which held-out touches are predicted as well, the least supported first.
fn not_cross_validated(
    observations: &Observations,
    attribution: &ModelPosterior,
    set: &[usize],
) -> Vec<usize> {
    let blocks = blocks(observations, &attribution.active);
    let held_out = |set: &[usize]| {
        let candidates: Vec<&Candidate> = (set.iter())
            .map(|&member| &attribution.candidates[member])
            .collect();
        let residuals = blocks.residuals(&candidates, &attribution.y, &attribution.active);
        blocks.size(&residuals).rms
    };
    let share = least_share(attribution);
    let mut kept = set.to_vec();
    let mut found = Vec::new();
    let mut with = held_out(&kept);
    while !kept.is_empty() {
        let without = |index: usize| {
            let mut rest = kept.clone();
            rest.remove(index);
            held_out(&rest)
        };
        let least = (0..kept.len())
            .map(|index| (without(index), index))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match least {
            Some((rms, index)) if rms < (1.0 + share) * with => {
                found.push(kept.remove(index));
                with = rms;
            }
            _ => break,
        }
    }
    found
}

/// Members of a group that cancel one another.
fn cancelling(
    observations: &Observations,
    attribution: &ModelPosterior,
    set: &[usize],
    noise: f64,
) -> Vec<usize> {
    if set.len() < FEWEST {
        return Vec::new();
    }
    let Some(fit) = attribution.products.fit(set) else {
        return Vec::new();
    };
    let mut start = 0;
    let mut alone: Vec<Vec<f64>> = Vec::with_capacity(set.len());
    for &member in set {
        let candidate = &attribution.candidates[member];
        let coefficients = &fit.coefficients[start..start + candidate.block.len()];
        start += candidate.block.len();
        alone.push(candidate.signature(coefficients));
    }
    let mut features: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (index, row) in observations.rows.iter().enumerate() {
        features
            .entry((row.feature, row.index))
            .or_default()
            .push(index);
    }
    let power =
        |values: &[f64], rows: &[usize]| rows.iter().map(|&row| values[row].powi(2)).sum::<f64>();
    let (mut silent, mut all) = (vec![0.0; set.len()], vec![0.0; set.len()]);
    for rows in features.values() {
        let together: f64 = (rows.iter())
            .map(|&row| {
                alone
                    .iter()
                    .map(|signature| signature[row])
                    .sum::<f64>()
                    .powi(2)
            })
            .sum();
        let energies: Vec<f64> = (alone.iter())
            .map(|signature| power(signature, rows))
            .collect();
        let cancelled =
            together < (SILENT * noise).powi(2) && together < ALONE * energies.iter().sum::<f64>();
        for (index, energy) in energies.into_iter().enumerate() {
            all[index] += energy;
            silent[index] += if cancelled { energy } else { 0.0 };
        }
    }
    if silent.iter().sum::<f64>() < CANCELLED * all.iter().sum::<f64>() {
        return Vec::new();
    }
    let members: Vec<usize> = (0..set.len())
        .filter(|&index| silent[index] > CANCELLED * all[index])
        .map(|index| set[index])
        .collect();
    if members.len() < FEWEST {
        return Vec::new();
    }
    members
}
