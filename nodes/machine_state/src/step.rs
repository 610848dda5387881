//! The rules of `machine_state`.

use graph::{Node, Outbox, START, Stamp, inputs, outputs, topics};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction, CorrectionAcknowledgement,
    Fault, MachineState, MeasurementOrder, OperationReport, OperationRequest, PartReport,
    PlanProgress, ToolOffsets, sensor_msgs::JointState, std_msgs,
};

use crate::{
    config::Config,
    state::{Awaited, Controller, Operation, State, Writing},
    writing,
};

inputs! {
    /// What `machine_state` hears.
    pub enum Input {
        /// A raw sample of the controller.
        Status(ControllerStatus) = topics::CONTROLLER_STATUS,
        /// What came of a command.
        Reply(ControllerReply) = topics::CONTROLLER_REPLIES,
        /// What the cycle wants next.
        Request(OperationRequest) = topics::OPERATION_REQUESTS,
        /// The order in which a plan is measured.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// A correction, proposed or approved.
        Correction(Correction) = topics::CORRECTIONS,
        /// How a part ended: what was to be corrected for it is void.
        Part(PartReport) = topics::PART_REPORTS,
        /// How far the order of a plan is.
        Progress(PlanProgress) = topics::PLAN_PROGRESS,
    }
}

outputs! {
    /// What `machine_state` says.
    pub enum Output {
        /// The machine model.
        RobotDescription(std_msgs::String) = topics::ROBOT_DESCRIPTION,
        /// Readings of the axes.
        JointStates(JointState) = topics::JOINT_STATES,
        /// Commanded positions of the axes.
        JointCommands(JointState) = topics::JOINT_COMMANDS,
        /// What the machine is doing.
        State(MachineState) = topics::MACHINE_STATE,
        /// Wear offsets that the controller holds.
        ToolOffsets(ToolOffsets) = topics::TOOL_OFFSETS,
        /// What the driver is told.
        Command(ControllerCommand) = topics::CONTROLLER_COMMANDS,
        /// What came of a request.
        Report(OperationReport) = topics::OPERATION_REPORTS,
        /// What came of a correction.
        Acknowledgement(CorrectionAcknowledgement) = topics::CORRECTION_ACKNOWLEDGEMENTS,
        /// What went wrong.
        Fault(Fault) = topics::MACHINE_STATE_FAULTS,
    }
}

/// Timer that looks for silence and for overdue orders.
const WATCH: u32 = 1;
/// s between two looks.
const WATCH_PERIOD: f64 = 0.1;
/// Part of the alarm text by which a controller tells a touch outside a measuring move.
const UNPLANNED_TOUCH: &str = "probe tripped during non-probe";

/// The node.
pub struct MachineStateNode;

impl Node for MachineStateNode {
    const NAME: &'static str = "machine_state";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;

    fn start(_config: &Config) -> State {
        State::default()
    }

