//! Requests to the machine and their deadlines; the status of the part, which keeps it alive for `machine_state`.
//!
//! A request is repeated under its number until it is taken, and no stage of a part lasts for ever: what the machine says
//! nothing of, what is not decided, acknowledged or confirmed in time, stops the part.

use graph::Stamp;
use probecell_msgs::{OperationReport, OperationRequest, PartReport, PartStatus, PlanId};

use crate::{
    config::Config,
    ending::end,
    ports::{Out, Output},
    state::{PendingRequest, Run, Stage, State, Stopping},
};

/// Timer of the checks of a part.
pub(crate) const TICK: u32 = 1;
/// s between two checks.
const TICK_PERIOD: f64 = 0.5;
/// s after which a request that was not taken is repeated.
const REPEAT_PERIOD: f64 = 1.0;
/// s between two messages of the status of a part.
const STATUS_PERIOD: f64 = 1.0;
/// s in which the machine has to confirm that it stands.
const STOP_LIMIT: f64 = 10.0;

/// Sends a request for the run; gives its number.
pub(crate) fn request(
    state: &mut State,
    now: Stamp,
    run: &mut Run,
    asked: OperationRequest,
    out: &mut Out,
) -> u64 {
    let request_id = state.next_request;
    state.next_request += 1;
    let request = OperationRequest {
        header: now.header(""),
        request_id,
        run_id: run.run_id.clone(),
        ..asked
    };
    out.send(Output::Request(request.clone()));
    run.since = now;
    run.asked = Some(PendingRequest {
        request,
        taken: false,
        heard: now,
        sent: now,
    });
    request_id
}

/// Holds the orders and tells the machine to stop; the part ends when it has confirmed that, or has not in time.
pub(crate) fn stop(state: &mut State, now: Stamp, text: &str, out: &mut Out) {
    state.book.hold(text);
    let Some(mut run) = state.run.take() else {
        return;
    };
    if run.stopping.is_none() {
        let asked = OperationRequest {
            kind: OperationRequest::STOP,
            pass_number: run.pass,
            ..OperationRequest::default()
        };
        let request_id = request(state, now, &mut run, asked, out);
        run.stopping = Some(Stopping {
            request_id,
            text: text.to_owned(),
            void: false,
        });
    }
    state.run = Some(run);
}

/// Takes a report on a request. True for its outcome, false for the acknowledgement that it is under way.
pub(crate) fn take_report(run: &mut Run, now: Stamp, report: &OperationReport) -> bool {
    let asked = run.asked.as_mut();
    let Some(asked) = asked.filter(|asked| asked.request.request_id == report.request_id) else {
        return false;
    };
    (asked.taken, asked.heard) = (true, now);
    let answered = report.outcome != OperationReport::UNDERWAY;
    if answered {
        // No answer to it is expected any more.
        run.asked = None;
        run.since = now;
    }
    answered
}

/// Checks what is overdue, repeats a request that was not taken, and publishes the status once a second.
pub(crate) fn tick(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    state.ticking = false;
    let Some(run) = &mut state.run else { return };
    if let Some(asked) = &mut run.asked
        && !asked.taken
        && now.since_s(asked.sent) >= REPEAT_PERIOD
    {
        asked.sent = now;
        out.send(Output::Request(asked.request.clone()));
    }
    if let Some(text) = overdue(config, run, now) {
        match &run.stopping {
            Some(stopping) => {
                let text = format!("{}; {text}", stopping.text);
                end(state, now, PartReport::STOPPED, &text, out);
            }
            None => stop(state, now, &text, out),
        }
    }
    if (state.run.as_ref()).is_some_and(|run| now.since_s(run.told) >= STATUS_PERIOD) {
        publish(config, state, now, out);
    }
}

/// Has the part under way checked again.
pub(crate) fn wake(state: &mut State, now: Stamp, out: &mut Out) {
    if state.run.is_some() && !state.ticking {
        state.ticking = true;
        out.wake_at(now.after_s(TICK_PERIOD), TICK);
    }
}

/// What has taken too long, in a sentence.
fn overdue(config: &Config, run: &Run, now: Stamp) -> Option<String> {
    let late = |since: Stamp, limit: f64| now.since_s(since) > limit;
    if run.stopping.is_some() {
        return late(run.since, STOP_LIMIT).then(|| {
            format!("the machine has not confirmed its standstill within {STOP_LIMIT} s")
        });
    }
    if let Some(asked) = &run.asked
        && late(asked.heard, config.answer_limit)
    {
        let limit = config.answer_limit;
        return Some(format!(
            "machine_state has not answered the request for {limit} s"
        ));
    }
    let limit = limit(config, run);
    late(run.since, limit).then(|| match &run.stage {
        Stage::Measuring {
            plan_id,
            done: true,
            ..
        } => {
            format!("no decision on {plan_id} arrived in time")
        }
        Stage::Correcting { awaited, .. } => {
            let ids = awaited.iter().cloned().collect::<Vec<_>>().join(", ");
            format!("{ids} was not acknowledged within {limit} s")
        }
        _ => format!("the operation or measurement has lasted longer than {limit} s"),
    })
}

/// Longest time of the stage, s.
fn limit(config: &Config, run: &Run) -> f64 {
    match run.stage {
        _ if run.stopping.is_some() => STOP_LIMIT,
        Stage::Measuring { done: true, .. } => config.decision_limit,
        Stage::Correcting { .. } => config.correction_limit,
        Stage::Cutting { .. } | Stage::Measuring { .. } | Stage::OnlyMeasuring { .. } => {
            config.operation_limit
        }
    }
}

/// Publishes the status of the part, or that there is none.
pub(crate) fn publish(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let Some(run) = &mut state.run else {
        out.send(Output::Status(PartStatus {
            header: now.header(""),
            run_number: state.runs,
            ..PartStatus::default()
        }));
        return;
    };
    run.told = now;
    let (stage, plan_id) = shown(run);
    let operation = match &run.asked {
        Some(asked) if stage == PartStatus::CUTTING => asked.request.operation.clone(),
        _ => String::new(),
    };
    out.send(Output::Status(PartStatus {
        header: now.header(""),
        stage,
        run_number: run.number,
        run_id: run.run_id.clone(),
        part_id: run.part_id.clone(),
        pass_number: run.pass,
        operation,
        plan_id: plan_id.map(ToString::to_string).unwrap_or_default(),
        since: run.since.time(),
        deadline: run.since.after_s(limit(config, run)).time(),
    }));
}

/// What distinguishes one stage of the part from the next: run, `PartStatus` constant, begin.
pub(crate) fn stage(state: &State) -> Option<(String, u8, Stamp)> {
    let run = state.run.as_ref()?;
    Some((run.run_id.clone(), shown(run).0, run.since))
}

/// `PartStatus` constant of the stage, and the plan that is measured or decided on.
fn shown(run: &Run) -> (u8, Option<&PlanId>) {
    let (stage, plan_id) = match &run.stage {
        Stage::Cutting { .. } => (PartStatus::CUTTING, None),
        Stage::Measuring { plan_id, done, .. } => {
            let stage = if *done {
                PartStatus::DECIDING
            } else {
                PartStatus::MEASURING
            };
            (stage, Some(plan_id))
        }
        Stage::OnlyMeasuring { plan_id, .. } => (PartStatus::MEASURING, Some(plan_id)),
        Stage::Correcting { plan_id, .. } => (PartStatus::CORRECTING, Some(plan_id)),
    };
    if run.stopping.is_some() {
        return (PartStatus::STOPPING, plan_id);
    }
    (stage, plan_id)
}
