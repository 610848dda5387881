//! Effects that a session cannot tell apart: who else could stand in an effect's place.
//!
//! Another effect is indistinguishable when, beside the rest of the set, it reproduces the effect's fitted signature to
//! within half the noise, or when the posterior with it in place is not much lower. Names, not signatures, come out.

use std::collections::BTreeSet;

use crate::attribution::Attribution;
use crate::candidate::Candidate;
use crate::evidence::{add_scaled, dot};
use crate::pool::{Shapes, Trial, orthonormal, remove};

/// Two signatures closer than this share of the noise are the same.
const HALF: f64 = 0.5;
/// A replacement this much (natural log) less probable is not excluded.
const NOT_EXCLUDED: f64 = 4.6;
/// Trials of a shape that are compared with a signature.
const TRIALS: usize = 160;

/// Who else could stand in an effect's place.
#[derive(Debug, Clone)]
pub(crate) struct Equals {
    /// Effects, in the order of the library.
    pub(crate) names: Vec<String>,
    /// True where the rest of the set reproduces the effect to within half the noise.
    pub(crate) replaceable: bool,
}

/// Effects that could stand in the place of `member` of a set, in the order of the library.
pub(crate) fn indistinguishable(
    shapes: &Shapes<'_>,
    attribution: &Attribution,
    set: &[usize],
    member: usize,
    coefficients: &[f64],
    noise: f64,
) -> Equals {
    let variants = shapes.variants;
    let own = &variants[attribution.candidates[member].variant].effect;
    let others: Vec<usize> = set
        .iter()
        .copied()
        .filter(|&other| other != member)
        .collect();
    let taken: BTreeSet<&str> = others
        .iter()
        .map(|&other| {
            variants[attribution.candidates[other].variant]
                .effect
                .as_str()
        })
        .collect();
    let mut found: BTreeSet<&str> = BTreeSet::new();
    for alias in &attribution.aliases[member] {
        found.insert(&variants[alias.variant].effect);
    }
    let seen = |column: &[f64]| -> Vec<f64> {
        (shapes.sample.iter())
            .map(|&row| {
                if attribution.active[row] {
                    column[row]
                } else {
                    0.0
                }
            })
            .collect()
    };
    let basis = orthonormal(
        others
            .iter()
            .flat_map(|&other| &attribution.candidates[other].block)
            .map(|column| seen(column)),
    );
    let mut left = seen(&signature(&attribution.candidates[member], coefficients));
    remove(&mut left, &basis);
    let power = dot(&left, &left);
    let bound = (HALF * noise).powi(2) * left.len() as f64;
    let out: Vec<usize> = (0..left.len())
        .filter(|&place| !attribution.active[shapes.sample[place]])
        .collect();
    let close = |trial: &Trial| power - trial.gain(&basis, &left, &out) <= bound;
    // Where the others can do it alone, anything can: only the posterior tells who else is meant.
    let replaceable = power <= bound;
    for (place, candidate) in attribution.candidates.iter().enumerate() {
        if replaceable {
            break;
        }
        let block = candidate.block.iter().map(|column| seen(column)).collect();
        if place != member && close(&Trial::new(candidate.shape, block)) {
            found.insert(variants[candidate.variant].effect.as_str());
            found.extend(
                attribution.aliases[place]
                    .iter()
                    .map(|alias| variants[alias.variant].effect.as_str()),
            );
        }
    }
    for (place, variant) in variants.iter().enumerate() {
        if replaceable || found.contains(variant.effect.as_str()) {
            continue;
        }
        let trials = shapes.trials(place);
        let stride = trials.len().div_ceil(TRIALS).max(1);
        if trials.iter().step_by(stride).any(close) {
            found.insert(&variant.effect);
        }
    }
    let best = attribution
        .models
        .iter()
        .filter(|model| model.rival.is_none())
        .find(|model| model.set == set);
    if let Some(best) = best {
        for model in attribution
            .models
            .iter()
            .filter(|model| model.rival.is_none())
        {
            let swapped = model.set.len() <= set.len()
                && !model.set.contains(&member)
                && others.iter().all(|other| model.set.contains(other))
                && model.set.len() == set.len()
                && model.score > best.score - NOT_EXCLUDED;
            if let (true, Some(&new)) = (
                swapped,
                model
                    .set
                    .iter()
                    .find(|candidate| !others.contains(candidate)),
            ) {
                found.insert(&variants[attribution.candidates[new].variant].effect);
                found.extend(
                    attribution.aliases[new]
                        .iter()
                        .map(|alias| variants[alias.variant].effect.as_str()),
                );
            }
        }
    }
    found.remove(own.as_str());
    let mut names: Vec<String> = Vec::new();
    for variant in variants {
        if found.contains(variant.effect.as_str())
            && !taken.contains(variant.effect.as_str())
            && !names.contains(&variant.effect)
        {
            names.push(variant.effect.clone());
        }
    }
    Equals { names, replaceable }
}

/// What a candidate adds to the weighted deviations.
pub fn signature(candidate: &Candidate, coefficients: &[f64]) -> Vec<f64> {
    let mut signature = vec![0.0; candidate.block.first().map_or(0, Vec::len)];
    for (column, coefficient) in candidate.block.iter().zip(coefficients) {
        add_scaled(&mut signature, *coefficient, column);
    }
    signature
}