    fn step(
        config: &Config,
        state: &mut State,
        now: Stamp,
        input: Input,
        out: &mut Outbox<Output>,
    ) {
        match input {
            Input::Timer(id) => {
                if id == START {
                    // The driver may still answer commands of a process before this one.
                    state.next_command = now.0.unsigned_abs();
                    let description = std_msgs::String {
                        data: config.robot_description.clone(),
                    };
                    out.send(Output::RobotDescription(description));
                }
                watch(config, state, now, out);
                writing::give_up(config, state, now, out);
                writing::write_deferred(config, state, now, out);
                out.wake_at(now.after_s(WATCH_PERIOD), WATCH);
            }
            Input::Status(status) => {
                sample(config, state, now, status, out);
                // An operation may have failed with this sample.
                writing::write_deferred(config, state, now, out);
            }
            Input::Reply(reply) => {
                answer(state, now, &reply, out);
                writing::write_deferred(config, state, now, out);
            }
            Input::Request(request) => request_operation(config, state, now, request, out),
            Input::Order(order) => {
                // A request was refused, or will be: its order must not be taken for that of a later request.
                if unfit(config, state).is_none() {
                    state.order = Some((order.plan_id, order.order));
                }
                if let Some(awaited) = state.awaited.take() {
                    request_operation(config, state, now, awaited.request, out);
                }
            }
            Input::Progress(progress) => {
                // A long plan is no missing one.
                let of_plan = |one: &&mut Awaited| one.request.plan_id == progress.plan_id;
                if progress.phase != PlanProgress::GIVEN_UP
                    && let Some(awaited) = state.awaited.as_mut().filter(of_plan)
                {
                    awaited.until = now.after_s(config.order_limit);
                }
            }
            Input::Correction(correction) => writing::correct(config, state, now, correction, out),
            Input::Part(report) => {
                if [PartReport::STOPPED, PartReport::SCRAP].contains(&report.verdict) {
                    state.ended = state.ended.max(Some(Stamp::from(&report.header.stamp)));
                }
            }
        }
    }
}

/// Takes a sample in: new session, faults that begin or end, and the contract's messages.
fn sample(
    config: &Config,
    state: &mut State,
    now: Stamp,
    status: ControllerStatus,
    out: &mut Outbox<Output>,
) {
    let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
    if !finite(&status.axis_positions)
        || !finite(&status.axis_commands)
        || status.axis_positions.len() != status.axis_names.len()
    {
        let text = "a sample has an axis position that is missing or not a finite number";
        raise(state, now, "status_not_finite", text, out);
        return;
    }
    state.standing.remove("status_not_finite");
    if state
        .controller
        .as_ref()
        .is_some_and(|known| known.status.session != status.session)
    {
        fail_operation(state, now, "the driver was started again", out);
        raise(
            state,
            now,
            "controller_restarted",
            "the driver was started again: what it was doing is void",
            out,
        );
        state.standing.remove("controller_restarted");
        let standing = std::mem::take(&mut state.standing);
        *state = State {
            next_command: state.next_command,
            order: state.order.take(),
            standing,
            ..State::default()
        };
    }
    tell_faults(state, now, &status, out);
    publish(config, state, &status, out);
    if let Some(operation) = &mut state.operation {
        let idle = status.execution == MachineState::EXECUTION_IDLE;
        operation.idle = idle.then(|| operation.idle.unwrap_or(now));
    }
    state.controller = Some(Controller {
        status,
        at: now,
        lost: false,
    });
    state.standing.remove("controller_lost");
}

fn tell_faults(state: &mut State, now: Stamp, status: &ControllerStatus, out: &mut Outbox<Output>) {
    if status.execution == MachineState::EXECUTION_ESTOP {
        raise(state, now, "estop", "the machine is in emergency stop", out);
        fail_operation(state, now, "emergency stop", out);
    } else {
        state.standing.remove("estop");
    }
    let touch = status
        .alarms
        .iter()
        .find(|alarm| alarm.to_lowercase().contains(UNPLANNED_TOUCH));
    if let Some(alarm) = touch {
        raise(state, now, "unplanned_touch", alarm, out);
        fail_operation(
            state,
            now,
            "the probe touched where no touch was planned",
            out,
        );
    } else {
        state.standing.remove("unplanned_touch");
    }
    if touch.is_none() && status.execution == MachineState::EXECUTION_ALARM {
        let text = if status.alarms.is_empty() {
            "the controller gives no text".to_owned()
        } else {
            status.alarms.join("; ")
        };
        raise(state, now, "controller_alarm", &text, out);
        fail_operation(state, now, &text, out);
    } else {
        state.standing.remove("controller_alarm");
    }
}

