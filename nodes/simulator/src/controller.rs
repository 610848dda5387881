//! The controller of the simulated machine: it obeys commands, holds offsets, and samples its state.

use graph::Stamp;
use probecell_msgs::{ControllerCommand, ControllerReply, ControllerStatus, MachineState};

use crate::{
    config::Config,
    motion::{self, Builder},
    plant,
    ports::{Out, Output},
    replies::{refused, reply},
    state::{Segment, State, Then},
    stopping::{stand, stop},
};

/// Commands that move the machine, or that change where it goes.
const MOVES: [u8; 3] = [
    ControllerCommand::RUN_OPERATION,
    ControllerCommand::RUN_MEASUREMENT,
    ControllerCommand::SET_VOLUMETRIC,
];

/// Numbers of commands kept: of what a link may still deliver again.
const TAKEN_LIMIT: usize = 64;

pub(crate) fn obey(
    config: &Config,
    state: &mut State,
    now: Stamp,
    command: ControllerCommand,
    out: &mut Out,
) {
    if state.silent {
        return;
    }
    if command.session == state.session {
        // Delivered again: what was taken once is neither done nor answered a second time.
        if state.taken.contains(&command.command_id) {
            return;
        }
        state.taken.push_back(command.command_id);
        if state.taken.len() > TAKEN_LIMIT {
            state.taken.pop_front();
        }
    }
    let refusal = if command.session != state.session {
        Some("it is addressed to another session of the driver")
    } else if state.estop {
        Some("emergency stop")
    } else if state.program.is_some() && MOVES.contains(&command.kind) {
        Some("a program is running")
    } else if state.stopping.is_some() && MOVES.contains(&command.kind) {
        Some("the machine does not stand yet")
    } else {
        None
    };
    if let Some(text) = refusal {
        out.send(refused(state, now, &command, text));
        return;
    }
    match command.kind {
        ControllerCommand::RUN_OPERATION => start_cut(config, state, now, command, out),
        ControllerCommand::RUN_MEASUREMENT => {
            state.awaiting = Some(command);
            measure_when_ready(config, state, now, out);
        }
        ControllerCommand::SET_TOOL_WEAR => set_wear(state, now, &command, out),
        ControllerCommand::SET_TOOL_PATH => set_path(config, state, now, &command, out),
        ControllerCommand::SET_VOLUMETRIC => set_table(config, state, now, &command, out),
        ControllerCommand::SET_WORK_OFFSET => set_work_offset(config, state, now, &command, out),
        ControllerCommand::STOP => {
            stop(config, state, now, command);
            stand(state, now, out);
        }
        kind => {
            let text = format!("commands of kind {kind} are not supported");
            out.send(refused(state, now, &command, text));
        }
    }
}

fn start_cut(
    config: &Config,
    state: &mut State,
    now: Stamp,
    command: ControllerCommand,
    out: &mut Out,
) {
    let Some(operation) = config
        .raw
        .operations
        .iter()
        .find(|raw| raw.id == command.operation)
    else {
        let text = format!("there is no operation {:?}", command.operation);
        out.send(refused(state, now, &command, text));
        return;
    };
    if command.run_id != state.run_id {
        plant::renew(config, state);
        state.run_id.clone_from(&command.run_id);
    }
    state.tool = operation.tool_number;
    let mut builder = Builder::new(now, &state.position);
    builder.push(
        state.position.clone(),
        operation.duration_s,
        Then::Cut(operation.id.clone()),
    );
    let done = reply(state, now, &command);
    builder.push(state.position.clone(), 0.0, Then::Finish(done));
    let spindle_speed = operation.spindle_rpm * std::f64::consts::TAU / 60.0;
    state.program = Some(builder.program(&operation.id.clone(), command, spindle_speed));
}

pub(crate) fn measure_when_ready(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let (Some(command), Some(plan), Some(order)) = (&state.awaiting, &state.plan, &state.order)
    else {
        return;
    };
    if command.plan_id != plan.plan_id
        || command.plan_id != order.plan_id
        || command.order != order.order
    {
        return;
    }
    let (command, plan, order) = (command.clone(), plan.clone(), order.clone());
    state.awaiting = None;
    state.tool = 0;
    match motion::measuring_program(config, state, now, command.clone(), &plan, &order) {
        Ok(program) => state.program = Some(program),
        Err(text) => {
            out.send(refused(state, now, &command, text));
        }
    }
}

/// m; a control takes no larger wear offset of either sign, whoever sends it (as parameter 5013 of a FANUC control).
const WEAR_LIMIT: f64 = 1e-3;

fn set_wear(state: &mut State, now: Stamp, command: &ControllerCommand, out: &mut Out) {
    let answer = match state.wear.get_mut(&command.tool_number) {
        Some(_) if command.value.abs() > WEAR_LIMIT => ControllerReply {
            outcome: ControllerReply::REFUSED,
            text: format!(
                "wear {} m of tool {} is beyond the register's limit of {WEAR_LIMIT} m",
                command.value, command.tool_number
            ),
            ..reply(state, now, command)
        },
        Some(wear) if command.value.is_finite() => {
            let value_before = std::mem::replace(wear, command.value);
            ControllerReply {
                value_before,
                value: command.value,
                ..reply(state, now, command)
            }
        }
        _ => {
            let text = format!(
                "tool {} is unknown, or {} is no wear offset",
                command.tool_number, command.value
            );
            ControllerReply {
                outcome: ControllerReply::REFUSED,
                text,
                ..reply(state, now, command)
            }
        }
    };
    out.send(Output::Reply(answer));
}

