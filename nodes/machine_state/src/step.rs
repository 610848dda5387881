//! The rules of `machine_state`.

use graph::{START, Stamp};
use probecell_msgs::{PlanProgress, RecordingStatus, std_msgs};

use crate::{
    command,
    config::Config,
    operation, part,
    ports::{Input, Out, Output},
    signals,
    state::{Asker, Awaited, State},
    status, stop, writing,
};

/// Timer of the check of timeouts.
const WATCH: u32 = 1;
/// s between two checks.
const WATCH_PERIOD: f64 = graph::supervision::HEARTBEAT_PERIOD;
/// s by which a link may deliver a message late.
const LATE: f64 = 30.0;

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
    match input {
        Input::Timer(id) => {
            if id == START {
                // The driver may still answer commands of an earlier process.
                state.next_command = now.0.unsigned_abs();
                state.started = now.0.unsigned_abs();
                state.epoch = state.started;
                let description = std_msgs::String {
                    data: config.robot_description.clone(),
                };
                out.send(Output::RobotDescription(description));
                part::publish(state, now, out);
            }
            command::publish_heartbeat(state, now, out);
            status::watch(config, state, now, out);
            part::watch(config, state, now, out);
            if signals::watch(config, state, now, out) {
                stop::stop(config, state, now, Asker::Gate, out);
            }
            stop::expire(state, now, out);
            writing::expire(config, state, now, out);
            writing::write_deferred(config, state, now, out);
            out.wake_at(now.after_s(WATCH_PERIOD), WATCH);
        }
        Input::Status(sample) => {
            status::sample(config, state, now, sample, out);
            // An operation may have failed with this sample.
            writing::write_deferred(config, state, now, out);
        }
        Input::Reply(reply) => {
            operation::answer(state, now, &reply, out);
            writing::write_deferred(config, state, now, out);
        }
        Input::Request(request) => operation::request(config, state, now, request, out),
        Input::Order(order) => {
            // The order of a request that is refused must not be taken for that of a later request.
            if operation::refusal(config, state).is_none() {
                state.order = Some((order.plan_id, order.order));
            }
            if let Some(awaited) = state.awaited.take() {
                operation::carry_out(config, state, now, awaited.request, out);
            }
        }
        Input::Progress(progress) => {
            // Planning that makes progress is not late.
            let of_plan = |one: &&mut Awaited| one.request.plan_id == progress.plan_id;
            if progress.phase != PlanProgress::GIVEN_UP
                && let Some(awaited) = state.awaited.as_mut().filter(of_plan)
            {
                awaited.until = now.after_s(config.order_limit);
            }
        }
        Input::Correction(correction) => writing::correct(config, state, now, correction, out),
        Input::Part(report) => part::ended(state, now, &report, out),
        Input::PartStatus(status) => part::status(config, state, now, status, out),
        Input::Stop(request) => {
            let asked_by = Asker::Operator(request.request_id);
            part::stopped(state);
            stop::stop(config, state, now, asked_by, out);
        }
        Input::Recording(status) => hear_of_recording(state, now, status),
        Input::Signals(readings) => {
            if signals::take(config, state, now, readings, out) {
                stop::stop(config, state, now, Asker::Gate, out);
            }
        }
        Input::Keys(keys) => {
            signatures::operators::take(config.trust.cell.as_ref(), &mut state.keys, keys);
        }
    }
}

/// Takes what the recorder says, unless a link delivers it after something newer. The clock of another recorder may be
/// behind that of the one before.
fn hear_of_recording(state: &mut State, now: Stamp, status: RecordingStatus) {
    let outdated = state.recording.as_ref().is_some_and(|(known, at)| {
        Stamp::from(&status.header.stamp) < Stamp::from(&known.header.stamp)
            && now.since_s(*at) <= LATE
    });
    if !outdated {
        state.recording = Some((status, now));
    }
}
