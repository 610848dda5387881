//! The rules of `compensation`: what each input changes, and when a measurement is complete.

use std::collections::BTreeSet;

use graph::Stamp;
use probecell_msgs::{FeatureResult, InspectionPlan, OperationRequest, PartReport};

use crate::{
    approval::{self, APPROVAL, PART_ENDED},
    config::Config,
    decide,
    ports::{Input, Out},
    reference,
    state::State,
    volumetric, work_offset,
};

/// Results kept that arrived before the request for their measurement.
const EARLY_LIMIT: usize = 1024;

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
    match input {
        Input::Timer(APPROVAL) => approval::overdue(config, state, now, out),
        Input::Timer(_) => {}
        Input::Offsets(offsets) => state.offsets = Some(offsets),
        Input::Request(request) => begin(config, state, now, request, out),
        // Touch data serve the volumetric table and the work offsets only.
        Input::Plan(plan) if !config.uses_touches() => {
            state.features = Some(touched_features(&plan));
        }
        Input::Event(_) if !config.uses_touches() => {}
        Input::Deviation(_) if config.volumetric.is_none() => {}
        Input::Alignment(_) if config.work_offset.is_none() => {}
        Input::Alignment(alignment) => {
            state.alignment = Some(alignment);
            decide_when_complete(config, state, now, out);
        }
        Input::Plan(plan) => {
            state.features = Some(touched_features(&plan));
            state.touches.plan = Some(plan);
            decide_when_complete(config, state, now, out);
        }
        Input::Event(event) => {
            state.touches.events.insert(event.sequence, event);
            decide_when_complete(config, state, now, out);
        }
        Input::Deviation(touch) => {
            state.touches.add_deviation(&touch);
            decide_when_complete(config, state, now, out);
        }
        Input::Keys(keys) => {
            signatures::operators::take(config.trust.cell.as_ref(), &mut state.keys, keys);
        }
        Input::Reference(found) => reference::refer(state, now, found, out),
        Input::Feature(result) => take(config, state, now, result, out),
        Input::Approval(request) => approval::approve(config, state, now, &request, out),
        Input::Part(report) if report.verdict == PartReport::MEASURED => {}
        Input::Part(report) => {
            approval::withdraw(state, Stamp::from(&report.header.stamp), PART_ENDED);
        }
    }
}

/// Id of a plan, and the features that have points in it.
fn touched_features(plan: &InspectionPlan) -> (String, BTreeSet<String>) {
    let features = (plan.points.iter())
        .filter_map(|point| plan.features.get(point.feature as usize))
        .map(|feature| feature.id.clone());
    (plan.plan_id.clone(), features.collect())
}

/// Begins a measurement: what was proposed before it is void.
fn begin(config: &Config, state: &mut State, now: Stamp, request: OperationRequest, out: &mut Out) {
    if request.kind != OperationRequest::MEASURE || state.taken.as_ref() == Some(&request) {
        return;
    }
    state.taken = Some(request.clone());
    state.results.clear();
    state.measured.clear();
    state.proposed.clear();
    state.withdrawn.clear();
    state.touches.retain(&request.plan_id);
    // Nothing is decided on a plan that is only measured.
    state.measurement = (!request.only_measure).then_some((request.plan_id, request.pass_number));
    for result in state.early.release(|_| true) {
        take(config, state, now, result, out);
    }
}

/// Adds a result to its measurement, and decides where it was the last.
fn take(config: &Config, state: &mut State, now: Stamp, result: FeatureResult, out: &mut Out) {
    let pass = match &state.measurement {
        Some((plan_id, pass)) if *plan_id == result.plan_id => *pass,
        _ => {
            // The cycle's request and the results arrive on different topics: a result may arrive first.
            state.early.keep(result, EARLY_LIMIT);
            return;
        }
    };
    state.measured.insert(result.feature_id.clone());
    let decides = (config.deciding(pass)).any(|size| size.id == result.feature_id);
    if decides || config.table(pass).is_some() || config.work_offset(pass).is_some() {
        state.results.insert(result.feature_id.clone(), result);
    }
    // One that decides nothing may be the last of the plan.
    if !state.results.is_empty() {
        decide_when_complete(config, state, now, out);
    }
}

/// Decides once everything has arrived that decides in the pass, and the plan is measured whole: a measurement that is stopped
/// before, though it may have every size, is not decided on.
fn decide_when_complete(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let Some((plan_id, pass)) = &state.measurement else {
        return;
    };
    let (results, touches) = (&state.results, &state.touches);
    let mut sizes = config.deciding(*pass);
    let table = config.table(*pass);
    let position = config.work_offset(*pass);
    if state.is_measured(plan_id)
        && sizes.all(|size| results.contains_key(&size.id))
        && table.is_none_or(|_| volumetric::is_complete(touches, plan_id, results))
        && position.is_none_or(|_| {
            work_offset::is_complete(state.alignment.as_ref(), plan_id, touches, results)
        })
    {
        decide::decide(config, state, now, out);
    }
}
