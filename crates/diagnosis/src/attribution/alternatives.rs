//! The parameters that each effect of an equivalence class would have, so that a person can choose one of them.
//!
//! Each is fitted beside the rest of the set, at the best of its trial shapes; shapes are not refined further.

use effects::candidate;
use inference::candidate::Candidate;
use inference::evidence::InnerProducts;
use inference::posterior::ModelPosterior;

use super::candidate_pool::{ScannedResiduals, Shapes};
use super::parameters;
use crate::report::Alternative;

/// Fits each of the effects `names` in place of the member at `index` of a set, beside the process of an `unknown` cause where there
/// is one (its index, its variance over that of the noise); those that cannot be fitted are left out.
pub(crate) fn fit_alternatives(
    shapes: &Shapes<'_>,
    attribution: &ModelPosterior,
    (set, unknown): (&[usize], Option<(usize, f64)>),
    index: usize,
    names: &[String],
) -> Vec<Alternative> {
    let alternative = |name: &String| {
        let candidate = best_candidate(shapes, attribution, set, index, name)?;
        let mut members: Vec<&Candidate> = (set.iter())
            .map(|&member| &attribution.candidates[member])
            .collect();
        members[index] = &candidate;
        let estimates = parameters::of_members(shapes, attribution, &members, unknown);
        let parameters = estimates.into_iter().nth(index)?;
        (!parameters.is_empty()).then(|| Alternative {
            effect: name.clone(),
            parameters,
        })
    };
    names.iter().filter_map(alternative).collect()
}

/// The variant and shape of an effect with the smallest residual variance beside the rest of the set.
fn best_candidate(
    shapes: &Shapes<'_>,
    attribution: &ModelPosterior,
    set: &[usize],
    index: usize,
    name: &str,
) -> Option<Candidate> {
    let others: Vec<&Candidate> = (set.iter().enumerate())
        .filter(|&(other, _)| other != index)
        .map(|(_, &member)| &attribution.candidates[member])
        .collect();
    let mut best: Option<(f64, Candidate)> = None;
    for (number, variant) in shapes.variants.iter().enumerate() {
        if variant.effect != name {
            continue;
        }
        let shape = best_shape(shapes, attribution, &others, number);
        let Some(candidate) = candidate(shapes.observations, shapes.variants, number, shape) else {
            continue;
        };
        let blocks: Vec<&[Vec<f64>]> = (others.iter().copied().chain([&candidate]))
            .map(|member| member.block.as_slice())
            .collect();
        let all: Vec<usize> = (0..blocks.len()).collect();
        let products = InnerProducts::new(&blocks, &attribution.y, &attribution.active);
        let Some(variance) = products.fit(&all).map(|fit| fit.variance) else {
            continue;
        };
        if best.as_ref().is_none_or(|(least, _)| variance < *least) {
            best = Some((variance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// The trial shape of a variant that explains most of the residuals of the rest of the set; 0 where it has no shape.
fn best_shape(
    shapes: &Shapes<'_>,
    attribution: &ModelPosterior,
    others: &[&Candidate],
    variant: usize,
) -> f64 {
    let others = others.iter().copied();
    let residuals = ScannedResiduals::new(shapes, &attribution.active, &attribution.y, others);
    (shapes.trials(variant).iter())
        .map(|trial| (residuals.explained_by(trial), trial.value))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(0.0, |(_, value)| value)
}
