//! The rules of `analysis`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::{Node, Outbox, Stamp, inputs, outputs, topics};
use machine::Nominal;
use metrology::conformance::{Conformance, Tolerance, conformance};
use nalgebra::{Point3, Vector3};
use probecell_msgs::{
    Fault, FeatureResult, InspectionFeature, InspectionPlan, MeasurementOrder, PartAlignment,
    ProbeEvent, TouchDeviation, std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::{
    alignment::{self, Placed},
    config::{Alignment, Config, Method, Width},
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
        /// Where the part lies.
        Alignment(PartAlignment) = topics::PART_ALIGNMENT,
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
    /// Where the part lies, once its datums are touched.
    pub alignment: Option<PartAlignment>,
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
                state.alignment = None;
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
    state.alignment = None;
    state.open = order.order.iter().copied().collect();
    let header = std_msgs::Header {
        stamp: now.time(),
        frame_id: "part".to_owned(),
    };
    report_all(config, state, &plan, &header, out);
    state.plan = Some(plan);
}

/// Reports everything whose points have been tried; where the part is to be placed first, once it is.
fn report_all(
    config: &Config,
    state: &mut State,
    plan: &InspectionPlan,
    header: &std_msgs::Header,
    out: &mut Outbox<Output>,
) {
    if let Some(alignment) = &config.alignment {
        let Some(placed) = place(config, alignment, state, plan, header) else {
            return;
        };
        out.send(Output::Alignment(placed.clone()));
        state.alignment = Some(placed);
    }
    for feature in 0..plan.features.len() as u32 {
        report_when_complete(config, state, plan, feature, header, out);
    }
}

/// Where the part lies, once the features that say so have been tried.
fn place(
    config: &Config,
    alignment: &Alignment,
    state: &State,
    plan: &InspectionPlan,
    header: &std_msgs::Header,
) -> Option<PartAlignment> {
    let mut message = PartAlignment {
        header: header.clone(),
        plan_id: plan.plan_id.clone(),
        part_id: plan.part_id.clone(),
        method: match alignment.method {
            Method::Datums => PartAlignment::DATUMS,
            Method::BestFit => PartAlignment::BEST_FIT,
        },
        feature_ids: alignment.features.clone(),
        ..PartAlignment::default()
    };
    let mut features = Vec::new();
    for id in &alignment.features {
        // The cell file's names are those of its part.
        let index = plan.features.iter().position(|one| one.id == *id)?;
        let points = complete(state, plan, index as u32)?;
        let touched = touched(plan, state, &points);
        message.sequences.extend(touched.iter().map(|one| one.0));
        features.push((&plan.features[index], touched));
    }
    let usable = |(feature, touched): (&InspectionFeature, Touched)| {
        let missing = touched.iter().filter(|one| one.1.is_none()).count();
        if missing > 0 {
            return Err(format!(
                "{}: {}",
                feature.id,
                unusable(missing, touched.len())
            ));
        }
        let samples: Vec<Sample> = touched.into_iter().filter_map(|one| one.1).collect();
        let rules = config.rules(&feature.id);
        feature::agreeing(feature, &samples, &rules, config.touch_uncertainty)
            .map(|(kept, _)| kept)
            .map_err(|error| format!("{}: {error}", feature.id))
    };
    let ball = plan.stylus.ball_radius;
    let placed = features
        .into_iter()
        .map(|(feature, touched)| Ok((feature, usable((feature, touched))?)))
        .collect::<Result<Vec<_>, String>>()
        .and_then(|features| Placed::of(config, alignment, ball, &features));
    match placed {
        Ok(placed) => placed.describe(&mut message),
        Err(text) => message.text = text,
    }
    Some(message)
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
    let places = |alignment: &Alignment| {
        let id = plan.features.get(feature as usize).map(|one| &one.id);
        id.is_some_and(|id| alignment.features.contains(id))
    };
    match &config.alignment {
        Some(alignment) if places(alignment) => {
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
    let Some(points) = complete(state, plan, index) else {
        return;
    };
    let result = result(config, state, plan, feature, header, &points);
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

/// The points of a feature, once all have been tried.
fn complete(state: &State, plan: &InspectionPlan, index: u32) -> Option<BTreeSet<u32>> {
    let points: BTreeSet<u32> = (0..plan.points.len() as u32)
        .filter(|&point| plan.points[point as usize].feature == index)
        .collect();
    let settled = |point| state.touches.contains_key(point) && !state.open.contains(point);
    (!points.is_empty() && points.iter().all(settled)).then_some(points)
}

/// Number of the event of each touch, and the touch where it is usable.
type Touched = Vec<(u64, Option<Sample>)>;

/// What came of these points, in the part frame.
fn touched(plan: &InspectionPlan, state: &State, points: &BTreeSet<u32>) -> Touched {
    let of_point = |point: &u32| {
        let normal = &plan.points[*point as usize].normal;
        let normal = Vector3::new(normal.x, normal.y, normal.z).normalize();
        state.touches[point].iter().map(move |touch| {
            let sample = touch.found.map(|(centre, deviation)| Sample {
                centre: Point3::from(centre),
                normal,
                deviation,
            });
            (touch.sequence, sample)
        })
    };
    points.iter().flat_map(of_point).collect()
}

fn unusable(missing: usize, of: usize) -> String {
    format!("{missing} of {of} probing moves gave no usable touch")
}

/// Mean deviation at each point, m; each has at least one value.
fn mean_deviations(values: &[(u32, f64)]) -> Vec<f64> {
    let mut of_point: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for (point, deviation) in values {
        let (sum, count) = of_point.entry(*point).or_default();
        *sum += deviation;
        *count += 1.0;
    }
    of_point.values().map(|(sum, count)| sum / count).collect()
}

fn publish(state: &mut State, result: FeatureResult, out: &mut Outbox<Output>) {
    state
        .reported
        .insert(result.feature_id.clone(), result.clone());
    out.send(Output::Feature(result));
}

/// Largest range of the deviations of one point, m.
fn repeat_spread(values: &[(u32, f64)]) -> f64 {
    let mut ranges: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for &(point, deviation) in values {
        let range = ranges.entry(point).or_insert((deviation, deviation));
        *range = (range.0.min(deviation), range.1.max(deviation));
    }
    let range = ranges.values().map(|(lowest, highest)| highest - lowest);
    range.fold(0.0, f64::max)
}

fn result(
    config: &Config,
    state: &State,
    plan: &InspectionPlan,
    feature: &InspectionFeature,
    header: &std_msgs::Header,
    points: &BTreeSet<u32>,
) -> FeatureResult {
    let touched = touched(plan, state, points);
    let rules = config.rules(&feature.id);
    let mut result = FeatureResult {
        header: header.clone(),
        plan_id: plan.plan_id.clone(),
        part_id: plan.part_id.clone(),
        feature_id: feature.id.clone(),
        kind: feature.kind,
        decision: FeatureResult::INVALID,
        criterion: rules.criterion.code(),
        sequences: touched.iter().map(|one| one.0).collect(),
        coverage_factor: config.coverage_factor,
        ..FeatureResult::default()
    };
    let mut samples: Vec<Sample> = touched.iter().filter_map(|one| one.1).collect();
    result.touches = samples.len() as u32;
    let missing = touched.len() - samples.len();
    if missing > 0 {
        result.text = unusable(missing, touched.len());
        return result;
    }
    let ball = plan.stylus.ball_radius;
    let placed = state.alignment.as_ref().map(Placed::from_message);
    match &placed {
        None => {}
        Some(Err(text)) => {
            result.text = format!("the part could not be placed: {text}");
            return result;
        }
        Some(Ok(placed)) => {
            for sample in &mut samples {
                *sample = alignment::aligned(&placed.pose, ball, sample);
            }
        }
    }
    if let Some(alignment) = &config.alignment {
        result.aligned_to.clone_from(&alignment.features);
    }
    let of_point: Vec<u32> = points
        .iter()
        .flat_map(|point| vec![*point; state.touches[point].len()])
        .collect();
    let fitted = feature::fit(feature, ball, &samples, &rules, config.touch_uncertainty);
    let left_out = fitted.as_ref().map_or(&[][..], |fitted| &fitted.left_out);
    let used: Vec<usize> = (0..samples.len())
        .filter(|place| !left_out.contains(place))
        .collect();
    let values: Vec<(u32, f64)> = used
        .iter()
        .map(|&place| (of_point[place], samples[place].deviation))
        .collect();
    result.touches = used.len() as u32;
    result.left_out = left_out.iter().map(|&place| touched[place].0).collect();
    result.sequences = used.iter().map(|&place| touched[place].0).collect();
    result.repeat_spread = repeat_spread(&values);
    if result.repeat_spread > config.repeat_limit {
        let (spread, limit) = (result.repeat_spread * 1e6, config.repeat_limit * 1e6);
        result.text = format!(
            "repeated touches of one point differ by {spread:.1} µm, more than {limit:.1} µm"
        );
        return result;
    }
    match &fitted {
        Err(error) => result.text = error.to_string(),
        Ok(fitted) => {
            let shared = config.common_uncertainty;
            let placed = placed.as_ref().and_then(|placed| placed.as_ref().ok());
            let placed = placed.map(|placed| &placed.covariance);
            feature::describe(&mut result, feature, fitted, shared, placed);
            if !left_out.is_empty() {
                tell_left_out(&mut result, left_out, &of_point);
            }
            let free_form = [InspectionFeature::PROFILE, InspectionFeature::SURFACE];
            if free_form.contains(&feature.kind) {
                result.deviations = mean_deviations(&values);
            }
            decide(
                &mut result,
                feature.lower_tolerance,
                feature.upper_tolerance,
            );
        }
    }
    result
}

/// Says which touches were left out: of a point that was touched each time alike it is the surface, or what lies on it, that
/// differs; of one that other touches of the same point contradict, that touch (source systems C.5: persistent, transient).
fn tell_left_out(result: &mut FeatureResult, left_out: &[usize], of_point: &[u32]) {
    let places: Vec<String> = (left_out.iter().map(|&place| of_point[place]))
        .collect::<BTreeSet<u32>>()
        .into_iter()
        .map(|point| {
            let of = of_point.iter().filter(|one| **one == point).count();
            let out = left_out.iter().filter(|&&place| of_point[place] == point);
            match (out.count(), of) {
                (1, 1) => format!("point {point}"),
                (out, of) if out == of => format!("point {point} each of {of} times"),
                (out, of) => format!("point {point} {out} of {of} times"),
            }
        })
        .collect();
    let told = format!(
        "left out, because the other touches contradict them: {}",
        places.join(", ")
    );
    if result.text.is_empty() {
        result.text = told;
    } else {
        result.text = format!("{}; {told}", result.text);
    }
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
        size: a.size + b.size,
        nominal_size: a.nominal_size + b.nominal_size,
        size_deviation: a.size_deviation + b.size_deviation,
        // Independent touches add in squares; what all touches share adds up.
        standard_uncertainty: own(config, a)
            .hypot(own(config, b))
            .hypot(2.0 * config.common_uncertainty),
        ..composed(a, b)
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

/// What is said of two planes together, without a size. It has no place and no direction of its own.
fn composed(a: &FeatureResult, b: &FeatureResult) -> FeatureResult {
    let both = |one: &[u64], other: &[u64]| one.iter().chain(other).copied().collect();
    FeatureResult {
        header: a.header.clone(),
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
        origin: a.origin,
        size: nominal_size + size_deviation,
        nominal_size,
        size_deviation,
        // What both share does not show in their difference.
        standard_uncertainty: own(config, a).hypot(own(config, b)),
        ..composed(a, b)
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
