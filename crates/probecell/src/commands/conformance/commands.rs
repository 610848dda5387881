//! Commands that are answered at once, and a cut.

use std::{collections::BTreeSet, time::Duration};

use cell::Cell;
use graph::{Stamp, topics};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, MachineState, offset as offsets_of,
};

use super::{gate::Gate, judge::Judge};

/// In which a STOP has to be answered: what the gate waits for.
pub(super) const STOP_LIMIT: Duration = Duration::from_secs(5);
/// In which a driver has to refuse, or to write an offset.
const ANSWER_LIMIT: Duration = Duration::from_secs(10);
/// In which a second answer would come.
const REPEAT: Duration = Duration::from_millis(500);
/// m or rad by which offsets are moved, and moved back.
const STEP: f64 = 1e-6;
/// A kind of command that does not exist.
const NO_KIND: u8 = 200;
/// In which an operation has to end.
const CUT_LIMIT: Duration = Duration::from_secs(3600);

/// The fields that every reply has.
pub(super) fn reply_fields(
    judge: &mut Judge,
    gate: &Gate,
    mark: usize,
    command: &ControllerCommand,
    reply: &ControllerReply,
) {
    judge.demand(
        reply.session == gate.session(),
        "controller_replies.session",
        format!("{:?}, that of the samples", gate.session()),
        format!("{:?}", reply.session),
    );
    judge.demand(
        reply.outcome == ControllerReply::DONE || !reply.text.is_empty(),
        "controller_replies.text",
        "a reason, as the outcome is not DONE",
        "\"\"",
    );
    let age = Stamp::from(&reply.header.stamp).since_s(Stamp::from(&command.header.stamp));
    judge.demand(
        age > -0.1,
        "controller_replies.header.stamp",
        "the instant of the outcome, after that of the command",
        format!("{:.3} s before it", -age),
    );
    let count = gate.replies(mark, command.command_id).len();
    judge.demand(
        count == 1,
        "controller_replies",
        "one reply to a command",
        format!("{count} replies"),
    );
}

/// Demands an outcome of a command that was sent at `mark`.
pub(super) fn outcome(
    gate: &mut Gate,
    judge: &mut Judge,
    mark: usize,
    command: &ControllerCommand,
    (wanted, within): (u8, Duration),
) -> Option<ControllerReply> {
    let reply = gate.reply(mark, command.command_id, within);
    let Some(reply) = reply else {
        let expected = format!("{} within {} s", outcome_name(wanted), within.as_secs());
        judge.wrong("controller_replies", expected, "no reply");
        return None;
    };
    judge.demand(
        reply.outcome == wanted,
        "controller_replies.outcome",
        outcome_name(wanted),
        format!("{} {:?}", outcome_name(reply.outcome), reply.text),
    );
    reply_fields(judge, gate, mark, command, &reply);
    Some(reply)
}

pub(super) fn outcome_name(outcome: u8) -> String {
    match outcome {
        ControllerReply::DONE => "DONE".to_owned(),
        ControllerReply::REFUSED => "REFUSED".to_owned(),
        ControllerReply::FAILED => "FAILED".to_owned(),
        other => format!("outcome {other}, which does not exist"),
    }
}

pub(super) fn of_kind(kind: u8) -> ControllerCommand {
    ControllerCommand {
        kind,
        ..ControllerCommand::default()
    }
}

/// The first word of a gate; false when it is not obeyed.
pub(super) fn stop(gate: &mut Gate, judge: &mut Judge) -> bool {
    judge.begin("first STOP");
    let mark = gate.mark();
    let command = gate.command(of_kind(ControllerCommand::STOP));
    outcome(
        gate,
        judge,
        mark,
        &command,
        (ControllerReply::DONE, STOP_LIMIT),
    );
    let idle = |gate: &Gate| {
        let last = gate.last();
        last.is_some_and(|sample| sample.execution == MachineState::EXECUTION_IDLE)
    };
    if judge.holds() && !gate.receive_until(Duration::from_secs(2), idle) {
        let came = gate.last().map_or(0, |sample| sample.execution);
        judge.wrong("execution", "0 (idle) after it", came);
    }
    judge.end("answered DONE, and the machine is idle")
}

