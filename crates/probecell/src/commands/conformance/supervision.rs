//! What ends a measurement: a STOP, a gate that falls silent, and one that is another process than before. And that a driver
//! follows a gate that was restarted after its wall clock was set back.

use std::time::{Duration, Instant};

use cell::Cell;
use graph::{Stamp, supervision::GATE_SILENCE};
use machine::Chain;
use probecell_msgs::{ControllerCommand, ControllerReply, MachineState};

use super::{
    commands::{STOP_LIMIT, of_kind, outcome, reply_fields},
    gate::Gate,
    judge::Judge,
    measuring::{Measurement, await_touches, begin, next_sequence, touches},
};

/// Touches after which a measurement is ended.
const TOUCHES: usize = 2;
/// In which a machine that is to stand is looked at.
const STANDING: Duration = Duration::from_millis(600);
/// m or rad by which the readings of an axis that stands may differ.
const STILL: f64 = 20e-6;
/// In which the driver has to have stopped its machine, and said so, once the gate is silent.
const SILENCE_LIMIT: Duration = Duration::from_secs(3);
/// Prefix of the text of a reply to what ended for want of a gate.
const GATE_LOST: &str = "gate_lost: ";

/// All of it.
pub(super) fn check(gate: &mut Gate, judge: &mut Judge, cell: &Cell) -> anyhow::Result<()> {
    let chain = cell.chain()?;
    stop(gate, judge, cell, &chain)?;
    judge.begin("silent gate");
    let run = begin(gate, cell, false)?;
    if await_touches(gate, judge, &run, 1) {
        gate.be_silent(true);
        let silent = Instant::now();
        lost(gate, judge, &run, silent, &chain);
        gate.be_set_back();
    }
    end_run(gate, &run);
    judge.end(&format!(
        "the machine stops, {GATE_SILENCE} s after the last sign of life"
    ));

    judge.begin("gate restarted with its clock set back");
    let run = begin(gate, cell, false)?;
    let done = (ControllerReply::DONE, run.limit);
    outcome(gate, judge, run.mark, &run.command, done);
    end_run(gate, &run);
    judge.end("heartbeats of a process with an earlier start count once the known one is silent");

    judge.begin("replaced gate");
    let run = begin(gate, cell, false)?;
    if await_touches(gate, judge, &run, 1) {
        gate.be_replaced();
        lost(gate, judge, &run, Instant::now(), &chain);
    }
    end_run(gate, &run);
    judge.end("what another process of the gate has begun ends");
    Ok(())
}

/// What goes on although it should have ended must not disturb the next check.
fn end_run(gate: &mut Gate, run: &Measurement) {
    gate.be_silent(false);
    if gate.replies(run.mark, run.command.command_id).is_empty() {
        let mark = gate.mark();
        let command = gate.command(of_kind(ControllerCommand::STOP));
        gate.reply(mark, command.command_id, STOP_LIMIT);
    }
    gate.receive_until(STOP_LIMIT, |gate| {
        let last = gate.last();
        last.is_some_and(|sample| sample.execution == MachineState::EXECUTION_IDLE)
    });
}

