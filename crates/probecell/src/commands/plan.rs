//! `probecell plan`: the measuring order of a cell's part, or of the plan in a recording.

use std::path::Path;

use anyhow::{Context, bail};
use bags::{Bag, Session};
use cell::Cell;
use graph::Stamp;
use machine::{Chain, Nominal};
use path_planning::Planned;
use serde_json::json;
use session_io::evaluation::{evaluate, lines};
use session_io::is_cell_file;
use session_io::order::measuring_order;

use crate::{GOOD, output, ros_arguments::read_cell};

/// Plans and prints.
pub(crate) fn run(source: &Path, as_json: bool) -> anyhow::Result<u8> {
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
