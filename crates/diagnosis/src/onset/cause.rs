//! Which effects explain a change of the deviations, each on its own.

use effects::{Observations, Variant};
use inference::least_squares::NormalEquations;
use inference::linear::dot;
use inference::robust::residuals;
use metrology::statistics::{coverage_factor, rms};

use super::scatter::Scatter;
use super::{columns, shapes};
use crate::report::{Effect, ParameterEstimate};

/// An effect whose log evidence is lower by less than this is not excluded.
const NOT_EXCLUDED: f64 = 4.6;

/// An effect that leaves more of a change than this share, of the squares beyond what the parts scatter by, does not explain it.
const MAX_LEFT: f64 = 0.25;

/// One way to explain a change.
struct Explanation<'v> {
    variant: &'v Variant,
    score: f64,
    left: f64,
    /// Squares that it leaves beyond what the parts scatter by, of unit variance.
    beyond: f64,
    parameters: Vec<ParameterEstimate>,
}

/// The effect that explains a change best and those that do as well, by how the parts scatter; none where the best leaves too much.
pub(super) fn cause(
    observations: &Observations,
    points: &[usize],
    variants: &[Variant],
    change: &[f64],
    scatter: &Scatter,
) -> Option<Effect> {
    let mut found: Vec<Explanation<'_>> = Vec::new();
    let seen = scatter.whiten(change);
    for variant in variants {
        let tried = shapes(variant);
        let price = (tried.len() as f64).ln();
        for shape in tried {
            let columns = columns(observations, points, variant, shape);
            let white: Vec<Vec<f64>> = columns.iter().map(|one| scatter.whiten(one)).collect();
            let mut normal = NormalEquations::new(columns.len());
            normal.add(&white, &seen);
            let Ok(solution) = normal.solve(1e-9) else {
                continue;
            };
            let left = residuals(&columns, &solution.coefficients, change);
            let unlikely = residuals(&white, &solution.coefficients, &seen);
            let members = columns.len() as f64;
            let unlikely = dot(&unlikely, &unlikely);
            let score = -0.5 * unlikely - 0.5 * members * (points.len() as f64).ln() - price;
            let known = found
                .iter_mut()
                .find(|one| one.variant.effect == variant.effect);
            if known.as_ref().is_some_and(|known| known.score >= score) {
                continue;
            }
            let quantile = coverage_factor(0.95, (points.len() as f64 - members).max(1.0));
            let parameters = (variant.parameters.iter().zip(&solution.coefficients))
                .zip(&solution.unit_variances)
                .map(|((parameter, value), unit)| {
                    let half = quantile * unit.sqrt();
                    ParameterEstimate {
                        name: parameter.name.clone(),
                        value: *value,
                        unit: parameter.unit.to_owned(),
                        ci95: [value - half, value + half],
                    }
                })
                .collect();
            let explanation = Explanation {
                variant,
                score,
                left: rms(&left),
                beyond: (unlikely - (points.len() as f64 - members)).max(0.0),
                parameters,
            };
            match known {
                Some(known) => *known = explanation,
                None => found.push(explanation),
            }
        }
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let best = found.first()?.score;
    let alike = found.partition_point(|one| one.score > best - NOT_EXCLUDED);
    let (group, others) = found.split_at(alike);
    let first = group.first()?;
    let size = rms(change);
    let all = dot(&seen, &seen) - points.len() as f64;
    if first.beyond > MAX_LEFT * all {
        return None;
    }
    let weight = |one: &Explanation<'_>| (one.score - best).exp();
    let within: f64 = group.iter().map(weight).sum();
    let names = || group.iter().map(|one| one.variant.effect.clone());
    Some(Effect {
        effect: first.variant.effect.clone(),
        probability: within / (within + others.iter().map(weight).sum::<f64>()),
        parameters: first.parameters.clone(),
        rms_before: size,
        rms_after: first.left,
        ci95_after: [first.left; 2],
        held_out: false,
        indistinguishable_from: names().skip(1).collect(),
        group: names().collect(),
        alternatives: Vec::new(),
        joint_zero: None,
        placebo_rms_after: None,
        sessions: Vec::new(),
    })
}
