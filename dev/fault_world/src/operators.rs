//! Operators: what they answer to a proposal, and what a stranger makes of it.

use cell_tests::session::{answer, approved};
use graph::Stamp;
use probecell_msgs::{Correction, OperatorRequest};

use crate::fault::{Forgery, Mood};

/// s that an operator takes before an answer.
const THINKING: f64 = 0.8;
/// s; shortly before a proposal expires, by the settings of [`crate::settings`].
const LATE: f64 = 19.9;

/// The answers to a proposal: s after it, who, and whether it is approved.
pub(crate) fn answers(mood: Option<Mood>, nth: u64) -> Vec<(f64, &'static str, bool)> {
    match mood {
        None => vec![(THINKING + 0.1 * nth as f64, "Ada", true)],
        Some(Mood::Absent) => Vec::new(),
        Some(Mood::Reject) => vec![(THINKING, "Grace", false)],
        Some(Mood::RejectLater) => vec![(THINKING + 0.01 * nth as f64, "Ada", nth == 0)],
        Some(Mood::Disagree) => vec![(THINKING, "Ada", true), (THINKING, "Grace", false)],
        Some(Mood::Twice) => vec![(THINKING, "Ada", true), (THINKING + 0.2, "Ada", true)],
        Some(Mood::Withdrawn) => vec![(THINKING, "Eve", true), (2.0 * THINKING, "Ada", true)],
        Some(Mood::Late) => vec![(LATE, "Ada", true)],
    }
}

/// The request of an answer.
pub(crate) fn request(
    correction: &Correction,
    (by, approve): (&str, bool),
    now: Stamp,
    request_id: u64,
) -> OperatorRequest {
    OperatorRequest {
        request_id,
        ..answer(correction, by, approve, now)
    }
}

/// What a stranger puts in the place of a correction.
pub(crate) fn forged(forgery: Forgery, last: &Correction, now: Stamp) -> Correction {
    let fresh = |changed: Correction| {
        let correction = Correction {
            header: now.header(""),
            correction_id: format!("{}/forged-{}", changed.correction_id, now.0),
            ..changed
        };
        approved(correction, "Ada", now)
    };
    let last = last.clone();
    match forgery {
        Forgery::Again => last,
        Forgery::Value => Correction {
            header: now.header(""),
            new_value: last.new_value + 5e-3,
            upper_bound: 1.0,
            ..last
        },
        Forgery::Identifier => Correction {
            header: now.header(""),
            correction_id: format!("{}/again", last.correction_id),
            ..last
        },
        Forgery::Unsigned => Correction {
            header: now.header(""),
            correction_id: format!("{}/unsigned", last.correction_id),
            approval: Correction::APPROVAL_POLICY,
            approved_by: "policy".to_owned(),
            approved_at: now.time(),
            signature: Vec::new(),
            ..last
        },
        Forgery::Withdrawn => {
            let correction = Correction {
                correction_id: format!("{}/withdrawn", last.correction_id),
                ..last
            };
            approved(correction, "Eve", now)
        }
        Forgery::OutOfBounds => fresh(Correction {
            new_value: 5e-3,
            lower_bound: -1.0,
            upper_bound: 1.0,
            ..last
        }),
        Forgery::NoSource => fresh(Correction {
            plan_id: format!("{}0", last.plan_id),
            ..last
        }),
        Forgery::Sound => fresh(last),
        Forgery::Session => fresh(Correction {
            session: "another".to_owned(),
            ..last
        }),
    }
}