/// STOP in mid-measurement, whose plan comes after its command.
fn stop(gate: &mut Gate, judge: &mut Judge, cell: &Cell, chain: &Chain) -> anyhow::Result<()> {
    judge.begin("STOP in mid-measurement");
    let next = next_sequence(gate);
    let run = begin(gate, cell, true)?;
    if await_touches(gate, judge, &run, TOUCHES) {
        let mark = gate.mark();
        let command = gate.command(of_kind(ControllerCommand::STOP));
        let wanted = (ControllerReply::FAILED, STOP_LIMIT);
        let done = (ControllerReply::DONE, STOP_LIMIT);
        let reply = outcome(gate, judge, mark, &command, done);
        outcome(gate, judge, run.mark, &run.command, wanted);
        if let Some(reply) = reply {
            stands(gate, judge, &run, &reply, chain);
        }
    }
    end_run(gate, &run);
    let found = gate.triggers(run.mark);
    let first = found.first().map(|trigger| trigger.sequence);
    judge.demand(
        first == next,
        "probe_triggers.sequence",
        format!("{}: it goes on within a session", next.unwrap_or_default()),
        first.map_or("none".to_owned(), |first| first.to_string()),
    );
    judge.end("the running command is reported FAILED, the STOP is DONE, and the machine is at standstill");

    judge.begin("measurement after a STOP");
    let next = next_sequence(gate);
    let run = begin(gate, cell, true)?;
    outcome(
        gate,
        judge,
        run.mark,
        &run.command,
        (ControllerReply::DONE, run.limit),
    );
    let wanted = run.order.order.len();
    gate.receive_until(Duration::from_secs(1), |gate| {
        gate.triggers(run.mark).len() >= wanted
    });
    // The samples around the last touch.
    gate.hear_for(Duration::from_millis(200));
    touches(gate, judge, &run, chain, next);
    end_run(gate, &run);
    judge.end("it begins anew although its plan comes after the command, and touches count on");
    Ok(())
}

/// The measurement has failed for want of a gate, and the machine stands.
fn lost(gate: &mut Gate, judge: &mut Judge, run: &Measurement, since: Instant, chain: &Chain) {
    let Some(reply) = gate.reply(run.mark, run.command.command_id, SILENCE_LIMIT) else {
        let expected = format!("FAILED within {} s", SILENCE_LIMIT.as_secs());
        return judge.wrong(
            "controller_replies",
            expected,
            "no reply: the machine goes on",
        );
    };
    judge.demand(
        reply.outcome == ControllerReply::FAILED,
        "controller_replies.outcome",
        "FAILED",
        format!(
            "{} {:.1} s after the gate was gone",
            super::commands::outcome_name(reply.outcome),
            since.elapsed().as_secs_f64()
        ),
    );
    judge.demand(
        reply.text.starts_with(GATE_LOST),
        "controller_replies.text",
        format!("a text that begins with {GATE_LOST:?}"),
        format!("{:?}", reply.text),
    );
    reply_fields(judge, gate, run.mark, &run.command, &reply);
    stands(gate, judge, run, &reply, chain);
}

/// From a reply on no axis moves, nothing is touched, and the machine does not run.
fn stands(
    gate: &mut Gate,
    judge: &mut Judge,
    run: &Measurement,
    reply: &ControllerReply,
    chain: &Chain,
) {
    gate.hear_for(STANDING);
    let end = Stamp::from(&reply.header.stamp);
    let samples: Vec<_> = gate
        .samples(run.mark)
        .filter(|sample| Stamp::from(&sample.header.stamp) > end)
        .collect();
    let Some(first) = samples.first() else {
        return judge.wrong("controller_status", "samples after the reply", "none");
    };
    for sample in &samples {
        let both = (
            chain.positions(&first.axis_names, &first.axis_positions),
            chain.positions(&sample.axis_names, &sample.axis_positions),
        );
        let (Ok(first), Ok(now)) = both else {
            continue;
        };
        for (name, (first, now)) in chain.axis_names().zip(first.iter().zip(&now)) {
            judge.demand(
                (now - first).abs() <= STILL,
                "axis_positions",
                format!(
                    "{name} still at {first:.6} m or rad, although the reply reports standstill"
                ),
                format!("{now:.6}"),
            );
        }
    }
    let last = samples.last().map_or(0, |sample| sample.execution);
    judge.demand(
        last != MachineState::EXECUTION_RUNNING,
        "execution",
        "not 1 (running) after the reply",
        last,
    );
    let late = gate
        .triggers(run.mark)
        .iter()
        .filter(|trigger| Stamp::from(&trigger.header.stamp) > end)
        .count();
    judge.demand(
        late == 0,
        "probe_triggers",
        "no touch after the reply",
        late,
    );
}
