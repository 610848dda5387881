//! Sizes over two planes: widths, which add their distances from the part's origin, and steps, which subtract them.
//!
//! m. What all touches share adds up in a width and cancels in a step (GUM 5.2.2).

use metrology::uncertainty::Components;
use probecell_msgs::{FeatureResult, std_msgs};

use crate::{
    config::{Config, Width},
    feature::common_sensitivity,
    result::decide,
    state::State,
};

/// What is made of the distances of two planes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Composition {
    /// Their sum.
    Width,
    /// The second less the first.
    Step,
}

/// The size over two planes, once both are reported for this plan.
pub(crate) fn composed_result(
    config: &Config,
    state: &State,
    header: &std_msgs::Header,
    size: &Width,
    composition: Composition,
) -> Option<FeatureResult> {
    let [a, b] = [&size.planes[0], &size.planes[1]].map(|id| state.reported.get(id));
    let (a, b) = (a?, b?);
    let sign = match composition {
        Composition::Width => 1.0,
        Composition::Step => -1.0,
    };
    let mut result = FeatureResult {
        header: header.clone(),
        feature_id: size.id.clone(),
        ..of_both(a, b)
    };
    if composition == Composition::Step {
        result.origin = a.origin;
    }
    if let Some(invalid) = [a, b]
        .into_iter()
        .find(|plane| plane.decision == FeatureResult::INVALID)
    {
        result.decision = FeatureResult::INVALID;
        result.text = format!("{}: {}", invalid.feature_id, invalid.text);
        result.form = 0.0;
        result.nominal_size = sign * a.nominal_size + b.nominal_size;
        return Some(result);
    }
    result.size = sign * a.size + b.size;
    result.nominal_size = sign * a.nominal_size + b.nominal_size;
    result.size_deviation = sign * a.size_deviation + b.size_deviation;
    let components = |plane: &FeatureResult| {
        let common = common_sensitivity(plane.kind, 0.0) * config.common_uncertainty;
        Components::split(plane.standard_uncertainty, common)
    };
    let by_touches =
        Components::linear_combination([(sign, components(a)), (1.0, components(b))]).independent;
    let sensitivity = sign * common_sensitivity(a.kind, 0.0) + common_sensitivity(b.kind, 0.0);
    match config.stated(by_touches, sensitivity) {
        Err(error) => {
            result.decision = FeatureResult::INVALID;
            result.text = error.to_string();
        }
        Ok(stated) => {
            result.standard_uncertainty = stated.standard;
            result.coverage_factor = stated.factor;
            let [lower, upper] = size.tolerance_um;
            decide(&mut result, lower * 1e-6, upper * 1e-6);
        }
    }
    Some(result)
}

/// The parts of a result that do not depend on the composition. It has no position and no direction of its own.
fn of_both(a: &FeatureResult, b: &FeatureResult) -> FeatureResult {
    let both = |first: &[u64], second: &[u64]| first.iter().chain(second).copied().collect();
    FeatureResult {
        plan_id: a.plan_id.clone(),
        part_id: a.part_id.clone(),
        kind: a.kind,
        decision: a.decision,
        criterion: a.criterion,
        aligned_to: a.aligned_to.clone(),
        touches: a.touches + b.touches,
        sequences: both(&a.sequences, &b.sequences),
        left_out: both(&a.left_out, &b.left_out),
        axis: a.axis,
        form: a.form.max(b.form),
        coverage_factor: a.coverage_factor,
        repeat_spread: a.repeat_spread.max(b.repeat_spread),
        ..FeatureResult::default()
    }
}
