//! The rules of `analysis`: what each input changes, and what is reported then.

use graph::{Outbox, Stamp};
use machine::Nominal;
use nalgebra::Point3;
use probecell_msgs::{
    FeatureResult, InspectionPlan, MeasurementOrder, ProbeEvent, ReferenceMeasurement,
    TouchDeviation, std_msgs,
};

use crate::{
    alignment,
    composed::{Composition, composed_result},
    config::{Alignment, Config},
    ports::{AnalysisFault, Input, Out, Output},
    result,
    state::{State, Touch},
    tolerance::evaluation::tolerance_result,
};

/// Events kept whose plan has not arrived yet.
const WAITING_LIMIT: usize = 65_536;
/// Plans kept for references, which come when the part has been carried to the instrument.
const PLAN_LIMIT: usize = 8;

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
    match input {
        Input::Timer(_) => {}
        Input::Plan(plan) => {
            if let Some(before) = state.plan.replace(plan) {
                state.earlier.push_back(before);
                if state.earlier.len() > PLAN_LIMIT {
                    state.earlier.pop_front();
                }
            }
            state.touches.clear();
            state.reported.clear();
            state.pending.clear();
            state.alignment = None;
        }
        Input::Order(order) => remeasure(config, state, now, &order, out),
        Input::Reference(reference) => evaluate(config, state, now, &reference, out),
        Input::Event(event) => {
            if state.waiting.keep(event, WAITING_LIMIT).is_some() {
                let text = "an event was dropped because its plan did not arrive";
                out.fault(now, AnalysisFault::EventNotUsable, text);
            }
        }
    }
    let Some(plan) = state.plan.take() else {
        return;
    };
    for event in (state.waiting).release(|event| event.plan_id == plan.plan_id) {
        take(config, state, now, &plan, &event, out);
    }
    state.plan = Some(plan);
}

/// Reports the features of a reference measurement.
fn evaluate(
    config: &Config,
    state: &State,
    now: Stamp,
    reference: &ReferenceMeasurement,
    out: &mut Out,
) {
    // The latest of a name: a plan published again replaces the one before.
    let plans = state.earlier.iter().chain(&state.plan);
    let plan = plans.rev().find(|plan| plan.plan_id == reference.plan_id);
    let unknown = InspectionPlan::default();
    match config.by_reference(plan.unwrap_or(&unknown), reference) {
        Ok(results) => {
            for result in results {
                out.send(Output::ReferenceFeature(result));
            }
        }
        Err(error) => out.fault(now, AnalysisFault::ReferenceNotUsable, error.to_string()),
    }
}

/// The results of every feature, width and step of which the state holds all points.
pub(crate) fn features_of(
    config: &Config,
    state: &mut State,
    plan: &InspectionPlan,
    header: &std_msgs::Header,
) -> Vec<FeatureResult> {
    let mut out = Outbox::default();
    report_all(config, state, plan, header, &mut out);
    let features = out.messages().iter().filter_map(|output| match output {
        Output::Feature(result) => Some(result.clone()),
        _ => None,
    });
    features.collect()
}

/// Starts a re-measurement of a partly measured plan: features without a point of the order keep their touches and are
/// reported again at once, the others when all their points of the order have been tried.
fn remeasure(
    config: &Config,
    state: &mut State,
    now: Stamp,
    order: &MeasurementOrder,
    out: &mut Out,
) {
    let is_ordered = |plan: &InspectionPlan| plan.plan_id == order.plan_id;
    if state.touches.is_empty() || !state.plan.as_ref().is_some_and(is_ordered) {
        return;
    }
    let Some(plan) = state.plan.take() else {
        return;
    };
    state.reported.clear();
    state.alignment = None;
    state.pending = order.order.iter().copied().collect();
    let header = now.header("part");
    report_all(config, state, &plan, &header, out);
    state.plan = Some(plan);
}

/// Reports every feature whose points have all been tried; where the part is to be aligned, not before it is.
fn report_all(
    config: &Config,
    state: &mut State,
    plan: &InspectionPlan,
    header: &std_msgs::Header,
    out: &mut Out,
) {
    if let Some(alignment) = &config.alignment {
        let Some(message) = alignment::part_alignment(config, alignment, state, plan, header)
        else {
            return;
        };
        out.send(Output::Alignment(message.clone()));
        state.alignment = Some(message);
    }
    for feature in 0..plan.features.len() as u32 {
        report_when_complete(config, state, plan, feature, header, out);
    }
}

