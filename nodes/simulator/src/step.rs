//! The rules of the simulated machine.

use graph::{Node, Outbox, START, Stamp, inputs, outputs, topics};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, InspectionPlan, MachineState,
    MeasurementOrder, ProbeTrigger, ReferenceMeasurement, std_msgs,
};
use rand::SeedableRng;
use rand_pcg::Pcg32;

use crate::{
    config::{Config, Injected},
    motion::{self, Builder},
    plant,
    state::{Segment, State, Then},
};

inputs! {
    /// What the simulated machine hears.
    pub enum Input {
        /// What it is told to do.
        Command(ControllerCommand) = topics::CONTROLLER_COMMANDS,
        /// What is measured.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// In which order, by which moves.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
    }
}

outputs! {
    /// What the simulated machine says.
    pub enum Output {
        /// A raw sample.
        Status(ControllerStatus) = topics::CONTROLLER_STATUS,
        /// The raw end of a probing move.
        Trigger(ProbeTrigger) = topics::PROBE_TRIGGERS,
        /// What came of a command.
        Reply(ControllerReply) = topics::CONTROLLER_REPLIES,
        /// The same points by the reference instrument.
        Reference(ReferenceMeasurement) = topics::REFERENCE,
    }
}

/// Timer of the regular samples.
const SAMPLE: u32 = 1;
/// Commands that move the machine, or that change where it goes.
const MOVES: [u8; 3] = [
    ControllerCommand::RUN_OPERATION,
    ControllerCommand::RUN_MEASUREMENT,
    ControllerCommand::SET_VOLUMETRIC,
];
/// s between two regular samples.
const SAMPLE_PERIOD: f64 = 0.01;

/// The node.
pub struct SimulatorNode;

impl Node for SimulatorNode {
    const NAME: &'static str = "simulator";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;

    fn start(config: &Config) -> State {
        let raw = &config.raw;
        State {
            session: String::new(),
            random: Pcg32::seed_from_u64(raw.seed),
            wear: raw
                .tools
                .iter()
                .map(|tool| (tool.number, tool.wear_um * 1e-6))
                .collect(),
            sizes: raw
                .sizes
                .iter()
                .map(|size| (size.id.clone(), size.stock_mm * 1e-3))
                .collect(),
            turned: std::collections::BTreeMap::new(),
            surfaces: std::collections::BTreeMap::new(),
            path_offsets: std::collections::BTreeMap::new(),
            volumetric: raw.machine.volumetric,
            table: config.table.entries().map(|(_, value)| value).collect(),
            work_offsets: vec![0.0; config.work_offset_axes.len()],
            position: config.home.clone(),
            program: None,
            awaiting: None,
            plan: None,
            order: None,
            tool: 0,
            alarms: Vec::new(),
            estop: false,
            silent: false,
            touches: 0,
        }
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
                    state.session = format!("simulator-{}", now.0);
                }
                run(config, state, now, out);
                sample(config, state, now, out);
                out.wake_at(now.after_s(SAMPLE_PERIOD), SAMPLE);
            }
            Input::Plan(plan) => {
                state.plan = Some(plan);
                measure_when_ready(config, state, now, out);
            }
            Input::Order(order) => {
                state.order = Some(order);
                measure_when_ready(config, state, now, out);
            }
            Input::Command(command) => obey(config, state, now, command, out),
        }
    }
}

fn obey(
    config: &Config,
    state: &mut State,
    now: Stamp,
    command: ControllerCommand,
    out: &mut Outbox<Output>,
) {
    if state.silent {
        return;
    }
    let refusal = if command.session != state.session {
        Some("it was made for another run of the driver")
    } else if state.estop {
        Some("emergency stop")
    } else if state.program.is_some() && MOVES.contains(&command.kind) {
        Some("a program is running")
    } else {
        None
    };
    if let Some(text) = refusal {
        let outcome = ControllerReply::REFUSED;
        out.send(Output::Reply(ControllerReply {
            outcome,
            text: text.to_owned(),
            ..reply(state, now, &command)
        }));
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
            abort(state, now, "stopped", out);
            out.send(Output::Reply(reply(state, now, &command)));
        }
        kind => {
            let text = format!("commands of kind {kind} are not known here");
            let outcome = ControllerReply::REFUSED;
            out.send(Output::Reply(ControllerReply {
                outcome,
                text,
                ..reply(state, now, &command)
            }));
        }
    }
}

fn start_cut(
    config: &Config,
    state: &mut State,
    now: Stamp,
    command: ControllerCommand,
    out: &mut Outbox<Output>,
) {
    let Some(operation) = config
        .raw
        .operations
        .iter()
        .find(|raw| raw.id == command.operation)
    else {
        let text = format!("there is no operation {:?}", command.operation);
        let outcome = ControllerReply::REFUSED;
        out.send(Output::Reply(ControllerReply {
            outcome,
            text,
            ..reply(state, now, &command)
        }));
        return;
    };
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

fn measure_when_ready(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
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
            let outcome = ControllerReply::REFUSED;
            out.send(Output::Reply(ControllerReply {
                outcome,
                text,
                ..reply(state, now, &command)
            }));
        }
    }
}

