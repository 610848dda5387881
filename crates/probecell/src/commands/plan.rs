//! `probecell plan`: the measuring order of a cell's part, or of the plan in a recording.

use std::path::Path;

use anyhow::{Context, bail};
use bags::{Bag, Session};
use cell::Cell;
use graph::{Stamp, topics};
use machine::{Chain, Nominal};
use path_planning::Planned;
use probecell_msgs::InspectionPlan;
use serde_json::json;
use session_io::evaluation::{evaluate, lines};
use session_io::order::measuring_order;
use session_io::{Reader, is_cell_file, record};

use super::selection::Selection;
use crate::{GOOD, output, ros_arguments::read_cell};

/// Plans and prints; of a recording with several plans, or where some are wanted, lists them.
pub(crate) fn run(source: &Path, as_json: bool, selection: &Selection) -> anyhow::Result<u8> {
    if !is_cell_file(source) {
        let bag = Bag::open(source)?;
        let plans = plans(&bag, source);
        // What cannot be read is named below.
        if selection.is_given() || plans.as_ref().is_ok_and(|plans| plans.len() > 1) {
            return list(plans?, as_json, selection);
        }
    }
    let (planned, status) = if is_cell_file(source) {
        (of_cell(&read_cell(source)?)?, GOOD)
    } else {
        of_bag(&Bag::open(source)?)?
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

/// The plans of a recording, each as it was published last.
fn plans(bag: &Bag, source: &Path) -> anyhow::Result<Vec<InspectionPlan>> {
    let namespace = &record::namespace(bag, source)?;
    let mut plans: Vec<InspectionPlan> = Vec::new();
    for plan in (Reader { bag, namespace }).all::<InspectionPlan>(topics::INSPECTION_PLAN)? {
        plans.retain(|known| known.plan_id != plan.plan_id);
        plans.push(plan);
    }
    Ok(plans)
}

fn list(plans: Vec<InspectionPlan>, as_json: bool, selection: &Selection) -> anyhow::Result<u8> {
    let of_part = |plan: &InspectionPlan, name: &str| {
        let rest = plan.plan_id.strip_prefix(name);
        rest.is_some_and(|rest| rest.starts_with('/') || rest.starts_with('#'))
    };
    let at = |plan: &InspectionPlan| plan.header.stamp.nanos();
    let wanted = selection.of(plans, of_part, at);
    if as_json {
        let plan = |one: &InspectionPlan| {
            let (touches, features) = (one.points.len(), one.features.len());
            json!({ "plan_id": one.plan_id, "part_id": one.part_id, "at_ns": at(one), "touches": touches, "features": features })
        };
        output::json(&json!({ "plans": wanted.iter().map(plan).collect::<Vec<_>>() }))?;
        return Ok(GOOD);
    }
    let row = |one: &InspectionPlan| {
        let at = humantime::format_rfc3339_seconds(one.header.stamp.into()).to_string();
        let (touches, features) = (one.points.len().to_string(), one.features.len().to_string());
        [
            at.replace('T', " ").replace('Z', ""),
            touches,
            features,
            one.plan_id.clone(),
        ]
    };
    let rows: Vec<_> = wanted.iter().map(row).collect();
    output::table(["planned (UTC)", "touches", "features", "plan"], &rows);
    Ok(GOOD)
}

/// What [`Cell::measuring_order`] finds, with progress on a terminal.
pub(super) fn of_cell(cell: &Cell) -> anyhow::Result<Planned> {
    let plan = |progress: &mut dyn FnMut(&_)| cell.measuring_order(0.0, &|_| true, progress);
    Ok(output::with_progress(plan)?)
}

/// What [`session_io::order::measuring_order`] finds, with progress on a terminal, and the exit status.
fn of_bag(bag: &Bag) -> anyhow::Result<(Planned, u8)> {
    let plan = |progress: &mut dyn FnMut(&_)| measuring_order(bag, None, &|_| true, progress);
    let (planned, damage) = output::with_progress(plan)?;
    Ok((planned, output::damage(&damage)))
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
    for line in lines(&features) {
        output::line(&line);
    }
    Ok(status)
}
