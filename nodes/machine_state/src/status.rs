//! Controller samples: the contract's messages, faults that begin or end, and samples that fail to arrive.

use graph::{Stamp, supervision::GATE_SILENCE};
use probecell_msgs::{
    ControllerStatus, MachineState, OperationReport, ToolOffsets, sensor_msgs::JointState, std_msgs,
};

use crate::{
    active_faults::{clear, raise},
    command,
    config::Config,
    drivers, operation,
    ports::{MachineFault, Out, Output},
    report, signals,
    state::{Asker, Controller, State},
    stop,
};

/// s between two reports of a request under way.
const UNDERWAY_PERIOD: f64 = 1.0;

/// Part of the alarm text with which a controller reports a touch outside a measuring move.
const UNPLANNED_TOUCH: &str = "probe tripped during non-probe";

/// Processes a sample: new session, faults that begin or end, and the contract's messages.
pub(crate) fn sample(
    config: &Config,
    state: &mut State,
    now: Stamp,
    status: ControllerStatus,
    out: &mut Out,
) {
    if drivers::ignores(config, state, now, &status, out) {
        return;
    }
    let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
    let signals = [
        &status.axis_positions,
        &status.axis_commands,
        &status.axis_velocities,
        &status.axis_efforts,
    ];
    if !signals.into_iter().all(|values| finite(values))
        || status.axis_positions.len() != status.axis_names.len()
    {
        let text = "a sample has an axis position that is missing, or a value of an axis that is not a finite number";
        raise(state, now, MachineFault::StatusNotFinite, text, out);
        return;
    }
    clear(state, MachineFault::StatusNotFinite);
    if state
        .controller
        .as_ref()
        .is_some_and(|known| known.status.session != status.session)
    {
        report::fail(state, now, "the driver was restarted", out);
        raise(
            state,
            now,
            MachineFault::ControllerRestarted,
            "the driver was restarted: its work is void",
            out,
        );
        clear(state, MachineFault::ControllerRestarted);
        *state = State {
            started: state.started,
            epoch: state.epoch,
            beats: state.beats,
            former: drivers::displaced(state, now, &status),
            next_command: state.next_command,
            taken: state.taken.take(),
            part: std::mem::take(&mut state.part),
            recording: state.recording.take(),
            keys: state.keys.take(),
            order: state.order.take(),
            // The new session is told to stop as well: its answer is one to those who wait.
            stops: std::mem::take(&mut state.stops),
            standing: std::mem::take(&mut state.standing),
            signals: std::mem::take(&mut state.signals),
            ..State::default()
        };
        drivers::settle(state);
    }
    let greeted = state.controller.is_some() || state.started == 0;
    report_faults(state, now, &status, out);
    publish(config, state, now, &status, out);
    if let Some(operation) = &mut state.operation {
        let idle = status.execution == MachineState::EXECUTION_IDLE;
        operation.idle = idle.then(|| operation.idle.unwrap_or(now));
    }
    state.controller = Some(Controller {
        status,
        at: now,
        lost: false,
    });
    clear(state, MachineFault::ControllerLost);
    if !greeted {
        // The driver may know numbers of an earlier gate, none of which is beyond its own clock.
        let clock = state.controller.as_ref().map_or(0, |known| {
            Stamp::from(&known.status.header.stamp).0.unsigned_abs()
        });
        // A driver that began before this process stands on the same clock, or nearly: only one far ahead is of another time.
        if clock > now.after_s(GATE_SILENCE).0.unsigned_abs() {
            state.epoch = state.epoch.max(clock);
            // Before the first command: a driver that learns only later that this is another process ends what it has begun.
            command::publish_heartbeat(state, now, out);
        }
        state.next_command = state.next_command.max(clock);
        take_over(config, state, now, out);
    }
}

/// The first word to a driver is to stop: what its machine does, nobody has supervised.
fn take_over(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let known = state.controller.as_ref().map(|known| &known.status);
    let at_work = [
        MachineState::EXECUTION_RUNNING,
        MachineState::EXECUTION_HOLD,
    ];
    if let Some(status) =
        known.filter(|status| at_work.contains(&status.execution) && !status.program.is_empty())
    {
        let text = format!(
            "the machine was executing {:?} and is commanded to stop: it was unsupervised",
            status.program
        );
        raise(state, now, MachineFault::UnsupervisedMotion, &text, out);
        clear(state, MachineFault::UnsupervisedMotion);
    }
    stop::stop(config, state, now, Asker::Gate, out);
}

