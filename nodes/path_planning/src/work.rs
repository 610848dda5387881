//! How a job is started, advanced and cancelled, and what becomes of its result.

use graph::{START, Stamp};
use probecell_msgs::{MeasurementOrder, PlanProgress};

use crate::{
    config::Config,
    job::{Job, Purpose},
    ports::{Out, Output, PlanningFault, reply},
    resume::Measurement,
    state::State,
    task::{Planned, Task},
};

/// Starts a job: each slice is a step of its own.
pub(crate) fn start(state: &mut State, now: Stamp, task: Task, purpose: Purpose, out: &mut Out) {
    state.jobs = state.jobs.wrapping_add(1).max(START + 1);
    out.wake_at(now, state.jobs);
    state.job = Some(Job {
        number: state.jobs,
        task,
        purpose,
    });
}

/// One slice of the work.
pub(crate) fn advance(config: &Config, state: &mut State, now: Stamp, mut job: Job, out: &mut Out) {
    let result = job.task.advance(&config.rules());
    let mut progress = job.task.progress();
    progress.header = now.header("");
    match result {
        Ok(None) => {
            out.send(Output::Progress(progress));
            out.wake_at(now, job.number);
            state.job = Some(job);
        }
        Ok(Some(planned)) => {
            progress.phase = PlanProgress::DONE;
            progress.air_time = planned.order.air_time;
            progress.given_air_time = planned.order.given_air_time;
            progress.air_length = planned.order.air_length;
            progress.given_air_length = planned.order.given_air_length;
            out.send(Output::Progress(progress));
            publish_result(config, state, now, job.purpose, planned, out);
        }
        Err(error) => {
            progress.phase = PlanProgress::GIVEN_UP;
            out.send(Output::Progress(progress));
            report_failure(state, now, &job.purpose, error.to_string(), out);
        }
    }
}

fn report_failure(state: &mut State, now: Stamp, purpose: &Purpose, text: String, out: &mut Out) {
    let fault = match purpose {
        Purpose::Measurement(_) => PlanningFault::PlanImpossible,
        Purpose::Resume(_) => PlanningFault::PlanUnknown,
        Purpose::Preview(request_id)
        | Purpose::Repeat(request_id, _)
        | Purpose::Further(request_id) => {
            out.send(reply(now, *request_id, Err(text)));
            return;
        }
    };
    state.running = None;
    out.fault(now, fault, text);
}

/// Cancels the job where it is void, and informs the operator who waits for it.
pub(crate) fn cancel(
    state: &mut State,
    now: Stamp,
    is_void: impl Fn(&Job) -> bool,
    reason: &str,
    out: &mut Out,
) {
    let Some(job) = state.job.take_if(|job| is_void(job)) else {
        return;
    };
    out.send(Output::Progress(PlanProgress {
        header: now.header(""),
        phase: PlanProgress::GIVEN_UP,
        ..job.task.progress()
    }));
    if let Some(request_id) = job.purpose.of_operator() {
        let plan = &job.task.plan().plan_id;
        let text = format!("planning of {plan:?} was cancelled: {reason}");
        out.send(reply(now, request_id, Err(text)));
    }
}

/// Publishes or keeps what a job has made.
fn publish_result(
    config: &Config,
    state: &mut State,
    now: Stamp,
    purpose: Purpose,
    Planned {
        mut plan,
        mut order,
    }: Planned,
    out: &mut Out,
) {
    plan.header.stamp = now.time();
    order.header = plan.header.clone();
    let described = Ok(describe(&order));
    match purpose {
        Purpose::Measurement(_) => {
            state.measured.insert(plan.plan_id.clone());
            let stages = config.part.stages();
            state.measurement = Some(Measurement::new(plan.clone(), stages, false));
            out.send(Output::Plan(plan));
            out.send(Output::Order(order));
        }
        // The plan stands: only its remaining points are touched.
        Purpose::Resume(_) => out.send(Output::Order(order)),
        Purpose::Preview(request_id) => {
            out.send(Output::Plan(plan));
            out.send(Output::Order(order));
            // Subscribers relate touches to the plan that was published last.
            state.measurement = None;
            out.send(reply(now, request_id, described));
        }
        Purpose::Repeat(request_id, points) => {
            let repeated = state
                .measurement
                .as_mut()
                .map(|known| known.repeat(&points));
            let result = match repeated {
                Some(Err(error)) => Err(error.to_string()),
                _ => described,
            };
            out.send(reply(now, request_id, result));
        }
        Purpose::Further(request_id) => {
            state.further = Some((plan, order));
            out.send(reply(now, request_id, described));
        }
    }
}

fn describe(order: &MeasurementOrder) -> String {
    format!(
        "{} touches, {:.1} s between them ({:.1} s in the order given)",
        order.order.len(),
        order.air_time,
        order.given_air_time
    )
}
