//! Effects that a session cannot tell apart: who else could stand in an effect's place.
//!
//! Another effect is indistinguishable when, beside the rest of the set, it reproduces the effect's fitted signature to
//! within half the noise, or when the posterior with it in place is not much lower. Names, not signatures, come out.

use std::collections::BTreeSet;

use crate::attribution::Attribution;
use crate::candidate::Candidate;
use crate::effects::Variant;
use crate::evidence::{add_scaled, dot};
use crate::observation::Observations;

/// Two signatures closer than this share of the noise are the same.
const HALF: f64 = 0.5;
/// A replacement this much (natural log) less probable is not excluded.
const NOT_EXCLUDED: f64 = 4.6;
/// Rows of a usual session; longer ones get fewer trials.
const USUAL: usize = 400;
/// Trials of a shape that are compared with a signature.
const TRIALS: usize = 160;

/// Effects that could stand in the place of `member` of a set, in the order of the library.
pub fn indistinguishable(
    observations: &Observations,
    variants: &[Variant],
    attribution: &Attribution,
    set: &[usize],
    member: usize,
    coefficients: &[f64],
    noise: f64,
) -> Vec<String> {
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
    for &alias in &attribution.aliases[member] {
        found.insert(&variants[alias].effect);
    }
    let signature = signature(&attribution.candidates[member], coefficients);
    let basis = orthonormal(
        others
            .iter()
            .flat_map(|&other| attribution.candidates[other].block.iter()),
    );
    let left = without(&signature, &basis);
    let bound = (HALF * noise).powi(2) * signature.len() as f64;
    let close = |columns: &[Vec<f64>]| {
        let own = orthonormal(basis.iter().chain(columns));
        let rest = without(&left, &own);
        dot(&rest, &rest) <= bound
    };
    for (place, candidate) in attribution.candidates.iter().enumerate() {
        let effect = variants[candidate.variant].effect.as_str();
        if place != member && close(&candidate.block) {
            found.insert(effect);
            found.extend(
                attribution.aliases[place]
                    .iter()
                    .map(|&alias| variants[alias].effect.as_str()),
            );
        }
    }
    for (place, variant) in variants.iter().enumerate() {
        let Some(shape) = variant
            .shape
            .as_ref()
            .filter(|_| !found.contains(variant.effect.as_str()))
        else {
            continue;
        };
        let most = (TRIALS * USUAL / observations.rows.len().max(USUAL)).max(12);
        let stride = shape.trials.len().div_ceil(most);
        let fits = shape.trials.iter().step_by(stride).any(|&value| {
            Candidate::new(observations, variants, place, value)
                .is_some_and(|candidate| close(&candidate.block))
        });
        if fits {
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
                        .map(|&alias| variants[alias].effect.as_str()),
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
    names
}

/// What a candidate adds to the weighted deviations.
pub fn signature(candidate: &Candidate, coefficients: &[f64]) -> Vec<f64> {
    let mut signature = vec![0.0; candidate.block.first().map_or(0, Vec::len)];
    for (column, coefficient) in candidate.block.iter().zip(coefficients) {
        add_scaled(&mut signature, *coefficient, column);
    }
    signature
}

fn orthonormal<'a>(columns: impl Iterator<Item = &'a Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let full = dot(column, column);
        let rest = without(&without(column, &basis), &basis);
        let power = dot(&rest, &rest);
        if power > 1e-9 * full && power > 0.0 {
            basis.push(rest.iter().map(|value| value / power.sqrt()).collect());
        }
    }
    basis
}

fn without(values: &[f64], basis: &[Vec<f64>]) -> Vec<f64> {
    let mut rest = values.to_vec();
    for known in basis {
        let along = dot(known, &rest);
        add_scaled(&mut rest, -along, known);
    }
    rest
}