fn report_faults(state: &mut State, now: Stamp, status: &ControllerStatus, out: &mut Out) {
    if status.execution == MachineState::EXECUTION_ESTOP {
        raise(
            state,
            now,
            MachineFault::Estop,
            "the machine is in emergency stop",
            out,
        );
        report::fail(state, now, "emergency stop", out);
    } else {
        clear(state, MachineFault::Estop);
    }
    let touch = status
        .alarms
        .iter()
        .find(|alarm| alarm.to_lowercase().contains(UNPLANNED_TOUCH));
    if let Some(alarm) = touch {
        raise(state, now, MachineFault::UnplannedTouch, alarm, out);
        report::fail(
            state,
            now,
            "the probe touched where no touch was planned",
            out,
        );
    } else {
        clear(state, MachineFault::UnplannedTouch);
    }
    if touch.is_none() && status.execution == MachineState::EXECUTION_ALARM {
        let text = if status.alarms.is_empty() {
            "the controller gives no text".to_owned()
        } else {
            status.alarms.join("; ")
        };
        raise(state, now, MachineFault::ControllerAlarm, &text, out);
        report::fail(state, now, &text, out);
    } else {
        clear(state, MachineFault::ControllerAlarm);
    }
}

fn publish(config: &Config, state: &State, now: Stamp, status: &ControllerStatus, out: &mut Out) {
    let header = std_msgs::Header {
        stamp: status.header.stamp,
        frame_id: "foundation".to_owned(),
    };
    // An array of another length belongs to other axes: sensor_msgs/JointState has all of them or none.
    let of_all = |values: &[f64]| {
        let known = values.len() == status.axis_names.len();
        known.then(|| values.to_vec())
    };
    let joints = JointState {
        header: header.clone(),
        name: status.axis_names.clone(),
        ..JointState::default()
    };
    out.send(Output::JointStates(JointState {
        position: status.axis_positions.clone(),
        velocity: of_all(&status.axis_velocities).unwrap_or_default(),
        effort: of_all(&status.axis_efforts).unwrap_or_default(),
        ..joints.clone()
    }));
    if let Some(position) = of_all(&status.axis_commands) {
        out.send(Output::JointCommands(JointState { position, ..joints }));
    }
    // Of two sources of one temperature the one counts that the cell file names.
    let read: Vec<(String, f64)> = signals::temperatures(config, state, now).collect();
    let reported = (status.temperature_names.iter().cloned()).zip(status.temperatures.clone());
    let reported = reported.filter(|(name, _)| read.iter().all(|(own, _)| own != name));
    let (temperature_names, temperatures) = reported.chain(read.clone()).unzip();
    let alarms = status.alarms.iter().cloned();
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
        temperature_names,
        temperatures,
        alarms: alarms.chain(signals::alarms(config, state, now)).collect(),
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

/// The offsets in a sample: tools, entries of the volumetric table and axes, and the values of each.
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

/// Checks the timeouts: samples of the controller, outcome of the operation, and the measuring order.
pub(crate) fn watch(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    drivers::watch(config, state, now);
    let silent = state
        .controller
        .as_ref()
        .filter(|known| !known.lost)
        .map(|known| now.since_s(known.at));
    if silent.is_some_and(|seconds| seconds > config.silence_limit) {
        raise(
            state,
            now,
            MachineFault::ControllerLost,
            "the controller sends no samples any more",
            out,
        );
        report::fail(state, now, "the controller sends no samples any more", out);
        if let Some(known) = &mut state.controller {
            known.lost = true;
            out.send(Output::State(MachineState {
                header: now.header("foundation"),
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
            "the machine has been idle for {} s, but the driver has not reported an outcome",
            config.reply_limit
        );
        report::fail(state, now, &text, out);
    }
    if state
        .awaited
        .as_ref()
        .is_some_and(|awaited| now > awaited.until)
        && let Some(awaited) = state.awaited.take()
    {
        let text = format!(
            "no measuring order for plan {:?} arrived in time",
            awaited.request.plan_id
        );
        let id = awaited.request.request_id;
        report::report(state, now, id, OperationReport::FAILED, &text, out);
    }
    if matches!(state.taken, Some((_, None))) && now.since_s(state.told) >= UNDERWAY_PERIOD {
        operation::underway(state, now, out);
    }
}
