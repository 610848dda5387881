//! Corrections that wait for an operator: approved, rejected, or withdrawn.
//!
//! A correction that is not answered in time, one that is rejected, and the end of the part withdraw everything that was
//! proposed for the part: none of it may reach the machine.

use graph::Stamp;
use probecell_msgs::{Correction, OperatorReply, OperatorRequest, PassDecision};
use signatures::Approval;

use crate::{
    config::Config,
    ports::{CompensationFault, Out, Output},
    state::State,
};

/// Timer at which unanswered proposals are looked for.
pub(crate) const APPROVAL: u32 = 1;
/// Why what was proposed for a part is void.
pub(crate) const PART_ENDED: &str = "is void: its part has ended";

/// When a proposal is withdrawn.
pub(crate) fn due(config: &Config, proposed: &Correction) -> Stamp {
    Stamp::from(&proposed.header.stamp).after_s(config.approval_limit)
}

/// Withdraws what was proposed up to an instant.
pub(crate) fn withdraw(state: &mut State, until: Stamp, why: &str) {
    state.proposed.retain(|id, (correction, _)| {
        let stays = Stamp::from(&correction.header.stamp) > until;
        if !stays {
            state.withdrawn.insert(id.clone(), why.to_owned());
        }
        stays
    });
}

/// Stops the part where a proposed correction was not answered in time, and withdraws everything proposed for it.
pub(crate) fn overdue(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let overdue: Vec<&str> = (state.proposed.values())
        .filter(|(correction, _)| due(config, correction) <= now)
        .map(|(correction, _)| correction.correction_id.as_str())
        .collect();
    if overdue.is_empty() {
        return;
    }
    let text = format!(
        "nobody approved or rejected {} within {} s",
        overdue.join(", "),
        config.approval_limit
    );
    out.fault(now, CompensationFault::ApprovalOverdue, text.as_str());
    if let Some((correction, pass)) = state.proposed.values().next() {
        out.send(Output::Decision(PassDecision {
            header: now.header(""),
            plan_id: correction.plan_id.clone(),
            pass_number: *pass,
            decision: PassDecision::STOP,
            text,
            ..PassDecision::default()
        }));
    }
    withdraw(state, now, "has expired");
}

/// Takes an operator's approval or rejection of a proposal; what is not signed by an operator of the cell is refused, and
/// the proposal stays pending.
pub(crate) fn approve(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: &OperatorRequest,
    out: &mut Out,
) {
    let taken = match answered(config, state, now, request) {
        Ok((answer, approval)) => {
            if approval == Approval::Unsigned {
                let (by, id) = (&answer.approved_by, &answer.correction_id);
                let text = format!(
                    "{id} was answered in the name of {by} without a signature, which \
                     approvals.unsigned_operators allows"
                );
                out.fault(now, CompensationFault::ApprovalUnsigned, text);
            }
            settle(state, now, answer, out)
        }
        Err(text) => Err(text),
    };
    out.send(Output::Reply(OperatorReply {
        header: now.header(""),
        request_id: request.request_id,
        accepted: taken.is_ok(),
        text: taken.err().unwrap_or_default(),
    }));
}

/// The proposal with the answer of an operator who may give it.
fn answered(
    config: &Config,
    state: &State,
    now: Stamp,
    request: &OperatorRequest,
) -> Result<(Correction, Approval), String> {
    if request.operator_name.is_empty() {
        return Err("an approval needs the name of the operator".to_owned());
    }
    let Some((proposed, _)) = state.proposed.get(&request.subject) else {
        return Err(match state.withdrawn.get(&request.subject) {
            Some(why) => format!("correction {:?} {why}", request.subject),
            None => format!("no correction {:?} waits for approval", request.subject),
        });
    };
    let approval = if request.approve {
        Correction::APPROVAL_OPERATOR
    } else {
        Correction::APPROVAL_REJECTED
    };
    let signed = !request.signature.is_empty();
    let answer = Correction {
        header: now.header(""),
        approval,
        approved_by: request.operator_name.clone(),
        approved_at: if signed {
            request.signed_at
        } else {
            now.time()
        },
        shown: request.shown.clone(),
        signature: request.signature.clone(),
        ..proposed.clone()
    };
    let approval = (config.trust.check(state.keys.as_ref(), &answer))
        .and_then(|approval| signatures::approval::is_fresh(now.0, &answer).map(|()| approval));
    match approval {
        Ok(approval) => Ok((answer, approval)),
        Err(why) => Err(why.to_string()),
    }
}

/// Publishes an answer; a rejection, and an approval that comes too late, end the part.
fn settle(state: &mut State, now: Stamp, answer: Correction, out: &mut Out) -> Result<(), String> {
    let id = &answer.correction_id;
    let pass = state.proposed.remove(id).map_or(0, |(_, pass)| pass);
    let late =
        answer.approval == Correction::APPROVAL_OPERATOR && now > Stamp::from(&answer.expires);
    let end = if answer.approval == Correction::APPROVAL_REJECTED {
        Some(format!("{} rejected correction {id}", answer.approved_by))
    } else {
        late.then(|| format!("correction {id} was not approved: it has expired"))
    };
    if let Some(text) = end {
        // The part ends with it: nothing else that was proposed for it is to reach the machine.
        withdraw(state, now, PART_ENDED);
        out.send(Output::Decision(PassDecision {
            header: now.header(""),
            plan_id: answer.plan_id.clone(),
            pass_number: pass,
            decision: PassDecision::STOP,
            text,
            ..PassDecision::default()
        }));
    }
    if late {
        return Err(format!("correction {id:?} has expired"));
    }
    out.send(Output::Correction(answer));
    Ok(())
}
