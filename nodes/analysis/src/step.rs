//! The rules of `analysis`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::{Node, Outbox, Stamp, inputs, outputs, topics};
use machine::Nominal;
use metrology::conformance::{Conformance, Tolerance, conformance};
use nalgebra::Point3;
use probecell_msgs::{
    Fault, FeatureResult, InspectionFeature, InspectionPlan, MeasurementOrder, ProbeEvent,
    TouchDeviation, geometry_msgs, std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::{
    config::{Config, Width},
    feature::{self, Sample},
};

inputs! {
    /// What `analysis` hears.
    pub enum Input {
        /// What is measured.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// Which points of it are touched now.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// One probing move and what came of it.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
    }
}

outputs! {
    /// What `analysis` says.
    pub enum Output {
        /// The deviation of one touch.
        Deviation(TouchDeviation) = topics::TOUCH_DEVIATIONS,
        /// A fitted feature.
        Feature(FeatureResult) = topics::FEATURE_RESULTS,
        /// What went wrong.
        Fault(Fault) = topics::ANALYSIS_FAULTS,
    }
}

/// Events kept for a plan that has not come yet.
const WAITING_LIMIT: usize = 65_536;

/// The memory of `analysis`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The plan heard last.
    pub plan: Option<InspectionPlan>,
    /// Events whose plan has not come yet.
    pub waiting: VecDeque<ProbeEvent>,
    /// What came of each point of the plan.
    pub touches: BTreeMap<u32, Vec<Touch>>,
    /// Features and widths reported, with their results.
    pub reported: BTreeMap<String, FeatureResult>,
    /// Points that a further scan of the plan is to touch and has not yet.
    pub open: BTreeSet<u32>,
}

/// What came of one probing move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Touch {
    /// Number of the event.
    pub sequence: u64,
    /// Ball centre in the part frame (m) and deviation (m); `None` where nothing usable was touched.
    pub found: Option<([f64; 3], f64)>,
}

/// The node.
pub struct AnalysisNode;

impl Node for AnalysisNode {
    const NAME: &'static str = "analysis";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;

    fn start(_config: &Config) -> State {
        State::default()
    }

    fn step(
        config: &Config,
        state: &mut State,
        now: Stamp,
        input: Input,
        out: &mut Outbox<Output>,
    ) {
        match input {
            Input::Timer(_) => {}
            Input::Plan(plan) => {
                state.plan = Some(plan);
                state.touches.clear();
                state.reported.clear();
                state.open.clear();
            }
            Input::Order(order) => goes_on(config, state, now, &order, out),
            Input::Event(event) => {
                state.waiting.push_back(event);
                if state.waiting.len() > WAITING_LIMIT {
                    state.waiting.pop_front();
                    fault(now, "an event waited too long for its plan", out);
                }
            }
        }
        let Some(plan) = state.plan.take() else {
            return;
        };
        for event in std::mem::take(&mut state.waiting) {
            if event.plan_id == plan.plan_id {
                take(config, state, now, &plan, &event, out);
            } else {
                state.waiting.push_back(event);
            }
        }
        state.plan = Some(plan);
    }
}

/// A further scan of the plan that some touches of are there: what it does not touch is reported as it was, and the rest
/// once it is touched.
fn goes_on(
    config: &Config,
    state: &mut State,
    now: Stamp,
    order: &MeasurementOrder,
    out: &mut Outbox<Output>,
) {
    let of_plan = |plan: &InspectionPlan| plan.plan_id == order.plan_id;
    if state.touches.is_empty() || !state.plan.as_ref().is_some_and(of_plan) {
        return;
    }
    let Some(plan) = state.plan.take() else {
        return;
    };
    state.reported.clear();
    state.open = order.order.iter().copied().collect();
    let header = std_msgs::Header {
        stamp: now.time(),
        frame_id: "part".to_owned(),
    };
    for feature in 0..plan.features.len() as u32 {
        report_when_complete(config, state, &plan, feature, &header, out);
    }
    state.plan = Some(plan);
}