/// Commands that no driver may carry out.
pub(super) fn refusals(gate: &mut Gate, judge: &mut Judge, operations: &[String]) {
    let refused = (ControllerReply::REFUSED, ANSWER_LIMIT);
    judge.begin("another session");
    let mark = gate.mark();
    let command = gate.command_as_addressed(ControllerCommand {
        session: format!("{}-of-yesterday", gate.session()),
        operation: operations.first().cloned().unwrap_or_default(),
        ..of_kind(ControllerCommand::RUN_OPERATION)
    });
    outcome(gate, judge, mark, &command, refused);
    judge.end("a command to a session that has ended is refused");

    judge.begin("unknown kind");
    let mark = gate.mark();
    let command = gate.command(of_kind(NO_KIND));
    outcome(gate, judge, mark, &command, refused);
    judge.end("a command of a kind that does not exist is refused");

    judge.begin("unknown operation");
    let mark = gate.mark();
    let command = gate.command(ControllerCommand {
        operation: "no such operation".to_owned(),
        run_id: "conformance".to_owned(),
        ..of_kind(ControllerCommand::RUN_OPERATION)
    });
    outcome(gate, judge, mark, &command, refused);
    judge.end("an operation that the machine does not have is refused");
}

/// Where an offset is written to, and where the samples show it.
type Shown = Box<dyn Fn(&Gate) -> Option<f64>>;

/// Writes each offset that the cell corrects, one micrometre off and back.
pub(super) fn offsets(gate: &mut Gate, judge: &mut Judge, cell: &Cell) {
    let compensation = &cell.compensation;
    let tools: BTreeSet<u32> = (compensation.characteristics.iter())
        .filter_map(|one| one.tool_number)
        .collect();
    for tool in &tools {
        let tool = *tool;
        let of = ControllerCommand {
            tool_number: tool,
            ..of_kind(ControllerCommand::SET_TOOL_WEAR)
        };
        let shown: Shown = Box::new(move |gate| {
            let sample = gate.last()?;
            let index = sample.tool_numbers.iter().position(|one| *one == tool)?;
            sample.tool_wear.get(index).copied()
        });
        offset(
            gate,
            judge,
            &format!("wear of tool {tool}"),
            ("tool_wear", &shown),
            &of,
        );
    }
    for axis in compensation
        .work_offset
        .iter()
        .flat_map(|own| own.axes.clone())
    {
        let of = ControllerCommand {
            axis: axis.clone(),
            ..of_kind(ControllerCommand::SET_WORK_OFFSET)
        };
        let name = format!("work offset of {axis}");
        let shown: Shown = Box::new(move |gate| {
            let sample = gate.last()?;
            let index = sample
                .work_offset_axes
                .iter()
                .position(|one| *one == axis)?;
            sample.work_offsets.get(index).copied()
        });
        offset(gate, judge, &name, ("work_offsets", &shown), &of);
    }
    if tools.is_empty() {
        judge.skip("offsets", "the cell corrects no tool wear");
        return;
    }
    judge.begin("wear that is no number");
    let mark = gate.mark();
    let command = gate.command(ControllerCommand {
        tool_number: tools.first().copied().unwrap_or_default(),
        value: f64::NAN,
        ..of_kind(ControllerCommand::SET_TOOL_WEAR)
    });
    outcome(
        gate,
        judge,
        mark,
        &command,
        (ControllerReply::REFUSED, ANSWER_LIMIT),
    );
    judge.end("NaN is refused");

    judge.begin("wear of an unknown tool");
    let mark = gate.mark();
    let known = gate.last().map(|sample| sample.tool_numbers.clone());
    let most = known.iter().flatten().max().copied().unwrap_or_default();
    let command = gate.command(ControllerCommand {
        tool_number: most + 1000,
        value: 0.0,
        ..of_kind(ControllerCommand::SET_TOOL_WEAR)
    });
    outcome(
        gate,
        judge,
        mark,
        &command,
        (ControllerReply::REFUSED, ANSWER_LIMIT),
    );
    judge.end("a tool that the controller does not have is refused");
}