/// Locates the touch of an event and reports what is complete with it.
fn take(
    config: &Config,
    state: &mut State,
    now: Stamp,
    plan: &InspectionPlan,
    event: &ProbeEvent,
    out: &mut Out,
) {
    let Some(nominal) = plan.points.get(event.point_index as usize) else {
        let text = format!(
            "event {} names point {}, which plan {:?} does not have",
            event.sequence, event.point_index, plan.plan_id
        );
        return out.fault(now, AnalysisFault::EventNotUsable, text);
    };
    let mut found = None;
    if event.outcome == ProbeEvent::OUTCOME_TOUCHED {
        match locate(config, plan, event) {
            Ok(located) => found = Some(located),
            Err(text) => {
                let text = format!("event {}: {text}", event.sequence);
                out.fault(now, AnalysisFault::EventNotUsable, text);
            }
        }
    }
    if let Some((_, deviation)) = found {
        out.send(Output::Deviation(TouchDeviation {
            header: event.header.clone(),
            plan_id: plan.plan_id.clone(),
            sequence: event.sequence,
            point_index: event.point_index,
            deviation,
            standard_uncertainty: config.touch_uncertainty.hypot(config.common_uncertainty),
        }));
    }
    let touch = Touch {
        sequence: event.sequence,
        found: found.map(|(centre, d)| ([centre.x, centre.y, centre.z], d)),
    };
    let touches = state.touches.entry(event.point_index).or_default();
    if state.pending.remove(&event.point_index) {
        // The re-measurement supersedes the earlier touches of the point.
        touches.clear();
    }
    touches.push(touch);
    let feature = nominal.feature;
    let aligns = |alignment: &Alignment| {
        let nominal = plan.features.get(feature as usize);
        nominal.is_some_and(|nominal| alignment.features.contains(&nominal.id))
    };
    match &config.alignment {
        Some(alignment) if aligns(alignment) => {
            report_all(config, state, plan, &event.header, out);
        }
        Some(_) if state.alignment.is_none() => {}
        _ => report_when_complete(config, state, plan, feature, &event.header, out),
    }
}

/// Ball centre in the part frame and deviation d = n·(c − p) − r, by the nominal chain.
fn locate(
    config: &Config,
    plan: &InspectionPlan,
    event: &ProbeEvent,
) -> Result<(Point3<f64>, f64), String> {
    let index = event.point_index as usize;
    let part = Nominal::of_point(plan, index).map_err(|error| error.to_string())?;
    let positions = config
        .chain
        .positions(&event.axis_names, &event.axis_positions)
        .map_err(|error| error.to_string())?;
    let (centre, deviation) = part.touch(&config.chain, 0, &positions);
    if deviation.is_finite() {
        Ok((centre, deviation))
    } else {
        Err("its deviation is not a finite number".to_owned())
    }
}

/// Reports a feature once all its points have been tried, and the widths and steps that are complete with it.
fn report_when_complete(
    config: &Config,
    state: &mut State,
    plan: &InspectionPlan,
    index: u32,
    header: &std_msgs::Header,
    out: &mut Out,
) {
    let Some(feature) = plan.features.get(index as usize) else {
        return;
    };
    let Some(points) = state.complete(plan, index) else {
        return;
    };
    let result = result::feature_result(config, state, plan, feature, header, &points);
    publish(state, result, out);
    let widths = config.widths.iter().map(|size| (size, Composition::Width));
    let steps = config.steps.iter().map(|size| (size, Composition::Step));
    for (size, composition) in widths.chain(steps) {
        if size.planes.contains(&feature.id)
            && let Some(result) = composed_result(config, state, header, size, composition)
        {
            publish(state, result, out);
        }
    }
    for tolerance in &config.tolerances {
        let concerns = tolerance.feature == feature.id || tolerance.datums.contains(&feature.id);
        if concerns && let Some(result) = tolerance_result(config, state, plan, header, tolerance) {
            publish(state, result, out);
        }
    }
}

fn publish(state: &mut State, result: FeatureResult, out: &mut Out) {
    state
        .reported
        .insert(result.feature_id.clone(), result.clone());
    out.send(Output::Feature(result));
}