fn take(
    config: &Config,
    state: &mut State,
    now: Stamp,
    plan: &InspectionPlan,
    event: &ProbeEvent,
    out: &mut Outbox<Output>,
) {
    let Some(nominal) = plan.points.get(event.point_index as usize) else {
        let text = format!(
            "event {} names point {}, which plan {:?} does not have",
            event.sequence, event.point_index, plan.plan_id
        );
        return fault(now, &text, out);
    };
    let mut found = None;
    if event.outcome == ProbeEvent::OUTCOME_TOUCHED {
        match locate(config, plan, event) {
            Ok(located) => found = Some(located),
            Err(text) => fault(now, &format!("event {}: {text}", event.sequence), out),
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
    if state.open.remove(&event.point_index) {
        // What an earlier scan found there is superseded.
        touches.clear();
    }
    touches.push(touch);
    let feature = nominal.feature;
    report_when_complete(config, state, plan, feature, &event.header, out);
}

/// Ball centre in the part frame and deviation d = n·(c − p) − r, by the nominal chain.
fn locate(
    config: &Config,
    plan: &InspectionPlan,
    event: &ProbeEvent,
) -> Result<(Point3<f64>, f64), String> {
    let part = Nominal::from_plan(plan).map_err(|error| error.to_string())?;
    let positions = config
        .chain
        .positions(&event.axis_names, &event.axis_positions)
        .map_err(|error| error.to_string())?;
    let centre = config
        .chain
        .ball_in_part(&positions, &part.part_pose, &part.ball);
    let deviation = part.deviation(&config.chain, event.point_index as usize, &positions);
    if deviation.is_finite() {
        Ok((centre, deviation))
    } else {
        Err("its deviation is not a finite number".to_owned())
    }
}

fn report_when_complete(
    config: &Config,
    state: &mut State,
    plan: &InspectionPlan,
    index: u32,
    header: &std_msgs::Header,
    out: &mut Outbox<Output>,
) {
    let Some(feature) = plan.features.get(index as usize) else {
        return;
    };
    let points: BTreeSet<u32> = (0..plan.points.len() as u32)
        .filter(|&point| plan.points[point as usize].feature == index)
        .collect();
    let settled = |point| state.touches.contains_key(point) && !state.open.contains(point);
    if points.is_empty() || !points.iter().all(settled) {
        return;
    }
    let touches: Vec<&Touch> = points
        .iter()
        .flat_map(|point| &state.touches[point])
        .collect();
    let mut result = result(
        config,
        plan,
        feature,
        header,
        &touches,
        repeat_spread(state, &points),
    );
    let free_form = [InspectionFeature::PROFILE, InspectionFeature::SURFACE];
    if free_form.contains(&feature.kind) && result.decision != FeatureResult::INVALID {
        result.deviations = points
            .iter()
            .map(|point| mean_deviation(&state.touches[point]))
            .collect();
    }
    publish(state, result, out);
    for width in &config.widths {
        if width.planes.contains(&feature.id)
            && let Some(result) = width_result(config, state, header, width)
        {
            publish(state, result, out);
        }
    }
    for step in &config.steps {
        if step.planes.contains(&feature.id)
            && let Some(result) = step_result(config, state, header, step)
        {
            publish(state, result, out);
        }
    }
}

/// Mean of the usable touches of one point, m.
fn mean_deviation(touches: &[Touch]) -> f64 {
    let found = || {
        touches
            .iter()
            .filter_map(|touch| touch.found.map(|(_, deviation)| deviation))
    };
    found().sum::<f64>() / found().count() as f64
}

fn publish(state: &mut State, result: FeatureResult, out: &mut Outbox<Output>) {
    state
        .reported
        .insert(result.feature_id.clone(), result.clone());
    out.send(Output::Feature(result));
}

/// Largest range of the deviations of one point, m.
fn repeat_spread(state: &State, points: &BTreeSet<u32>) -> f64 {
    let spread = |point: &u32| {
        let found = || {
            state.touches[point]
                .iter()
                .filter_map(|touch| touch.found.map(|(_, deviation)| deviation))
        };
        let highest = found().fold(f64::NEG_INFINITY, f64::max);
        let lowest = found().fold(f64::INFINITY, f64::min);
        if highest > lowest {
            highest - lowest
        } else {
            0.0
        }
    };
    points.iter().map(spread).fold(0.0, f64::max)
}

fn result(
    config: &Config,
    plan: &InspectionPlan,
    feature: &InspectionFeature,
    header: &std_msgs::Header,
    touches: &[&Touch],
    spread: f64,
) -> FeatureResult {
    let samples: Vec<Sample> = touches
        .iter()
        .filter_map(|touch| touch.found)
        .map(|(centre, deviation)| Sample {
            centre: Point3::from(centre),
            deviation,
        })
        .collect();
    let mut result = FeatureResult {
        header: header.clone(),
        plan_id: plan.plan_id.clone(),
        part_id: plan.part_id.clone(),
        feature_id: feature.id.clone(),
        kind: feature.kind,
        decision: FeatureResult::INVALID,
        touches: samples.len() as u32,
        sequences: touches.iter().map(|touch| touch.sequence).collect(),
        coverage_factor: config.coverage_factor,
        repeat_spread: spread,
        ..FeatureResult::default()
    };
    let missing = touches.len() - samples.len();
    if missing > 0 {
        result.text = format!(
            "{missing} of {} probing moves gave no usable touch",
            touches.len()
        );
        return result;
    }
    if spread > config.repeat_limit {
        let (spread, limit) = (spread * 1e6, config.repeat_limit * 1e6);
        result.text = format!(
            "repeated touches of one point differ by {spread:.1} µm, more than {limit:.1} µm"
        );
        return result;
    }
    match feature::fit(feature, plan.stylus.ball_radius, &samples) {
        Err(error) => result.text = error.to_string(),
        Ok(fitted) => {
            feature::describe(
                &mut result,
                &fitted,
                config.touch_uncertainty,
                config.common_uncertainty,
            );
            decide(
                &mut result,
                feature.lower_tolerance,
                feature.upper_tolerance,
            );
        }
    }
    result
}

/// The width over two planes, once both are reported for this plan.
fn width_result(
    config: &Config,
    state: &State,
    header: &std_msgs::Header,
    width: &Width,
) -> Option<FeatureResult> {
    let [a, b] = [&width.planes[0], &width.planes[1]].map(|id| state.reported.get(id));
    let (a, b) = (a?, b?);
    let mut result = FeatureResult {
        header: header.clone(),
        feature_id: width.id.clone(),
        touches: a.touches + b.touches,
        sequences: a.sequences.iter().chain(&b.sequences).copied().collect(),
        size: a.size + b.size,
        nominal_size: a.nominal_size + b.nominal_size,
        size_deviation: a.size_deviation + b.size_deviation,
        form: a.form.max(b.form),
        // Independent touches add in squares; what all touches share adds up.
        standard_uncertainty: own(config, a)
            .hypot(own(config, b))
            .hypot(2.0 * config.common_uncertainty),
        repeat_spread: a.repeat_spread.max(b.repeat_spread),
        text: String::new(),
        origin: geometry_msgs::Point::default(),
        ..a.clone()
    };
    if !is_invalid(&mut result, [a, b]) {
        decide(
            &mut result,
            width.tolerance_um[0] * 1e-6,
            width.tolerance_um[1] * 1e-6,
        );
    }
    Some(result)
}

/// True where one of two planes has no size: then what rests on both has none either, and says which.
fn is_invalid(result: &mut FeatureResult, planes: [&FeatureResult; 2]) -> bool {
    let mut invalid = planes.into_iter();
    let Some(invalid) = invalid.find(|plane| plane.decision == FeatureResult::INVALID) else {
        return false;
    };
    result.decision = FeatureResult::INVALID;
    result.text = format!("{}: {}", invalid.feature_id, invalid.text);
    result.size = 0.0;
    result.size_deviation = 0.0;
    result.form = 0.0;
    result.standard_uncertainty = 0.0;
    true
}

/// The step from the first plane to the second, once both are reported for this plan: what they deviate differently.
fn step_result(
    config: &Config,
    state: &State,
    header: &std_msgs::Header,
    step: &Width,
) -> Option<FeatureResult> {
    let [a, b] = [&step.planes[0], &step.planes[1]].map(|id| state.reported.get(id));
    let (a, b) = (a?, b?);
    let nominal_size = b.nominal_size - a.nominal_size;
    let size_deviation = b.size_deviation - a.size_deviation;
    let mut result = FeatureResult {
        header: header.clone(),
        feature_id: step.id.clone(),
        touches: a.touches + b.touches,
        sequences: a.sequences.iter().chain(&b.sequences).copied().collect(),
        size: nominal_size + size_deviation,
        nominal_size,
        size_deviation,
        form: a.form.max(b.form),
        // What both share does not show in their difference.
        standard_uncertainty: own(config, a).hypot(own(config, b)),
        repeat_spread: a.repeat_spread.max(b.repeat_spread),
        text: String::new(),
        ..a.clone()
    };
    if !is_invalid(&mut result, [a, b]) {
        let [lower, upper] = step.tolerance_um;
        decide(&mut result, lower * 1e-6, upper * 1e-6);
    }
    Some(result)
}

/// The part of a plane's uncertainty that it does not share with others, m.
fn own(config: &Config, plane: &FeatureResult) -> f64 {
    (plane.standard_uncertainty.powi(2) - config.common_uncertainty.powi(2))
        .max(0.0)
        .sqrt()
}

/// ISO 14253-1: conforms only when the whole expanded uncertainty lies inside the limits.
fn decide(result: &mut FeatureResult, lower: f64, upper: f64) {
    let expanded = result.coverage_factor * result.standard_uncertainty;
    match conformance(result.size_deviation, expanded, &Tolerance { lower, upper }) {
        Ok(Conformance::Conforms) => result.decision = FeatureResult::CONFORMS,
        Ok(Conformance::DoesNotConform) => result.decision = FeatureResult::DOES_NOT_CONFORM,
        Ok(Conformance::Indeterminate) => result.decision = FeatureResult::INDETERMINATE,
        Err(error) => result.text = error.to_string(),
    }
}

fn fault(now: Stamp, text: &str, out: &mut Outbox<Output>) {
    out.send(Output::Fault(Fault {
        header: std_msgs::Header {
            stamp: now.time(),
            frame_id: String::new(),
        },
        node: AnalysisNode::NAME.to_owned(),
        severity: Fault::ERROR,
        code: "event_not_usable".to_owned(),
        text: text.to_owned(),
    }));
}
