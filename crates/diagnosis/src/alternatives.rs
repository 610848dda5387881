//! The parameters that an effect's equals would have in its place, so that a person can pick one of them.
//!
//! Each equal is fitted beside the rest of the set, at the best of its tried shapes; shapes are not refined further.

use crate::attribution::Attribution;
use crate::candidate::Candidate;
use crate::evidence::Products;
use crate::parameters;
use crate::pool::{Shapes, orthonormal, remove};
use crate::report::Alternative;

/// The effects `names` in the place of the member at `place` of a set; those that cannot be fitted there are left out.
pub(crate) fn of(
    shapes: &Shapes<'_>,
    attribution: &Attribution,
    set: &[usize],
    place: usize,
    names: &[String],
) -> Vec<Alternative> {
    let alternative = |name: &String| {
        let candidate = best(shapes, attribution, set, place, name)?;
        let members: Vec<&Candidate> = (set.iter().enumerate())
            .map(|(at, &member)| {
                if at == place {
                    &candidate
                } else {
                    &attribution.candidates[member]
                }
            })
            .collect();
        let estimates = parameters::of_members(shapes, attribution, &members);
        let parameters = estimates.into_iter().nth(place)?;
        (!parameters.is_empty()).then(|| Alternative {
            effect: name.clone(),
            parameters,
        })
    };
    names.iter().filter_map(alternative).collect()
}

/// The variant and shape of an effect that leaves least beside the rest of the set.
fn best(
    shapes: &Shapes<'_>,
    attribution: &Attribution,
    set: &[usize],
    place: usize,
    name: &str,
) -> Option<Candidate> {
    let others: Vec<&Candidate> = (set.iter().enumerate())
        .filter(|&(at, _)| at != place)
        .map(|(_, &member)| &attribution.candidates[member])
        .collect();
    let mut best: Option<(f64, Candidate)> = None;
    for (variant, of) in shapes.variants.iter().enumerate() {
        if of.effect != name {
            continue;
        }
        let shape = best_shape(shapes, attribution, &others, variant);
        let Some(candidate) = Candidate::new(shapes.observations, shapes.variants, variant, shape)
        else {
            continue;
        };
        let blocks: Vec<&[Vec<f64>]> = (others.iter().copied().chain([&candidate]))
            .map(|one| one.block.as_slice())
            .collect();
        let all: Vec<usize> = (0..blocks.len()).collect();
        let products = Products::new(&blocks, &attribution.y, &attribution.active);
        let Some(left) = products.fit(&all).map(|fit| fit.variance) else {
            continue;
        };
        if best.as_ref().is_none_or(|(least, _)| left < *least) {
            best = Some((left, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// The tried shape of a variant that takes most out of what the rest of the set leaves; 0 where it has no shape.
fn best_shape(
    shapes: &Shapes<'_>,
    attribution: &Attribution,
    others: &[&Candidate],
    variant: usize,
) -> f64 {
    let seen = |column: &[f64]| -> Vec<f64> {
        (shapes.sample.iter())
            .map(|&row| f64::from(u8::from(attribution.active[row])) * column[row])
            .collect()
    };
    let basis = orthonormal(
        (others.iter().flat_map(|other| &other.block)).map(|column| seen(column.as_slice())),
    );
    let mut left = seen(&attribution.y);
    remove(&mut left, &basis);
    let out: Vec<usize> = (0..left.len())
        .filter(|&place| !attribution.active[shapes.sample[place]])
        .collect();
    let gains = shapes.trials(variant).iter();
    gains
        .map(|trial| (trial.gain(&basis, &left, &out), trial.value))
        .max_by(|one, other| one.0.total_cmp(&other.0))
        .map_or(0.0, |(_, value)| value)
}
