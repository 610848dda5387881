//! What the driver says of its machine, field by field.

use std::{collections::BTreeSet, time::Duration};

use cell::Cell;
use graph::{Stamp, topics};
use machine::Chain;
use probecell_msgs::{ControllerStatus, MachineState};

use super::{
    gate::{Gate, Observation, What},
    judge::Judge,
};

/// Time in which samples are looked at.
const LOOK: Duration = Duration::from_secs(2);
/// Time in which the first sample has to come.
const FIRST: Duration = Duration::from_secs(5);
/// s between two samples at most: half of what the gate waits before it takes the controller for lost.
const LONGEST_GAP: f64 = 0.5;
/// s by which a stamp may be off the clock of this computer.
const CLOCK_LIMIT: f64 = 0.5;
/// m or rad by which a reading may lie outside of the limits of its axis.
const LIMIT_TOLERANCE: f64 = 1e-3;

/// Looks at samples; false when none can be used.
pub(super) fn check(gate: &mut Gate, judge: &mut Judge, cell: &Cell) -> anyhow::Result<bool> {
    let chain = cell.chain()?;
    judge.begin("samples");
    let mark = gate.mark();
    if !gate.receive_until(FIRST, |gate| gate.samples(mark).next().is_some()) {
        unreadable(gate, judge);
        judge.wrong(
            topics::CONTROLLER_STATUS.name,
            format!("a sample within {} s", FIRST.as_secs()),
            "none (on Zenoh, one without rmw_zenoh's attachment of 33 bytes is not taken)",
        );
        return Ok(judge.end(""));
    }
    gate.hear_for(LOOK);
    unreadable(gate, judge);
    stream(gate, judge, mark);
    let samples: Vec<ControllerStatus> = gate.samples(mark).cloned().collect();
    for sample in &samples {
        axes(judge, sample, &chain);
        fields(judge, sample);
    }
    if let Some(last) = samples.last() {
        corrected(judge, last, cell);
    }
    let text = format!(
        "{} in {} s, session {:?}, axes {}",
        samples.len(),
        LOOK.as_secs(),
        gate.session(),
        chain.axis_names().collect::<Vec<_>>().join(" ")
    );
    judge.end(&text);
    // Commands need a session, and motion needs positions inside the travel; the rest may be wrong.
    let usable = |sample: &ControllerStatus| {
        let positions = chain.positions(&sample.axis_names, &sample.axis_positions);
        !sample.session.is_empty() && positions.is_ok_and(|all| is_inside(&chain, &all))
    };
    Ok(samples.last().is_some_and(usable))
}

/// Positions of all axes lie inside their travel.
fn is_inside(chain: &Chain, positions: &[f64]) -> bool {
    let travels = (0..positions.len()).map(|index| chain.axis(index).limits);
    travels.zip(positions).all(|(travel, position)| {
        travel.is_none_or(|(lower, upper)| {
            (lower - LIMIT_TOLERANCE..=upper + LIMIT_TOLERANCE).contains(position)
        })
    })
}

/// Numbers that are missing at the end of all checks, messages that could not be read, and commands that were answered more than
/// once: a second reply may come after the check of its command.
pub(super) fn nothing_lost(gate: &mut Gate, judge: &mut Judge) {
    gate.hear_for(Duration::from_millis(100));
    judge.begin("replies");
    for (command_id, count) in gate.counts_of_replies() {
        judge.demand(
            count == 1,
            "controller_replies",
            "one reply to a command",
            format!("{count} replies to command {command_id}"),
        );
    }
    judge.end("no command was answered twice");
    judge.begin("numbers");
    unreadable(gate, judge);
    for heard in gate.since(0) {
        if let What::Lost(lost) = &heard.what {
            judge.wrong(
                &format!("{} attachment.sequence", heard.topic),
                format!("{}, the number after the last one", lost.first),
                lost.first + lost.count,
            );
        }
    }
    judge.end("every publisher counts without gaps");
}

fn unreadable(gate: &Gate, judge: &mut Judge) {
    for Observation { topic, what, .. } in gate.since(0) {
        if let What::Unreadable(why) = what {
            judge.wrong(topic, "CDR of its type", why);
        }
    }
}

/// Session, stamps and clocks of the samples since a mark.
fn stream(gate: &Gate, judge: &mut Judge, mark: usize) {
    let session = gate.session();
    let mut before: Option<Stamp> = None;
    for heard in gate.since(mark) {
        let What::Status(sample) = &heard.what else {
            continue;
        };
        judge.demand(!sample.session.is_empty(), "session", "a name", "\"\"");
        judge.demand(
            sample.session == session,
            "session",
            format!("{session:?} as long as the driver runs"),
            format!("{:?}", sample.session),
        );
        let stamp = Stamp::from(&sample.header.stamp);
        let off = Stamp(heard.received).since_s(stamp);
        judge.demand(
            off.abs() <= CLOCK_LIMIT,
            "header.stamp",
            format!("the time since 1970, at most {CLOCK_LIMIT} s off this computer's clock"),
            format!("{off:+.3} s before it"),
        );
        let off = Stamp(heard.received).since_s(Stamp(heard.source));
        judge.demand(
            off.abs() <= CLOCK_LIMIT,
            "attachment.source_time",
            format!("ns since 1970, at most {CLOCK_LIMIT} s off this computer's clock"),
            format!("{off:+.3} s before it"),
        );
        if let Some(before) = before {
            let step = stamp.since_s(before);
            judge.demand(
                step > 0.0,
                "header.stamp",
                "later than the one before",
                format!("{step} s"),
            );
            judge.demand(
                step <= LONGEST_GAP,
                "header.stamp",
                format!("at most {LONGEST_GAP} s after the one before"),
                format!("{step:.3} s"),
            );
        }
        before = Some(stamp);
    }
}

