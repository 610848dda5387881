//! `probecell plan`: the measuring order of a cell's part, or of the plan in a recording.

use std::path::Path;

use anyhow::{Context, bail};
use bags::{Bag, Session};
use cell::Cell;
use graph::Stamp;
use machine::{Chain, Nominal};
use path_planning::Planned;
use probecell_msgs::{InspectionPlan, PlanProgress};
use serde_json::json;
use session_io::evaluation::{Features, evaluate};

use crate::{GOOD, output, ros_arguments::read_cell};

/// Plans and prints.
pub(crate) fn run(source: &Path, as_json: bool) -> anyhow::Result<u8> {
    let (planned, status) = if is_cell(source) {
        (of_cell(&read_cell(source)?, 0.0, &|_| true)?, GOOD)
    } else {
        of_bag(&Bag::open(source)?, None, &|_| true)?
    };
    if as_json {
        output::json(&session_io::order::json(&planned)?)?;
        return Ok(status);
    }
    let Planned { plan, order } = planned;
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

/// What [`Cell::measuring_order`] finds, with progress on a terminal.
pub(crate) fn of_cell(
    cell: &Cell,
    allowance: f64,
    wanted: &dyn Fn(u32) -> bool,
) -> anyhow::Result<Planned> {
    Ok(shown(|progress| {
        cell.measuring_order(allowance, wanted, progress)
    })?)
}

/// What [`Cell::inspection_plan`] finds, with progress on a terminal.
pub(crate) fn part_of(cell: &Cell, allowance: f64) -> anyhow::Result<InspectionPlan> {
    Ok(shown(|progress| cell.inspection_plan(allowance, progress))?)
}

/// What [`session_io::order::measuring_order`] finds, with progress on a terminal, and the exit status.
pub(crate) fn of_bag(
    bag: &Bag,
    clearance: Option<(usize, f64)>,
    wanted: &dyn Fn(u32) -> bool,
) -> anyhow::Result<(Planned, u8)> {
    let (planned, damage) =
        shown(|progress| session_io::order::measuring_order(bag, clearance, wanted, progress))?;
    Ok((planned, output::damage(&damage)))
}

/// Plans, with progress on a terminal.
pub(crate) fn shown<T>(plan: impl FnOnce(&mut dyn FnMut(&PlanProgress)) -> T) -> T {
    let planned = plan(&mut output::progress);
    output::end_progress();
    planned
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
    let (deviations, features) = evaluate(
        analysis::RawConfig::default().check(chain)?,
        plan,
        events.collect(),
    )?;
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
