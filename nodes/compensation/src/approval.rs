//! Corrections that wait for an operator: approved, rejected, or withdrawn.
//!
//! A correction that is not answered in time, one that is rejected, and the end of the part withdraw everything that was
//! proposed for the part: none of it may reach the machine.

use graph::{Outbox, Stamp};
use probecell_msgs::{Correction, OperatorReply, OperatorRequest, PassDecision};

use crate::{
    config::Config,
    state::State,
    step::{CompensationFault, Output},
};

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
pub(crate) fn overdue(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
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

pub(crate) fn approve(
    state: &mut State,
    now: Stamp,
    request: &OperatorRequest,
    out: &mut Outbox<Output>,
) {
    let mut reply = OperatorReply {
        header: now.header(""),
        request_id: request.request_id,
        accepted: false,
        text: format!("no correction {:?} waits for approval", request.subject),
    };
    if let Some(why) = state.withdrawn.get(&request.subject) {
        reply.text = format!("correction {:?} {why}", request.subject);
    }
    if request.operator_name.is_empty() {
        "an approval needs the name of the operator".clone_into(&mut reply.text);
    } else if let Some((correction, pass)) = state.proposed.remove(&request.subject) {
        let id = &correction.correction_id;
        let end = if !request.approve {
            Some(format!(
                "{} rejected correction {id}",
                request.operator_name
            ))
        } else if now > Stamp::from(&correction.expires) {
            reply.text = format!("correction {id:?} has expired");
            Some(format!("correction {id} was not approved: it has expired"))
        } else {
            None
        };
        let late = request.approve && end.is_some();
        if let Some(text) = end {
            // The part ends with it: nothing else that was proposed for it is to reach the machine.
            withdraw(state, now, PART_ENDED);
            out.send(Output::Decision(PassDecision {
                header: now.header(""),
                plan_id: correction.plan_id.clone(),
                pass_number: pass,
                decision: PassDecision::STOP,
                text,
                ..PassDecision::default()
            }));
        }
        if !late {
            reply.accepted = true;
            reply.text = String::new();
            out.send(Output::Correction(Correction {
                header: now.header(""),
                approval: if request.approve {
                    Correction::APPROVAL_OPERATOR
                } else {
                    Correction::APPROVAL_REJECTED
                },
                approved_by: request.operator_name.clone(),
                ..correction
            }));
        }
    }
    out.send(Output::Reply(reply));
}