fn publish(config: &Config, state: &State, status: &ControllerStatus, out: &mut Outbox<Output>) {
    let header = std_msgs::Header {
        stamp: status.header.stamp,
        frame_id: "foundation".to_owned(),
    };
    let joints = |position: &[f64]| JointState {
        header: header.clone(),
        name: status.axis_names.clone(),
        position: position.to_vec(),
        ..JointState::default()
    };
    out.send(Output::JointStates(joints(&status.axis_positions)));
    if status.axis_commands.len() == status.axis_names.len() {
        out.send(Output::JointCommands(joints(&status.axis_commands)));
    }
    out.send(Output::State(MachineState {
        header: header.clone(),
        machine_id: config.machine_id.clone(),
        mode: status.mode,
        execution: status.execution,
        program: status.program.clone(),
        line: status.line,
        tool_number: status.tool_number,
        feed_override: status.feed_override,
        spindle_speed: status.spindle_speed,
        temperature_names: status.temperature_names.clone(),
        temperatures: status.temperatures.clone(),
        alarms: status.alarms.clone(),
    }));
    let held = state
        .controller
        .as_ref()
        .map(|known| offsets(&known.status));
    if held != Some(offsets(status)) {
        out.send(Output::ToolOffsets(ToolOffsets {
            header,
            session: status.session.clone(),
            tool_numbers: status.tool_numbers.clone(),
            wear: status.tool_wear.clone(),
            volumetric_entries: status.volumetric_entries.clone(),
            volumetric_values: status.volumetric_values.clone(),
            work_offset_axes: status.work_offset_axes.clone(),
            work_offsets: status.work_offsets.clone(),
        }));
    }
}

/// What a sample tells of offsets: tools, entries of the volumetric table and axes, and the values of each.
fn offsets(status: &ControllerStatus) -> (&[u32], [&[String]; 2], [&[f64]; 3]) {
    (
        &status.tool_numbers,
        [&status.volumetric_entries, &status.work_offset_axes],
        [
            &status.tool_wear,
            &status.volumetric_values,
            &status.work_offsets,
        ],
    )
}

/// Looks for a silent controller, a command that it has forgotten, and an order that does not come.
fn watch(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    let silent = state
        .controller
        .as_ref()
        .filter(|known| !known.lost)
        .map(|known| now.since_s(known.at));
    if silent.is_some_and(|seconds| seconds > config.silence_limit) {
        raise(
            state,
            now,
            "controller_lost",
            "the controller has gone silent",
            out,
        );
        fail_operation(state, now, "the controller has gone silent", out);
        if let Some(known) = &mut state.controller {
            known.lost = true;
            out.send(Output::State(MachineState {
                header: std_msgs::Header {
                    stamp: now.time(),
                    frame_id: "foundation".to_owned(),
                },
                machine_id: config.machine_id.clone(),
                mode: known.status.mode,
                execution: MachineState::EXECUTION_ALARM,
                alarms: vec!["controller lost".to_owned()],
                ..MachineState::default()
            }));
        }
    }
    let idle = state.operation.as_ref().and_then(|one| one.idle);
    if idle.is_some_and(|since| now > since.after_s(config.reply_limit)) {
        let text = format!(
            "the machine has been idle for {} s, and the driver has not said what came of it",
            config.reply_limit
        );
        fail_operation(state, now, &text, out);
    }
    if state
        .awaited
        .as_ref()
        .is_some_and(|awaited| now > awaited.until)
        && let Some(awaited) = state.awaited.take()
    {
        let text = format!(
            "no measuring order for plan {:?} came in time",
            awaited.request.plan_id
        );
        report(
            now,
            awaited.request.request_id,
            OperationReport::FAILED,
            &text,
            out,
        );
    }
}

/// Why the machine can be asked for nothing.
fn unfit(config: &Config, state: &State) -> Option<&'static str> {
    match &state.controller {
        _ if config.replayed => Some("this graph runs on a recording"),
        None => Some("no controller has been heard"),
        Some(known) if known.lost => Some("the controller is silent"),
        Some(known) if known.status.execution == MachineState::EXECUTION_ESTOP => {
            Some("the machine is in emergency stop")
        }
        Some(_) => None,
    }
}

