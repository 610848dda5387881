//! Operations: requests of the cycle become commands of the driver, and its replies become reports.

use graph::{FaultCode, Outbox, Stamp};
use probecell_msgs::{
    ControllerCommand, ControllerReply, MachineState, OperationReport, OperationRequest,
    OperationRequestKind,
};

use crate::{
    command,
    config::Config,
    ports::{MachineFault, Output},
    standing::{clear, raise},
    state::{Awaited, Operation, State, Writing},
    writing,
};

/// Why the machine accepts no request at all.
pub(crate) fn refusal(config: &Config, state: &State) -> Option<&'static str> {
    match &state.controller {
        _ if config.replayed => Some("this graph runs on a recording"),
        None => Some("no sample of the controller has been received"),
        Some(known) if known.lost => Some("the controller sends no samples"),
        Some(known) if known.status.execution == MachineState::EXECUTION_ESTOP => {
            Some("the machine is in emergency stop")
        }
        Some(_) => None,
    }
}

pub(crate) fn request(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: OperationRequest,
    out: &mut Outbox<Output>,
) {
    // A request that is not understood stops the machine.
    let kind = OperationRequestKind::try_from(request.kind);
    let kind = kind.unwrap_or(OperationRequestKind::Stop);
    let busy = kind != OperationRequestKind::Stop && state.operation.is_some();
    let refusal = refusal(config, state).or(busy.then_some("the machine is busy"));
    if let Some(text) = refusal {
        state.order = None;
        report(now, request.request_id, OperationReport::REFUSED, text, out);
        return;
    }
    let mut order = Vec::new();
    if kind == OperationRequestKind::Measure {
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
    let kind = match kind {
        OperationRequestKind::Cut => ControllerCommand::RUN_OPERATION,
        OperationRequestKind::Measure => ControllerCommand::RUN_MEASUREMENT,
        OperationRequestKind::Stop => ControllerCommand::STOP,
    };
    let command = ControllerCommand {
        kind,
        operation: request.operation,
        plan_id: request.plan_id,
        order,
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
pub(crate) fn answer(
    state: &mut State,
    now: Stamp,
    reply: &ControllerReply,
    out: &mut Outbox<Output>,
) {
    if state
        .controller
        .as_ref()
        .is_none_or(|known| known.status.session != reply.session)
    {
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
        report(now, operation.request_id, outcome, &reply.text, out);
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

pub(crate) fn fail(state: &mut State, now: Stamp, text: &str, out: &mut Outbox<Output>) {
    if let Some(operation) = state.operation.take() {
        report(
            now,
            operation.request_id,
            OperationReport::FAILED,
            text,
            out,
        );
    }
}

pub(crate) fn report(
    now: Stamp,
    request_id: u64,
    outcome: u8,
    text: &str,
    out: &mut Outbox<Output>,
) {
    let header = now.header("");
    out.send(Output::Report(OperationReport {
        header,
        request_id,
        outcome,
        text: text.to_owned(),
    }));
}
