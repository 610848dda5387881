//! The rules of the simulated machine.

use graph::{NoFaults, Node, Outbox, START, Stamp};
use probecell_msgs::{ControllerCommand, ControllerReply, ProbeTrigger};
use rand::SeedableRng;
use rand_pcg::Pcg32;

use crate::{
    config::Config,
    controller::{measure_when_ready, obey, sample, sample_at},
    plant,
    ports::{Input, Output},
    raw::Injected,
    state::{Segment, State, Then},
    stopping::{abort, stand},
};

/// Timer of the regular samples.
const SAMPLE: u32 = 1;
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
    type Fault = NoFaults;

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
            triggers: 0,
            run_id: String::new(),
            taken: std::collections::VecDeque::new(),
            gate: graph::supervision::GateWatch::default(),
            stopping: None,
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
                stand(state, now, out);
                if state.gate.is_silent(now) {
                    give_up(state, now, "machine_state has fallen silent", out);
                }
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
            Input::Heartbeat(beat) => {
                if state.gate.beat(now, &beat) {
                    give_up(
                        state,
                        now,
                        "machine_state is another process than before",
                        out,
                    );
                }
            }
            Input::Command(command) => {
                state.gate.command(now);
                obey(config, state, now, command, out);
            }
        }
    }
}

/// Stops what nobody supervises any more.
fn give_up(state: &mut State, now: Stamp, why: &str, out: &mut Outbox<Output>) {
    abort(state, now, &format!("gate_lost: {why}"), out);
}

/// Carries out the segments that have ended by now.
fn run(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    inject(config, state, now, out);
    // A silent controller continues with its program; its messages are dropped.
    let mut dropped = Outbox::default();
    let out = if state.silent { &mut dropped } else { out };
    while let Some(segment) = next_ended(state, now) {
        state.position.clone_from(&segment.to);
        let velocity = segment.velocity_at(segment.end);
        match segment.then {
            Then::Go => {}
            Then::Touch(trigger) => {
                let trigger = ProbeTrigger {
                    sequence: state.triggers,
                    ..trigger
                };
                state.triggers += 1;
                // A sample at the very instant of the latch: what is interpolated there is what was latched.
                sample_at(config, state, segment.end, Some(velocity), out);
                out.send(Output::Trigger(trigger));
            }
            Then::Cut(operation) => plant::cut(config, state, &operation),
            Then::Finish(done) => {
                let measured = state.program.take().is_some_and(|program| {
                    program.command.kind == ControllerCommand::RUN_MEASUREMENT
                });
                let header = segment.end.header("part");
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

/// Injects the fault of the cell file once the touches before it have been made.
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