fn request_operation(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: OperationRequest,
    out: &mut Outbox<Output>,
) {
    let busy = request.kind != OperationRequest::STOP && state.operation.is_some();
    let refusal = unfit(config, state).or(busy.then_some("the machine is busy"));
    if let Some(text) = refusal {
        state.order = None;
        report(now, request.request_id, OperationReport::REFUSED, text, out);
        return;
    }
    let mut order = Vec::new();
    if request.kind == OperationRequest::MEASURE {
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
    let kind = match request.kind {
        OperationRequest::CUT => ControllerCommand::RUN_OPERATION,
        OperationRequest::MEASURE => ControllerCommand::RUN_MEASUREMENT,
        _ => ControllerCommand::STOP,
    };
    let command = ControllerCommand {
        kind,
        operation: request.operation,
        plan_id: request.plan_id,
        order,
        ..ControllerCommand::default()
    };
    let command_id = tell(state, now, command, out);
    state.operation = Some(Operation {
        request_id: request.request_id,
        command_id,
        idle: None,
    });
}

/// Sends a command to the driver that runs now; gives its number.
pub(crate) fn tell(
    state: &mut State,
    now: Stamp,
    command: ControllerCommand,
    out: &mut Outbox<Output>,
) -> u64 {
    let command_id = state.next_command;
    state.next_command += 1;
    let session = state
        .controller
        .as_ref()
        .map(|known| known.status.session.clone())
        .unwrap_or_default();
    let header = std_msgs::Header {
        stamp: now.time(),
        frame_id: String::new(),
    };
    out.send(Output::Command(ControllerCommand {
        header,
        session,
        command_id,
        ..command
    }));
    command_id
}

/// What the driver says of a command, to whoever asked for it.
fn answer(state: &mut State, now: Stamp, reply: &ControllerReply, out: &mut Outbox<Output>) {
    if state
        .controller
        .as_ref()
        .is_none_or(|known| known.status.session != reply.session)
    {
        return;
    }
    if let Some(Writing { correction, .. }) = state.writing.remove(&reply.command_id) {
        return writing::answered(state, now, &correction, reply, out);
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
            && let Some((code, text)) = named(&reply.text)
        {
            raise(state, now, code, text, out);
            state.standing.remove(code);
        }
        report(now, operation.request_id, outcome, &reply.text, out);
    }
}

/// The name of a fault that a driver puts before its sentence: `probe_stuck: the probe ...`.
fn named(text: &str) -> Option<(&str, &str)> {
    let (code, sentence) = text.split_once(": ")?;
    let is_name = |code: &str| {
        code.bytes()
            .all(|byte| byte.is_ascii_lowercase() || byte == b'_')
    };
    (!code.is_empty() && is_name(code)).then_some((code, sentence))
}

fn fail_operation(state: &mut State, now: Stamp, text: &str, out: &mut Outbox<Output>) {
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

fn report(now: Stamp, request_id: u64, outcome: u8, text: &str, out: &mut Outbox<Output>) {
    let header = std_msgs::Header {
        stamp: now.time(),
        frame_id: String::new(),
    };
    out.send(Output::Report(OperationReport {
        header,
        request_id,
        outcome,
        text: text.to_owned(),
    }));
}

/// Tells a fault once, until it has gone.
fn raise(state: &mut State, now: Stamp, code: &str, text: &str, out: &mut Outbox<Output>) {
    if state.standing.insert(code.to_owned()) {
        out.send(Output::Fault(Fault {
            header: std_msgs::Header {
                stamp: now.time(),
                frame_id: String::new(),
            },
            node: MachineStateNode::NAME.to_owned(),
            severity: Fault::ERROR,
            code: code.to_owned(),
            text: text.to_owned(),
        }));
    }
}
