//! Operations: requests of the cycle become commands of the driver, and its replies become reports.

use graph::{FaultCode, Stamp};
use probecell_msgs::{
    ControllerCommand, ControllerReply, MachineState, OperationReport, OperationRequest,
    OperationRequestKind, RecordingStatus,
};

use crate::{
    active_faults::{clear, raise},
    command,
    config::Config,
    drivers, part,
    ports::{MachineFault, Out, Output},
    report, signals,
    state::{Asker, Awaited, Operation, State, Writing},
    stop, writing,
};

/// Time after its start in which the gate waits for the first report of the recorder, which comes every second, s.
const RECORDER_TIMEOUT: f64 = 10.0;

/// Why the machine accepts no request at all.
pub(crate) fn refusal(config: &Config, state: &State) -> Option<&'static str> {
    match &state.controller {
        _ if config.replayed => Some("this graph runs on a recording"),
        None => Some("no sample of the controller has been received"),
        Some(known) if known.lost => Some("the controller sends no samples"),
        Some(known) if known.status.execution == MachineState::EXECUTION_ESTOP => {
            Some("the machine is in emergency stop")
        }
        Some(_) if drivers::are_several(state) => Some(drivers::SEVERAL),
        Some(_) => None,
    }
}

/// Why nothing may be cut or measured now.
fn unrecorded(state: &State, now: Stamp) -> Option<&'static str> {
    let Some((status, at)) = &state.recording else {
        return Some("no recorder has reported: the cell must not run unrecorded");
    };
    let holds = status.validity == 0.0 || now.since_s(*at) <= status.validity;
    match status.state {
        RecordingStatus::RECORDING | RecordingStatus::WAIVED if holds => None,
        RecordingStatus::RECORDING => {
            Some("the recorder has fallen silent: the cell must not run unrecorded")
        }
        _ if status.hangs() => {
            Some("the disk of the recording does not answer: the cell must not run unrecorded")
        }
        _ => Some("nothing is recorded: start a recording first"),
    }
}

/// The recorder has not reported yet, and is not late: the processes of a cell discover each other in any order.
fn is_recorder_awaited(state: &State, now: Stamp) -> bool {
    let started = Stamp(state.started as i64);
    state.recording.is_none() && now.since_s(started) <= RECORDER_TIMEOUT
}

/// Takes a request once. One that is repeated is answered by the last report on it. While the driver has not confirmed a stop,
/// nothing is begun, since the stop would end it, and neither is it before a clamping or the recorder is known: `cycle` repeats
/// its request.
pub(crate) fn request(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: OperationRequest,
    out: &mut Out,
) {
    match &state.taken {
        Some((taken, _)) if *taken > request.request_id => return,
        Some((taken, answer)) if *taken == request.request_id => {
            match answer {
                Some(answer) => out.send(Output::Report(answer.clone())),
                None => underway(state, now, out),
            }
            return;
        }
        _ if request.kind != OperationRequest::STOP
            && (!state.stops.is_empty()
                || signals::is_awaited(config, state, now)
                || is_recorder_awaited(state, now)) =>
        {
            return;
        }
        _ => state.taken = Some((request.request_id, None)),
    }
    carry_out(config, state, now, request, out);
    if matches!(state.taken, Some((_, None))) {
        underway(state, now, out);
    }
}

/// Reports that the request taken last is under way.
pub(crate) fn underway(state: &mut State, now: Stamp, out: &mut Out) {
    if let Some((request_id, None)) = state.taken {
        state.told = now;
        out.send(Output::Report(OperationReport {
            header: now.header(""),
            request_id,
            outcome: OperationReport::UNDERWAY,
            text: String::new(),
        }));
    }
}

/// Begins what was requested, or waits for the order of a measurement.
pub(crate) fn carry_out(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: OperationRequest,
    out: &mut Out,
) {
    // A request that is not understood stops the machine.
    let kind = OperationRequestKind::try_from(request.kind);
    let kind = match kind.unwrap_or(OperationRequestKind::Stop) {
        OperationRequestKind::Cut => ControllerCommand::RUN_OPERATION,
        OperationRequestKind::Measure => ControllerCommand::RUN_MEASUREMENT,
        OperationRequestKind::Stop => {
            return stop::stop(config, state, now, Asker::Cycle(request.request_id), out);
        }
    };
    let busy = state.operation.is_some() || state.awaited.is_some();
    let refusal = refusal(config, state)
        .or_else(|| unrecorded(state, now))
        .or(busy.then_some("the machine is busy"))
        .or_else(|| {
            let stopped = part::is_stopped(state, &request.run_id);
            stopped.then_some("an operator has stopped the machine")
        })
        .map(str::to_owned)
        .or_else(|| signals::refusal(config, state, now));
    if let Some(text) = refusal {
        state.order = None;
        let id = request.request_id;
        report::report(state, now, id, OperationReport::REFUSED, &text, out);
        return;
    }
    let mut order = Vec::new();
    if kind == ControllerCommand::RUN_MEASUREMENT {
        // Taken: the same plan, measured again, has another order.
        match state.order.take() {
            Some((plan, indices)) if plan == request.plan_id => order = indices,
            _ => {
                state.awaited = Some(Awaited {
                    request,
                    until: now.after_s(config.order_limit),
                });
                return;
            }
        }
        // Nothing may be corrected from what was only measured.
        if !request.only_measure {
            let asked = Stamp::from(&request.header.stamp);
            state.measured.insert(request.plan_id.clone(), asked);
        }
    }
    let command = ControllerCommand {
        kind,
        operation: request.operation,
        plan_id: request.plan_id,
        order,
        run_id: request.run_id,
        ..ControllerCommand::default()
    };
    let command_id = command::send(state, now, command, out);
    state.operation = Some(Operation {
        request_id: request.request_id,
        command_id,
        idle: None,
    });
}

/// Passes the driver's reply to a command on to the correction or the operation that it belongs to.
pub(crate) fn answer(state: &mut State, now: Stamp, reply: &ControllerReply, out: &mut Out) {
    if state
        .controller
        .as_ref()
        .is_none_or(|known| known.status.session != reply.session)
    {
        return;
    }
    if stop::confirm(state, now, reply, out) {
        return;
    }
    if let Some(Writing { correction, .. }) = state.writing.remove(&reply.command_id) {
        return writing::reply(state, now, &correction, reply, out);
    }
    if let Some(operation) = state
        .operation
        .take_if(|operation| operation.command_id == reply.command_id)
    {
        let outcome = match reply.outcome {
            ControllerReply::DONE => OperationReport::DONE,
            ControllerReply::REFUSED => OperationReport::REFUSED,
            _ => OperationReport::FAILED,
        };
        if outcome == OperationReport::FAILED
            && let Some((fault, text)) = driver_fault(&reply.text)
        {
            raise(state, now, fault, text, out);
            clear(state, fault);
        }
        report::report(state, now, operation.request_id, outcome, &reply.text, out);
    }
}

/// The fault whose code a driver puts before its sentence: `probe_stuck: the probe ...`. A code that is not in the table
/// is reported as an alarm of the controller, with the whole text.
fn driver_fault(text: &str) -> Option<(MachineFault, &str)> {
    let (code, sentence) = text.split_once(": ")?;
    let letter = |byte: u8| byte.is_ascii_lowercase() || byte == b'_';
    if code.is_empty() || !code.bytes().all(letter) {
        return None;
    }
    let known = MachineFault::from_code(code).map(|fault| (fault, sentence));
    Some(known.unwrap_or((MachineFault::ControllerAlarm, text)))
}
