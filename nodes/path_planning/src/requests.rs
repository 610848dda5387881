//! What the cycle and operators request of `path_planning`.

use graph::Stamp;
use probecell_msgs::{InspectionPlan, OperationRequest, OperatorRequest};

use crate::{
    config::Config,
    error::PlanningError,
    further::{self, FurtherError},
    job::{Job, Purpose},
    ports::{Failure, Out, Output, PlanningFault, reply},
    resume::{Measurement, ResumeError},
    state::State,
    task::{OrderRequest, Task},
    work,
};

/// Name of the part's own plan where an operator gives none.
pub const PREVIEW: &str = "preview";

/// A request of the cycle: plans are made for its measurements. The error is code and text of a fault.
pub(crate) fn handle_cycle_request(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: &OperationRequest,
    out: &mut Out,
) -> Result<(), Failure> {
    let is_same = |measurement: &&Measurement| {
        measurement.plan.plan_id == request.plan_id
            && measurement.only_measure == request.only_measure
    };
    match request.kind {
        OperationRequest::MEASURE
            if let Some(measurement) = state.measurement.as_ref().filter(is_same) =>
        {
            let task = measurement.start_order(&config.rules(), state.here.as_deref());
            let task = task.map_err(|error| (PlanningFault::PlanUnknown, error.to_string()))?;
            let purpose = Purpose::Resume(request.request_id);
            work::start(state, now, task, purpose, out);
        }
        OperationRequest::MEASURE if state.measured.contains(&request.plan_id) => {
            let error = ResumeError::Over(request.plan_id.clone());
            return Err((PlanningFault::PlanUnknown, error.to_string()));
        }
        OperationRequest::MEASURE if request.only_measure => {
            publish_further(state, now, &request.plan_id, out)?;
        }
        OperationRequest::MEASURE => {
            state.pass = Some(request.pass_number);
            let allowance = allowance(config, request.pass_number);
            let task = start_full_plan(config, now, &request.plan_id, allowance);
            let task = task.map_err(|error| (PlanningFault::PlanImpossible, error.to_string()))?;
            let purpose = Purpose::Measurement(request.request_id);
            work::start(state, now, task, purpose, out);
        }
        OperationRequest::CUT => {
            // Plan and results of before belong to surfaces that no longer exist.
            state.further = None;
            state.measurement = None;
            state.pass = Some(request.pass_number);
        }
        _ => {}
    }
    Ok(())
}

/// Publishes the further touches that were accepted under a name.
fn publish_further(
    state: &mut State,
    now: Stamp,
    plan_id: &str,
    out: &mut Out,
) -> Result<(), Failure> {
    let further = state.further.take();
    let Some((mut plan, mut order)) = further.filter(|(plan, _)| plan.plan_id == plan_id) else {
        let text = format!(
            "plan {plan_id:?} was not accepted for the part as it is now, or it was measured already"
        );
        return Err((PlanningFault::PlanUnknown, text));
    };
    plan.header.stamp = now.time();
    order.header = plan.header.clone();
    state.measured.insert(plan.plan_id.clone());
    state.measurement = Some(Measurement::new(plan.clone(), &[], true));
    out.send(Output::Plan(plan));
    out.send(Output::Order(order));
    Ok(())
}

/// What a pass leaves on the sizes, m.
fn allowance(config: &Config, pass: u32) -> f64 {
    let known = config.allowances.get(pass as usize);
    known.copied().unwrap_or(0.0)
}

/// Why an operator's request is refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RequestError {
    #[error(transparent)]
    Resume(#[from] ResumeError),
    #[error(transparent)]
    Further(#[from] FurtherError),
    #[error(transparent)]
    Planning(#[from] PlanningError),
    #[error(
        "plan {0:?} is being measured: a preview would replace it; ask again when that is done"
    )]
    Measuring(String),
    #[error("plan {0:?} is being computed: retry when it is complete")]
    Busy(String),
}

/// A request of an operator: the remaining points of a measurement, a preview of the part's plan, or further touches for
/// a run that only measures. The answer comes when the order is made.
pub(crate) fn handle_operator_request(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: &OperatorRequest,
    out: &mut Out,
) -> Result<(), RequestError> {
    let subject = &request.subject;
    if let Some(job) = &state.job {
        return Err(RequestError::Busy(job.task.plan().plan_id.clone()));
    }
    if let Some(measurement) = &state.measurement
        && measurement.plan.plan_id == *subject
    {
        let mut repeated = measurement.clone();
        repeated.repeat(&request.points)?;
        let task = repeated.start_order(&config.rules(), state.here.as_deref())?;
        let purpose = Purpose::Repeat(request.request_id, request.points.clone());
        work::start(state, now, task, purpose, out);
        return Ok(());
    }
    if state.measured.contains(subject) {
        return Err(ResumeError::Over(subject.clone()).into());
    }
    if request.points.is_empty() {
        let plan_id = if subject.is_empty() { PREVIEW } else { subject };
        if let Some((_, measured)) = &state.running {
            return Err(RequestError::Measuring(measured.clone()));
        }
        let task = start_full_plan(config, now, plan_id, 0.0)?;
        let purpose = Purpose::Preview(request.request_id);
        work::start(state, now, task, purpose, out);
        return Ok(());
    }
    if subject.is_empty() {
        return Err(FurtherError::Name.into());
    }
    // Before the first cut the part is taken to be as the last pass leaves it.
    let last = config.allowances.last().copied().unwrap_or(0.0);
    let current = state.pass.map_or(last, |pass| allowance(config, pass));
    let known = with_id(config.part.plan(current), subject, now);
    let plan = InspectionPlan {
        points: request.points.clone(),
        ..known.clone()
    };
    let task = further::start_order(&config.rules(), (&known, config.part.poses()), &plan)?;
    let purpose = Purpose::Further(request.request_id);
    work::start(state, now, task, purpose, out);
    Ok(())
}

/// Ends the planning that an operator has requested; whoever has requested it is informed first.
pub(crate) fn cancel(state: &mut State, now: Stamp, request: &OperatorRequest, out: &mut Out) {
    let is_meant = |job: &Job| {
        let number = job.purpose.of_operator();
        number.is_some_and(|number| request.cancels.contains(&number))
    };
    let known = state.job.as_ref().filter(|job| is_meant(job));
    let known = known.map(|job| format!("planning of {:?} has ended", job.task.plan().plan_id));
    work::cancel(state, now, is_meant, "an operator has cancelled it", out);
    let result = known.ok_or_else(|| "what was to be cancelled is not being planned".to_owned());
    out.send(reply(now, request.request_id, result));
}

/// The plan with an identifier, stamped now.
fn with_id(plan: InspectionPlan, plan_id: &str, now: Stamp) -> InspectionPlan {
    InspectionPlan {
        header: now.header("workpiece"),
        plan_id: plan_id.to_owned(),
        ..plan
    }
}

/// Starts to order the part's own plan, with an allowance (m) left on its sizes.
fn start_full_plan(
    config: &Config,
    now: Stamp,
    plan_id: &str,
    allowance: f64,
) -> Result<Task, PlanningError> {
    let plan = with_id(config.part.plan(allowance), plan_id, now);
    let all: Vec<u32> = (0..plan.points.len() as u32).collect();
    let request = OrderRequest {
        plan: &plan,
        points: &all,
        stages: config.part.stages(),
        poses: config.part.poses(),
        seeds: &[],
        here: None,
    };
    Task::new(&config.rules(), &request)
}
