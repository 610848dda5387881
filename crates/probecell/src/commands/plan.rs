//! `probecell plan`: the measuring order of a cell's part, or of the plan in a recording.

use std::{collections::BTreeMap, path::Path};

use analysis::AnalysisNode;
use anyhow::{Context, bail};
use bags::{Bag, Session};
use cell::Cell;
use graph::{Executor, Running, Stamp, topics};
use machine::{Chain, Nominal};
use path_planning::{MotionRules, OrderRequest, Planned, Seed};
use probecell_msgs::{
    FeatureResult, InspectionPlan, MeasurementOrder, ProbeEvent, TouchDeviation, from_cdr, to_cdr,
};
use serde_json::json;

use crate::{GOOD, output};

/// Search effort without a cell file.
const KICKS: u64 = 50_000;
/// m; overtravel of a probing move behind the nominal contact without a cell file.
const OVERTRAVEL: f64 = 2e-3;

/// Plans and prints.
pub(crate) fn run(source: &Path, as_json: bool) -> anyhow::Result<u8> {
    let (plan, order, status) = if is_cell(source) {
        of_cell(&Cell::read(source)?, 0.0, &|_| true)?
    } else {
        of_bag(&Bag::open(source)?, None, &|_| true)?
    };
    if as_json {
        let mut answer = serde_json::to_value(&order)?;
        answer["plan"] = serde_json::to_value(&plan)?;
        output::json(&answer)?;
        return Ok(status);
    }
    let saved = 100.0 * (1.0 - order.air_time / order.given_air_time.max(1e-12));
    output::line(&format!(
        "{}: {} touches of {} features",
        plan.part_id,
        plan.points.len(),
        plan.features.len()
    ));
    output::line(&format!(
        "air moves: {:.2} s instead of {:.2} s in the given order ({saved:.1} % less){}",
        order.air_time,
        order.given_air_time,
        if order.optimal {
            ", proven optimal"
        } else {
            ""
        }
    ));
    output::line(&format!(
        "path of the ball in the part frame: {:.1} mm instead of {:.1} mm",
        order.air_length * 1e3,
        order.given_air_length * 1e3
    ));
    output::line(&format!("order: {:?}", order.order));
    Ok(status)
}

/// What the command is given is a cell file and not a bag.
pub(crate) fn is_cell(source: &Path) -> bool {
    source
        .extension()
        .is_some_and(|extension| extension == "toml")
}

/// Plan and order of a cell's part with an allowance (m) left on its sizes; only points that `wanted` wants are touched.
pub(crate) fn of_cell(
    cell: &Cell,
    allowance: f64,
    wanted: &dyn Fn(u32) -> bool,
) -> anyhow::Result<(InspectionPlan, MeasurementOrder, u8)> {
    let config = (cell.path_planning).check(cell.chain()?, &cell.part, Vec::new())?;
    let plan = config.part.plan(allowance);
    let points: Vec<u32> = (0..plan.points.len() as u32)
        .filter(|&point| wanted(point))
        .collect();
    let rules = config.rules();
    let all: Vec<u32> = (0..plan.points.len() as u32).collect();
    let mut request = OrderRequest {
        plan: &plan,
        points: &all,
        stages: config.part.stages(),
        poses: config.part.poses(),
        seeds: &[],
        here: None,
    };
    // Poses are those of the whole plan, whichever points are left of it.
    let mut whole = None;
    if points == all || config.part.poses().iter().any(|poses| poses.len() > 1) {
        whole = Some(planned(&rules, &request)?);
    }
    let Planned { plan, order } = match &whole {
        Some(whole) if points == all => whole.clone(),
        _ => {
            request.plan = whole.as_ref().map_or(&plan, |whole| &whole.plan);
            request.points = &points;
            request.poses = &[];
            planned(&rules, &request)?
        }
    };
    Ok((plan, order, GOOD))
}

/// The plan of a cell's part with an allowance (m) left on its sizes, at the poses chosen where there are several.
pub(crate) fn part_of(cell: &Cell, allowance: f64) -> anyhow::Result<InspectionPlan> {
    let config = (cell.path_planning).check(cell.chain()?, &cell.part, Vec::new())?;
    if config.part.poses().iter().all(|poses| poses.len() < 2) {
        return Ok(config.part.plan(allowance));
    }
    Ok(of_cell(cell, allowance, &|_| true)?.0)
}

/// Plans, with progress on a terminal.
fn planned(rules: &MotionRules<'_>, request: &OrderRequest<'_>) -> anyhow::Result<Planned> {
    let planned = rules.plan(request, &mut |task| output::progress(&task.progress()));
    output::end_progress();
    Ok(planned?)
}

