//! The rules of the simulated machine.

use graph::{Outbox, START, Stamp};
use probecell_msgs::{ControllerCommand, ControllerReply, ProbeTrigger};

use crate::{
    config::Config,
    controller::{measure_when_ready, obey, sample, sample_at},
    plant,
    ports::{Input, Out, Output},
    raw::Injected,
    state::{Segment, State, Then},
    stopping::{abort, stand},
};

/// Timer of the regular samples.
const SAMPLE: u32 = 1;
/// s between two regular samples.
const SAMPLE_PERIOD: f64 = 0.01;

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
    match input {
        Input::Timer(id) => {
            if id == START {
                state.session = format!("simulator-{}", now.0);
                state.begun = now;
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

/// Stops what nobody supervises any more.
fn give_up(state: &mut State, now: Stamp, why: &str, out: &mut Out) {
    abort(state, now, &format!("gate_lost: {why}"), out);
}

/// Carries out the segments that have ended by now.
fn run(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
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
fn inject(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
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
