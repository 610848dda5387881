//! The beginning of a run: whether it may begin, and its identity.

use graph::Stamp;
use probecell_msgs::{OperationRequest, OperatorRequest, PlanId};

use crate::{
    part_name::{self, MARK},
    ports::Out,
    requests,
    state::{REFUTED, Run, Stage, State},
};

/// What a request to resume a measurement is told that is not there, or void.
pub(crate) const NOTHING_RESUMED: &str = "nothing can be resumed";

/// Why a run does not begin: checked before anything moves.
pub(crate) fn refusal(
    state: &State,
    now: Stamp,
    asked: &OperatorRequest,
    last: Option<&Run>,
) -> Option<&'static str> {
    let expires = Stamp::from(&asked.expires);
    let name = part_name::refusal(&asked.subject);
    match &state.run {
        _ if expires != Stamp(0) && now > expires => {
            Some("the request came too late: it has expired")
        }
        Some(run) if matches!(run.stage, Stage::OnlyMeasuring { .. }) => {
            Some("a part is being measured")
        }
        Some(_) => Some("a part is being made"),
        None if !state.informed => {
            Some("machine_state has not reported yet which parts were made before")
        }
        None if name.is_some() => name,
        None if asked.plan_id.is_empty() && state.refuted.is_some() => Some(REFUTED),
        None => match last {
            Some(run) if asked.subject.is_empty() || asked.subject == run.part_id => None,
            Some(_) => Some("the plan belongs to another part"),
            None if !asked.subject.is_empty() => None,
            None if asked.plan_id.is_empty() => Some("the request names no part"),
            None => Some(NOTHING_RESUMED),
        },
    }
}

/// A run of its own. Its identity is the name of the part where no other run of the session can have it, else the name
/// and the number of the run.
pub(crate) fn begin(state: &mut State, now: Stamp, part_id: &str) -> Run {
    let all_known = state.runs == state.used.len() as u64;
    state.runs += 1;
    let number = state.runs;
    let run_id = if all_known && !state.used.contains(part_id) {
        part_id.to_owned()
    } else {
        format!("{part_id}{MARK}{number}")
    };
    state.used.insert(run_id.clone());
    Run {
        part_id: part_id.to_owned(),
        run_id,
        number,
        order_id: 0,
        since: now,
        asked: None,
        told: now,
        pass: 0,
        attempt: 0,
        cuts: 0,
        stage: Stage::Cutting {
            index: 0,
            request_id: 0,
        },
        stopping: None,
    }
}

/// Resumes the measurement with which a part ended.
pub(crate) fn resume(state: &mut State, now: Stamp, mut run: Run, out: &mut Out) {
    let only = matches!(run.stage, Stage::OnlyMeasuring { .. });
    let Some(plan_id) = run.stage.plan_id().cloned() else {
        return;
    };
    run.stopping = None;
    state.book.resumed(&run);
    let request_id = measure(state, now, &mut run, &plan_id, only, out);
    run.stage = if only {
        Stage::OnlyMeasuring {
            plan_id,
            request_id,
        }
    } else {
        Stage::Measuring {
            plan_id,
            request_id,
            done: false,
            decision: None,
        }
    };
    state.run = Some(run);
}

/// Requests a measurement and returns the number of the request.
pub(crate) fn measure(
    state: &mut State,
    now: Stamp,
    run: &mut Run,
    plan_id: &PlanId,
    only_measure: bool,
    out: &mut Out,
) -> u64 {
    let asked = OperationRequest {
        kind: OperationRequest::MEASURE,
        plan_id: plan_id.to_string(),
        pass_number: run.pass,
        only_measure,
        ..OperationRequest::default()
    };
    requests::request(state, now, run, asked, out)
}
