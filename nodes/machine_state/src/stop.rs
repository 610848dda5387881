//! Stops the machine, and informs the requester whether the driver has confirmed it.

use graph::Stamp;
use probecell_msgs::{
    ControllerCommand, ControllerReply, MachineState, OperationReport, OperatorReply,
};

use crate::{
    command,
    config::Config,
    ports::{Out, Output},
    report,
    state::{Asker, State, Stop},
};

/// s in which a driver has to confirm a stop.
const STOP_LIMIT: f64 = 5.0;

/// Tells the driver to stop. A measurement that waits for its order is given up, so that it cannot begin afterwards.
pub(crate) fn stop(config: &Config, state: &mut State, now: Stamp, asked_by: Asker, out: &mut Out) {
    state.order = None;
    if let Some(awaited) = state.awaited.take() {
        let (id, text) = (
            awaited.request.request_id,
            "the machine was commanded to stop",
        );
        report::report(state, now, id, OperationReport::FAILED, text, out);
    }
    let controller = state.controller.as_ref();
    let execution = controller.map(|known| (known.lost, known.status.execution));
    let unanswered = match execution {
        _ if config.replayed => Some((false, "this graph runs on a recording")),
        None => Some((false, "no sample of the controller has been received")),
        Some((_, MachineState::EXECUTION_ESTOP)) => {
            Some((true, "the machine is in emergency stop"))
        }
        Some((true, _)) => Some((
            false,
            "the controller sends no samples: it is not known whether the machine is at standstill",
        )),
        Some((false, _)) => None,
    };
    // A controller that sends nothing may still hear.
    if execution.is_some_and(|(_, execution)| execution != MachineState::EXECUTION_ESTOP)
        && !config.replayed
    {
        let command = ControllerCommand {
            kind: ControllerCommand::STOP,
            ..ControllerCommand::default()
        };
        let command_id = command::send(state, now, command, out);
        if unanswered.is_none() {
            let until = now.after_s(STOP_LIMIT);
            state.stops.insert(command_id, Stop { asked_by, until });
        }
    }
    if let Some((stands, text)) = unanswered {
        answer(state, now, asked_by, stands, text, out);
    }
}

/// Takes the reply to a command to stop; false when the reply is to another command. A machine that stands has done what earlier
/// commands asked for, too, those included that were sent to a driver that has ended since.
pub(crate) fn confirm(
    state: &mut State,
    now: Stamp,
    reply: &ControllerReply,
    out: &mut Out,
) -> bool {
    let Some(stop) = state.stops.remove(&reply.command_id) else {
        return false;
    };
    let stands = reply.outcome == ControllerReply::DONE;
    let mut answered = vec![stop.asked_by];
    if stands {
        report::fail(state, now, "stopped", out);
        let later = state.stops.split_off(&reply.command_id);
        let earlier = std::mem::replace(&mut state.stops, later);
        answered.extend(earlier.into_values().map(|one| one.asked_by));
    }
    for asked_by in answered {
        answer(state, now, asked_by, stands, &reply.text, out);
    }
    true
}

/// Commands that the driver has not confirmed in time.
pub(crate) fn expire(state: &mut State, now: Stamp, out: &mut Out) {
    let overdue = |(_, stop): &(&u64, &Stop)| now > stop.until;
    let overdue: Vec<u64> = (state.stops.iter().filter(overdue))
        .map(|(command_id, _)| *command_id)
        .collect();
    for command_id in overdue {
        if let Some(stop) = state.stops.remove(&command_id) {
            let text = format!("the driver has not confirmed the stop within {STOP_LIMIT} s");
            answer(state, now, stop.asked_by, false, &text, out);
        }
    }
}

fn answer(state: &mut State, now: Stamp, asked_by: Asker, stands: bool, text: &str, out: &mut Out) {
    match asked_by {
        Asker::Gate => {}
        Asker::Cycle(request_id) => {
            let outcome = if stands {
                OperationReport::DONE
            } else {
                OperationReport::FAILED
            };
            report::report(state, now, request_id, outcome, text, out);
        }
        Asker::Operator(request_id) => out.send(Output::Stopped(OperatorReply {
            header: now.header(""),
            request_id,
            accepted: stands,
            text: text.to_owned(),
        })),
    }
}
