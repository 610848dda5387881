//! What each input of `path_planning` does.

use graph::Stamp;
use probecell_msgs::{OperationReport, OperationRequest};

use crate::{
    config::Config,
    job::Job,
    ports::{Input, Out, reply},
    requests::{cancel, handle_cycle_request, handle_operator_request},
    state::State,
    work,
};

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
    match input {
        Input::Timer(number) => {
            if let Some(job) = state.job.take_if(|job| job.number == number) {
                work::advance(config, state, now, job, out);
            }
        }
        Input::Event(event) => {
            if let Some(measurement) = &mut state.measurement {
                measurement.record(&event);
            }
        }
        Input::Joints(joints) => {
            let positions = config.chain.positions(&joints.name, &joints.position);
            state.here = positions.ok().or(state.here.take());
        }
        Input::Report(report) if report.outcome == OperationReport::UNDERWAY => {}
        Input::Request(request) if state.taken.as_ref() == Some(&request) => {}
        Input::Report(report) => {
            state
                .running
                .take_if(|(request_id, _)| *request_id == report.request_id);
            let is_for_it = |job: &Job| job.is_for(report.request_id);
            work::cancel(state, now, is_for_it, "its measurement has ended", out);
        }
        Input::Request(request) => {
            state.taken = Some(request.clone());
            // What the machine did before has ended, or is given up by the cycle.
            state.running = (request.kind == OperationRequest::MEASURE)
                .then(|| (request.request_id, request.plan_id.clone()));
            let is_void = |job: &Job| job.is_cancelled_by(&request);
            let reason = "the cell continues with its part";
            work::cancel(state, now, is_void, reason, out);
            let failed = handle_cycle_request(config, state, now, &request, out);
            if let Err((fault, text)) = failed {
                state.running = None;
                out.fault(now, fault, text);
            }
        }
        Input::Plan(request) if !request.cancels.is_empty() => {
            cancel(state, now, &request, out);
        }
        Input::Plan(request) => {
            if let Err(error) = handle_operator_request(config, state, now, &request, out) {
                out.send(reply(now, request.request_id, Err(error.to_string())));
            }
        }
    }
}