fn axes(judge: &mut Judge, sample: &ControllerStatus, chain: &Chain) {
    let names: BTreeSet<&str> = chain.axis_names().collect();
    let came: BTreeSet<&str> = sample.axis_names.iter().map(String::as_str).collect();
    judge.demand(
        names == came && sample.axis_names.len() == names.len(),
        "axis_names",
        format!("each of {names:?} once"),
        format!("{:?}", sample.axis_names),
    );
    numbers(
        judge,
        "axis_positions",
        &sample.axis_positions,
        sample.axis_names.len(),
    );
    for (field, values) in [
        ("axis_commands", &sample.axis_commands),
        ("axis_velocities", &sample.axis_velocities),
        ("axis_efforts", &sample.axis_efforts),
    ] {
        if !values.is_empty() {
            numbers(judge, field, values, sample.axis_names.len());
        }
    }
    for (name, position) in sample.axis_names.iter().zip(&sample.axis_positions) {
        let limits = chain
            .axis_index(name)
            .and_then(|index| chain.axis(index).limits);
        if let Some((lower, upper)) = limits {
            judge.demand(
                (lower - LIMIT_TOLERANCE..=upper + LIMIT_TOLERANCE).contains(position),
                "axis_positions",
                format!(
                    "{name} between {lower} and {upper} (m or rad) as in the robot description"
                ),
                position,
            );
        }
    }
}

/// A list of as many finite numbers as there are names.
fn numbers(judge: &mut Judge, field: &str, values: &[f64], count: usize) {
    judge.demand(
        values.len() == count && values.iter().all(|value| value.is_finite()),
        field,
        format!("{count} finite numbers, one for each name"),
        format!("{values:?}"),
    );
}

fn fields(judge: &mut Judge, sample: &ControllerStatus) {
    judge.demand(
        sample.mode <= MachineState::MODE_AUTO,
        "mode",
        "0 (manual), 1 (MDI) or 2 (auto)",
        sample.mode,
    );
    judge.demand(
        sample.execution <= MachineState::EXECUTION_ESTOP,
        "execution",
        "0 (idle), 1 (running), 2 (hold), 3 (alarm) or 4 (emergency stop)",
        sample.execution,
    );
    judge.demand(
        sample.feed_override.is_finite() && (0.0..=10.0).contains(&sample.feed_override),
        "feed_override",
        "a share between 0 and 10 (1.0 = 100 %)",
        sample.feed_override,
    );
    judge.demand(
        sample.spindle_speed.is_finite(),
        "spindle_speed",
        "a finite number, rad/s",
        sample.spindle_speed,
    );
    numbers(
        judge,
        "temperatures",
        &sample.temperatures,
        sample.temperature_names.len(),
    );
    numbers(
        judge,
        "tool_wear",
        &sample.tool_wear,
        sample.tool_numbers.len(),
    );
    numbers(
        judge,
        "volumetric_values",
        &sample.volumetric_values,
        sample.volumetric_entries.len(),
    );
    numbers(
        judge,
        "work_offsets",
        &sample.work_offsets,
        sample.work_offset_axes.len(),
    );
    let tools: BTreeSet<u32> = sample.tool_numbers.iter().copied().collect();
    judge.demand(
        tools.len() == sample.tool_numbers.len(),
        "tool_numbers",
        "each tool once",
        format!("{:?}", sample.tool_numbers),
    );
}

/// What the cell corrects is among what the controller holds.
fn corrected(judge: &mut Judge, sample: &ControllerStatus, cell: &Cell) {
    let compensation = &cell.compensation;
    for tool in compensation
        .characteristics
        .iter()
        .filter_map(|one| one.tool_number)
    {
        judge.demand(
            sample.tool_numbers.contains(&tool),
            "tool_numbers",
            format!("tool {tool} among them, which the cell corrects"),
            format!("{:?}", sample.tool_numbers),
        );
    }
    for axis in compensation.work_offset.iter().flat_map(|own| &own.axes) {
        judge.demand(
            sample.work_offset_axes.contains(axis),
            "work_offset_axes",
            format!("{axis} among them, which the cell corrects"),
            format!("{:?}", sample.work_offset_axes),
        );
    }
    for entry in compensation.volumetric.iter().flat_map(|own| &own.links) {
        judge.demand(
            sample.volumetric_entries.contains(entry),
            "volumetric_entries",
            format!("{entry} among them, which the cell corrects"),
            format!("{:?}", sample.volumetric_entries),
        );
    }
}
