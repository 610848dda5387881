//! Every step of every correction in the order in which it happened: proposed, asked for, approved, answered.
//!
//! A step is one recorded message with its own stamp, so that who let what pass, and when, can be audited against the
//! recording. A correction that no step but its proposal follows is named: it waits, or the session ended before it.

use std::collections::BTreeSet;

use crate::kit::{Page, Table};
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, OperatorRequest, builtin_interfaces::Time,
};

use super::tables::{answered, subject};
use super::wording::{between, um, um_size};
use super::{PartSession, moment};

/// One message about a correction.
struct Step {
    stamp: Time,
    correction: String,
    what: String,
    value: String,
    bounds: String,
    source: String,
}

/// Adds the section; nothing where no correction was proposed or asked for.
pub(super) fn add(page: &mut Page, session: &PartSession) {
    let mut steps: Vec<Step> = (session.corrections.iter())
        .map(proposed_or_approved)
        .chain(
            session
                .approvals
                .iter()
                .map(|one| request_step(session, one)),
        )
        .chain(session.acknowledgements.iter().map(at_the_machine))
        .collect();
    if steps.is_empty() {
        return;
    }
    // Stable: of steps of one instant a correction stands before the answer to it.
    steps.sort_by_key(|step| step.stamp.nanos());
    let mut table = Table::new(
        "Approvals, commands and answers of the machine",
        &[
            "when",
            "correction",
            "what happened",
            "from, to",
            "bounds",
            "source measurement",
        ],
    );
    for step in steps {
        table.row(vec![
            moment(step.stamp),
            step.correction,
            step.what,
            step.value,
            step.bounds,
            step.source,
        ]);
    }
    page.heading("Corrections, step by step").table(&table);
    let waiting = unanswered(session);
    if !waiting.is_empty() {
        page.paragraph(&format!(
            "Proposed and never approved, so never written: {}.",
            waiting.join(", ")
        ));
    }
}

fn proposed_or_approved(correction: &Correction) -> Step {
    let by = &correction.approved_by;
    Step {
        stamp: correction.header.stamp,
        correction: correction.correction_id.clone(),
        what: match correction.approval {
            Correction::APPROVAL_POLICY => format!(
                "{}: proposed, and approved by {by}, without an operator",
                subject(correction)
            ),
            Correction::APPROVAL_OPERATOR => format!("approved by {by}"),
            Correction::APPROVAL_REJECTED => format!("rejected by {by}"),
            _ => format!(
                "{}: proposed, valid until {}",
                subject(correction),
                moment(correction.expires)
            ),
        },
        value: format!(
            "{}, {}",
            um(correction.previous_value),
            um(correction.new_value)
        ),
        bounds: between(correction.lower_bound, correction.upper_bound),
        source: format!(
            "{}: {}, {} touches, error {}, u {}",
            correction.plan_id,
            correction.feature_ids.join(", "),
            correction.sequences.len(),
            um(correction.measured_error),
            um_size(correction.standard_uncertainty)
        ),
    }
}

fn request_step(session: &PartSession, request: &OperatorRequest) -> Step {
    let said = if request.approve {
        "to approve it"
    } else {
        "to reject it"
    };
    let who = if request.operator_name.is_empty() {
        "an unnamed operator"
    } else {
        &request.operator_name
    };
    let answer =
        (session.approval_replies.iter()).find(|reply| reply.request_id == request.request_id);
    let answer = match answer {
        None => "no answer was recorded".to_owned(),
        Some(reply) if reply.accepted => "accepted".to_owned(),
        Some(reply) => format!("refused: {}", reply.text),
    };
    Step {
        stamp: request.header.stamp,
        correction: request.subject.clone(),
        what: format!("{who} asked {said}: {answer}"),
        value: String::new(),
        bounds: String::new(),
        source: String::new(),
    }
}

fn at_the_machine(answer: &CorrectionAcknowledgement) -> Step {
    Step {
        stamp: answer.header.stamp,
        correction: answer.correction_id.clone(),
        what: format!("at the machine: {}", answered(answer)),
        value: format!("{}, {}", um(answer.value_before), um(answer.value_after)),
        bounds: String::new(),
        source: String::new(),
    }
}

/// Corrections that were proposed, and neither approved, rejected nor answered.
fn unanswered(session: &PartSession) -> Vec<&str> {
    let ended: BTreeSet<&str> = (session.corrections.iter())
        .filter(|one| one.approval != Correction::APPROVAL_NONE)
        .map(|one| one.correction_id.as_str())
        .chain((session.acknowledgements.iter()).map(|one| one.correction_id.as_str()))
        .collect();
    let mut known = BTreeSet::new();
    (session.corrections.iter())
        .map(|one| one.correction_id.as_str())
        .filter(|id| !ended.contains(id) && known.insert(*id))
        .collect()
}