fn set_wear(state: &mut State, now: Stamp, command: &ControllerCommand, out: &mut Outbox<Output>) {
    let answer = match state.wear.get_mut(&command.tool_number) {
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
                "tool {} has no offset that {} could be",
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
    out: &mut Outbox<Output>,
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
                "the path of {:?} has {points} points, and {} offsets are none of it",
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
    out: &mut Outbox<Output>,
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
                "axis {:?} has no work offset that {} could be",
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
    out: &mut Outbox<Output>,
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
            "the volumetric table has the entries [{}], and {} values of [{}] are none of it",
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

/// Carries out what ended by now.
fn run(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    inject(config, state, now, out);
    // A controller that says nothing goes on with its program, unheard.
    let mut unheard = Outbox::default();
    let out = if state.silent { &mut unheard } else { out };
    while let Some(segment) = next_ended(state, now) {
        state.position.clone_from(&segment.to);
        match segment.then {
            Then::Go => {}
            Then::Touch(trigger) => {
                // A sample at the very instant of the latch: what is interpolated there is what was latched.
                sample(config, state, segment.end, out);
                out.send(Output::Trigger(trigger));
            }
            Then::Cut(operation) => plant::cut(config, state, &operation),
            Then::Finish(done) => {
                let measured = state.program.take().is_some_and(|program| {
                    program.command.kind == ControllerCommand::RUN_MEASUREMENT
                });
                let header = std_msgs::Header {
                    stamp: segment.end.time(),
                    frame_id: "part".to_owned(),
                };
                out.send(Output::Reply(ControllerReply {
                    header: header.clone(),
                    ..done
                }));
                if let Some(plan) = state.plan.clone().filter(|_| measured)
                    && let Some(reference) = plant::reference(config, state, &plan, header)
                {
                    out.send(Output::Reference(reference));
                }
            }
        }
    }
}

fn next_ended(state: &mut State, now: Stamp) -> Option<Segment> {
    let segments = &mut state.program.as_mut()?.segments;
    if segments.front()?.end <= now {
        segments.pop_front()
    } else {
        None
    }
}

/// Lets go wrong what the cell file wants to go wrong, once enough touches are behind.
fn inject(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    let Some(fault) = &config.raw.fault else {
        return;
    };
    let touched = |state: &State| {
        let Some(program) = &state.program else {
            return false;
        };
        let left = program
            .segments
            .iter()
            .filter(|segment| matches!(segment.then, Then::Touch(_)))
            .count();
        program.command.kind == ControllerCommand::RUN_MEASUREMENT
            && state.touches.saturating_sub(left as u32) >= fault.after_touches
    };
    if state.estop || !state.alarms.is_empty() || state.silent || !touched(state) {
        return;
    }
    match fault.kind {
        Injected::DeadProbe | Injected::StuckProbe => {}
        Injected::UnplannedTouch => {
            state
                .alarms
                .push("Probe tripped during non-probe move.".to_owned());
            abort(
                state,
                now,
                "the probe tripped in a move that is not a probing move",
                out,
            );
        }
        Injected::Estop => {
            state.estop = true;
            abort(state, now, "emergency stop", out);
        }
        Injected::Silence => state.silent = true,
    }
}

fn abort(state: &mut State, now: Stamp, text: &str, out: &mut Outbox<Output>) {
    for command in [
        state.program.take().map(|program| program.command),
        state.awaiting.take(),
    ]
    .into_iter()
    .flatten()
    {
        let outcome = ControllerReply::FAILED;
        out.send(Output::Reply(ControllerReply {
            outcome,
            text: text.to_owned(),
            ..reply(state, now, &command)
        }));
    }
}

fn sample(config: &Config, state: &State, now: Stamp, out: &mut Outbox<Output>) {
    if state.silent {
        return;
    }
    let segment = state
        .program
        .as_ref()
        .and_then(|program| program.segments.front());
    let position = segment.map_or_else(|| state.position.clone(), |segment| segment.at(now));
    let execution = if state.estop {
        MachineState::EXECUTION_ESTOP
    } else if !state.alarms.is_empty() {
        MachineState::EXECUTION_ALARM
    } else if state.program.is_some() {
        MachineState::EXECUTION_RUNNING
    } else {
        MachineState::EXECUTION_IDLE
    };
    out.send(Output::Status(ControllerStatus {
        header: std_msgs::Header {
            stamp: now.time(),
            frame_id: "foundation".to_owned(),
        },
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

fn reply(state: &State, now: Stamp, command: &ControllerCommand) -> ControllerReply {
    ControllerReply {
        header: std_msgs::Header {
            stamp: now.time(),
            frame_id: String::new(),
        },
        session: state.session.clone(),
        command_id: command.command_id,
        outcome: ControllerReply::DONE,
        ..ControllerReply::default()
    }
}