/// Orders the plan of a recording again, against the order in which it was measured; `clearance` as in [`MotionRules`],
/// `wanted` as in [`of_cell`].
pub(crate) fn of_bag(
    bag: &Bag,
    clearance: Option<(usize, f64)>,
    wanted: &dyn Fn(u32) -> bool,
) -> anyhow::Result<(InspectionPlan, MeasurementOrder, u8)> {
    let session = Session::read(bag)?;
    let status = output::damage(&session.damage);
    let recorded = session
        .plan
        .as_ref()
        .context("the bag has no inspection plan")?;
    let chain = Chain::from_urdf(&session.robot_description)?;
    let part_pose = Nominal::from_plan(recorded)?.part_pose;
    if session.events.is_empty() {
        bail!("the bag has no probe events, so there is no measured order to compare with");
    }
    // The first touch of each point gives the order to beat, and where the axes stood.
    let mut seeds = Vec::new();
    let mut measured = Vec::new();
    for event in session.events.iter().map(|stamped| &stamped.message) {
        if measured.contains(&event.point_index) || !wanted(event.point_index) {
            continue;
        }
        if event.point_index as usize >= recorded.points.len() {
            bail!("a probe event names a point that is not in the plan");
        }
        let positions = chain.positions(&event.axis_names, &event.axis_positions)?;
        // Where the free axes can turn the probe (an arm), it keeps the attitude that it had.
        let free = chain
            .axes()
            .len()
            .saturating_sub(recorded.rotary_names.len());
        let attitude = (recorded.rotary_names.is_empty() || free > 3)
            .then(|| chain.part_from_mount(&positions, &part_pose).rotation);
        seeds.push(Seed {
            positions,
            attitude,
        });
        measured.push(event.point_index);
    }
    let rules = MotionRules {
        chain: &chain,
        clearance,
        attitudes: None,
        overtravel: OVERTRAVEL,
        kicks: KICKS,
    };
    let request = OrderRequest {
        plan: recorded,
        points: &measured,
        stages: &[],
        poses: &[],
        seeds: &seeds,
        here: None,
    };
    let Planned { plan, order } = planned(&rules, &request)?;
    Ok((plan, order, status))
}

/// Runs the analysis on a recording of another system: its plan and touches, on virtual time.
pub(crate) fn replay_foreign(bag: &Bag, as_json: bool) -> anyhow::Result<u8> {
    let session = Session::read(bag)?;
    let status = output::damage(&session.damage);
    let plan = session.plan.as_ref().context(
        "the bag has neither step journals nor an inspection plan: there is nothing to replay",
    )?;
    if session.events.is_empty() {
        bail!("the bag has no probe events: there is nothing to replay");
    }
    let chain = Chain::from_urdf(&session.robot_description)?;
    Nominal::from_plan(plan)?;
    for event in &session.events {
        let event = &event.message;
        chain
            .positions(&event.axis_names, &event.axis_positions)
            .with_context(|| format!("event {}", event.sequence))?;
    }
    let events = session
        .events
        .iter()
        .map(|event| (Stamp(event.log_time as i64), &event.message));
    let (deviations, features) = analyse(chain, plan, events.collect())?;
    if as_json {
        output::json(&json!({ "deviations": deviations, "features": features }))?;
        return Ok(status);
    }
    output::line(&format!(
        "{} touches of plan {:?} recomputed; the recording has no results to compare with",
        deviations.len(),
        plan.plan_id
    ));
    print_features(&features);
    Ok(status)
}

/// Results by name of the feature.
pub(crate) type Features = BTreeMap<String, FeatureResult>;

/// Runs the analysis on a plan and its touches, on virtual time.
pub(crate) fn analyse(
    chain: Chain,
    plan: &InspectionPlan,
    events: Vec<(Stamp, &ProbeEvent)>,
) -> anyhow::Result<(Vec<TouchDeviation>, Features)> {
    analyse_with(analysis::RawConfig::default().check(chain)?, plan, events)
}

/// As [`analyse`], by other settings.
pub(crate) fn analyse_with(
    config: analysis::Config,
    plan: &InspectionPlan,
    events: Vec<(Stamp, &ProbeEvent)>,
) -> anyhow::Result<(Vec<TouchDeviation>, Features)> {
    let start = events
        .first()
        .map_or(Stamp(0), |(first, _)| *first)
        .after_s(-1.0);
    let mut executor = Executor::new(vec![Box::new(Running::<AnalysisNode>::new(config))], start)?;
    executor.inject(start, topics::INSPECTION_PLAN.name, to_cdr(plan));
    for (instant, event) in events {
        executor.inject(instant, topics::PROBE_EVENTS.name, to_cdr(event));
    }
    executor.run_until(Stamp(i64::MAX));
    let mut deviations = Vec::new();
    let mut features = Features::new();
    for published in &executor.take_log() {
        if published.topic == topics::TOUCH_DEVIATIONS.name {
            deviations.push(from_cdr::<TouchDeviation>(&published.payload)?);
        } else if published.topic == topics::FEATURE_RESULTS.name {
            let result = from_cdr::<FeatureResult>(&published.payload)?;
            features.insert(result.feature_id.clone(), result);
        }
    }
    Ok((deviations, features))
}

/// A line for each feature.
pub(crate) fn print_features(features: &Features) {
    for result in features.values() {
        output::line(&format!(
            "  {:<20} {:10.4} mm  {:+8.2} µm  form {:7.2} µm  {}",
            result.feature_id,
            result.size * 1e3,
            result.size_deviation * 1e6,
            result.form * 1e6,
            result.text
        ));
    }
}