/// Takes over the offsets of a feature's tool path.
fn set_path(
    config: &Config,
    state: &mut State,
    now: Stamp,
    command: &ControllerCommand,
    out: &mut Out,
) {
    let mut cuts = config.cuts.iter();
    let cut = cuts.find(|((_, feature), _)| *feature == command.feature);
    let points = cut.map_or(0, |(_, cut)| cut.len());
    let usable = points > 0
        && command.path.len() == points
        && command.path.iter().all(|offset| offset.is_finite());
    let answer = if usable {
        let largest = |path: &Vec<f64>| path.iter().fold(0.0, |most: f64, o| most.max(o.abs()));
        let before = state
            .path_offsets
            .insert(command.feature.clone(), command.path.clone());
        ControllerReply {
            value_before: before.as_ref().map_or(0.0, largest),
            value: largest(&command.path),
            ..reply(state, now, command)
        }
    } else {
        ControllerReply {
            outcome: ControllerReply::REFUSED,
            text: format!(
                "the path of {:?} takes {points} finite offsets, but {} were given",
                command.feature,
                command.path.len()
            ),
            ..reply(state, now, command)
        }
    };
    out.send(Output::Reply(answer));
}

/// Moves the zero of the programme along an axis.
fn set_work_offset(
    config: &Config,
    state: &mut State,
    now: Stamp,
    command: &ControllerCommand,
    out: &mut Out,
) {
    let names = config.raw.machine.work_offset_axes.iter();
    let mut offsets = names.zip(&mut state.work_offsets);
    let own = offsets.find(|(name, _)| **name == command.axis);
    let written = own.filter(|_| command.value.is_finite());
    let values = written.map(|(_, held)| (std::mem::replace(held, command.value), command.value));
    let answer = reply(state, now, command);
    out.send(Output::Reply(match values {
        Some((value_before, value)) => ControllerReply {
            value_before,
            value,
            ..answer
        },
        None => ControllerReply {
            outcome: ControllerReply::REFUSED,
            text: format!(
                "axis {:?} has no work offset, or {} is none",
                command.axis, command.value
            ),
            ..answer
        },
    }));
}

/// Values of the volumetric table's entries that are in force, m or rad.
fn in_force(state: &State) -> Vec<f64> {
    let shown = |value: &f64| if state.volumetric { *value } else { 0.0 };
    state.table.iter().map(shown).collect()
}

/// Takes over a volumetric table, and goes by it from now on.
fn set_table(
    config: &Config,
    state: &mut State,
    now: Stamp,
    command: &ControllerCommand,
    out: &mut Out,
) {
    let names: Vec<&str> = config.table.entries().map(|(name, _)| name).collect();
    let usable = !names.is_empty()
        && command.entries == names
        && command.values.len() == names.len()
        && command.values.iter().all(|value| value.is_finite());
    let answer = if usable {
        let values_before = in_force(state);
        state.table.clone_from(&command.values);
        state.volumetric = true;
        ControllerReply {
            values_before,
            values: in_force(state),
            ..reply(state, now, command)
        }
    } else {
        let text = format!(
            "the volumetric table takes a finite value for each of [{}], but {} values for [{}] were given",
            names.join(", "),
            command.values.len(),
            command.entries.join(", ")
        );
        ControllerReply {
            outcome: ControllerReply::REFUSED,
            text,
            ..reply(state, now, command)
        }
    };
    out.send(Output::Reply(answer));
}

/// A regular sample.
pub(crate) fn sample(config: &Config, state: &State, now: Stamp, out: &mut Out) {
    let velocity = moving(state).map(|segment| segment.velocity_at(now));
    sample_at(config, state, now, velocity, out);
}

/// What the machine carries out.
fn moving(state: &State) -> Option<&Segment> {
    state.program.as_ref()?.segments.front()
}

/// A sample at an instant with these axis velocities, m/s and rad/s; `None`: the axes stand.
pub(crate) fn sample_at(
    config: &Config,
    state: &State,
    now: Stamp,
    velocity: Option<Vec<f64>>,
    out: &mut Out,
) {
    if state.silent {
        return;
    }
    let position = moving(state).map_or_else(|| state.position.clone(), |segment| segment.at(now));
    let execution = if state.estop {
        MachineState::EXECUTION_ESTOP
    } else if !state.alarms.is_empty() {
        MachineState::EXECUTION_ALARM
    } else if state.program.is_some() || state.stopping.is_some() {
        MachineState::EXECUTION_RUNNING
    } else {
        MachineState::EXECUTION_IDLE
    };
    out.send(Output::Status(ControllerStatus {
        header: now.header("foundation"),
        session: state.session.clone(),
        mode: MachineState::MODE_AUTO,
        execution,
        program: state
            .program
            .as_ref()
            .map(|program| program.name.clone())
            .unwrap_or_default(),
        tool_number: state.tool,
        feed_override: 1.0,
        spindle_speed: state
            .program
            .as_ref()
            .map_or(0.0, |program| program.spindle_speed),
        axis_names: config.chain.axis_names().map(str::to_owned).collect(),
        axis_commands: position.clone(),
        axis_velocities: velocity.unwrap_or_else(|| vec![0.0; position.len()]),
        axis_positions: position,
        temperature_names: ["spindle", "part", "ambient"].map(str::to_owned).to_vec(),
        temperatures: vec![20.0; 3],
        alarms: state.alarms.clone(),
        tool_numbers: state.wear.keys().copied().collect(),
        tool_wear: state.wear.values().copied().collect(),
        volumetric_entries: (config.table.entries())
            .map(|(name, _)| name.to_owned())
            .collect(),
        volumetric_values: in_force(state),
        work_offset_axes: config.raw.machine.work_offset_axes.clone(),
        work_offsets: state.work_offsets.clone(),
        ..ControllerStatus::default()
    }));
}