fn offset(
    gate: &mut Gate,
    judge: &mut Judge,
    name: &str,
    (field, shown): (&str, &Shown),
    of: &ControllerCommand,
) {
    judge.begin(name);
    let Some(held) = shown(gate) else {
        judge.wrong(field, "a value in the samples", "none");
        judge.end("");
        return;
    };
    let mut first = None;
    for (before, value) in [(held, held + STEP), (held + STEP, held)] {
        let mark = gate.mark();
        let command = gate.command(ControllerCommand {
            value,
            ..of.clone()
        });
        let reply = outcome(
            gate,
            judge,
            mark,
            &command,
            (ControllerReply::DONE, ANSWER_LIMIT),
        );
        if let Some(reply) = reply {
            for (part, wanted, came) in [
                ("value_before", before, reply.value_before),
                ("value", value, reply.value),
            ] {
                judge.demand(
                    offsets_of::is_same(came, wanted),
                    &format!("controller_replies.{part}"),
                    format!("{wanted:e} m or rad"),
                    format!("{came:e}"),
                );
            }
        }
        let is_shown = |gate: &Gate| shown(gate).is_some_and(|now| offsets_of::is_same(now, value));
        if !gate.receive_until(Duration::from_secs(2), is_shown) {
            judge.wrong(
                &format!("controller_status.{field}"),
                format!("{value:e} after it was written"),
                shown(gate).map_or("none".to_owned(), |now| format!("{now:e}")),
            );
        }
        first.get_or_insert((mark, command));
    }
    if let Some((mark, command)) = first.filter(|_| judge.holds()) {
        // A transport may deliver twice.
        gate.send(&command);
        gate.hear_for(REPEAT);
        let count = gate.replies(mark, command.command_id).len();
        judge.demand(
            count == 1,
            "controller_replies",
            "no second reply to a command that is delivered twice",
            format!("{count} replies"),
        );
        judge.demand(
            shown(gate).is_some_and(|now| offsets_of::is_same(now, held)),
            &format!("controller_status.{field}"),
            format!("{held:e}, since a command that is delivered twice is carried out once"),
            shown(gate).map_or("none".to_owned(), |now| format!("{now:e}")),
        );
    }
    judge.end("written, read back, shown, and written once although delivered twice");
}

/// Cuts one operation.
pub(super) fn cut(gate: &mut Gate, judge: &mut Judge, cell: &Cell, operation: &str) {
    judge.begin(&format!("cut {operation}"));
    let mark = gate.mark();
    let command = gate.command(ControllerCommand {
        operation: operation.to_owned(),
        run_id: format!("{}-conformance", cell.cell.part),
        ..of_kind(ControllerCommand::RUN_OPERATION)
    });
    outcome(
        gate,
        judge,
        mark,
        &command,
        (ControllerReply::DONE, CUT_LIMIT),
    );
    runs_and_ends(gate, judge, mark);
    judge.end("runs, ends, and is reported DONE");
}

/// The samples since a mark show that a program ran, and that the machine is idle after it.
pub(super) fn runs_and_ends(gate: &mut Gate, judge: &mut Judge, mark: usize) {
    let is_running =
        |sample: &&ControllerStatus| sample.execution == MachineState::EXECUTION_RUNNING;
    let running = gate
        .samples(mark)
        .find(is_running)
        .map(|sample| sample.program.clone());
    match running {
        None => judge.wrong("execution", "1 (running) meanwhile", "never 1"),
        Some(program) => judge.demand(
            !program.is_empty(),
            "program",
            "a name while one runs",
            "\"\"",
        ),
    }
    let end = gate.mark();
    let idle = |gate: &Gate| {
        let mut samples = gate.samples(end);
        samples.any(|sample| sample.execution == MachineState::EXECUTION_IDLE)
    };
    if !gate.receive_until(Duration::from_secs(2), idle) {
        let came = gate.last().map_or(0, |sample| sample.execution);
        judge.wrong("execution", "0 (idle) after it", came);
    }
}

/// A measurement whose plan never comes moves nothing, and ends with a STOP.
pub(super) fn orders_that_never_come(gate: &mut Gate, judge: &mut Judge) {
    judge.begin("plan that never comes");
    let mark = gate.mark();
    let plan_id = gate.next_plan();
    let command = gate.command(ControllerCommand {
        plan_id,
        order: vec![0],
        ..of_kind(ControllerCommand::RUN_MEASUREMENT)
    });
    gate.hear_for(REPEAT);
    let early = gate.replies(mark, command.command_id);
    if early
        .iter()
        .all(|reply| reply.outcome != ControllerReply::REFUSED)
    {
        judge.demand(
            early.is_empty(),
            "controller_replies",
            "no outcome before the plan",
            "one",
        );
        let stop_mark = gate.mark();
        let stop = gate.command(of_kind(ControllerCommand::STOP));
        outcome(
            gate,
            judge,
            stop_mark,
            &stop,
            (ControllerReply::DONE, STOP_LIMIT),
        );
        outcome(
            gate,
            judge,
            mark,
            &command,
            (ControllerReply::FAILED, STOP_LIMIT),
        );
    } else {
        judge.wrong(
            "controller_replies.outcome",
            format!(
                "none: {} may come after the command",
                topics::MEASUREMENT_ORDER.name
            ),
            "REFUSED",
        );
    }
    let touched = gate.triggers(mark).len();
    judge.demand(touched == 0, "probe_triggers", "none", touched);
    judge.end("it waits, and a STOP ends it");
}
