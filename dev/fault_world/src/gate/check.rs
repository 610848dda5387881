//! What must hold of each write, by what has happened and what the gate has heard.

use graph::{Stamp, topics};
use probecell_msgs::{
    ControllerCommand, Correction, OperatorKeys, PartReport, PartStatus, from_cdr,
};
use trust::{Approval, SecretKey, Trust};

use super::{
    PERIOD, Search,
    state::{Heard, State},
};
use crate::settings::{PART_LIMIT, WEAR_LIMIT};

/// A message reaches the gate.
pub(super) fn hear(state: &mut State, topic: &str, payload: &[u8]) {
    let heard = &mut state.heard;
    if topic == topics::CORRECTIONS.name {
        let rejected = from_cdr::<Correction>(payload)
            .is_ok_and(|one| one.approval == Correction::APPROVAL_REJECTED);
        heard.rejected |= rejected;
    } else if topic == topics::PART_REPORTS.name {
        heard.over |= from_cdr::<PartReport>(payload).is_ok();
    } else if topic == topics::STOP_REQUESTS.name {
        heard.stopped = true;
    } else if topic == topics::PART_STATUS.name
        && let Ok(status) = from_cdr::<PartStatus>(payload)
    {
        heard.over |= [PartStatus::NONE, PartStatus::STOPPING].contains(&status.stage);
        heard.alive = state.period;
    }
}

/// Why a write must not be.
pub(super) fn write(
    search: &Search,
    state: &mut State,
    now: Stamp,
    command: &ControllerCommand,
) -> Option<String> {
    let id = &command.correction_id;
    if !state.written.insert(id.clone()) {
        return Some(format!("{id} is written twice"));
    }
    let trust = Trust {
        cell: Some(SecretKey::of_simulations().public()),
        automatic: false,
        unsigned_operators: false,
    };
    let keys = state.latched.get(topics::OPERATOR_KEYS.name);
    let keys = keys.and_then(|keys| from_cdr::<OperatorKeys>(&keys.back()?.payload).ok());
    let signed = (state.published.iter())
        .filter_map(|letter| from_cdr::<Correction>(&letter.payload).ok())
        .find(|one| {
            one.correction_id == *id
                && one.approval == Correction::APPROVAL_OPERATOR
                && trust.check(keys.as_ref(), one) == Ok(Approval::Signed)
                && (one.tool_number, one.new_value) == (command.tool_number, command.value)
        });
    let Some(signed) = signed else {
        return Some(format!("{id} is written without a signature"));
    };
    let Heard {
        rejected,
        over,
        stopped,
        alive,
        began,
    } = state.heard;
    let silent = i64::from(state.period - alive) * PERIOD;
    let limit = WEAR_LIMIT.min(signed.upper_bound);
    let why = [
        (
            command.value > limit || command.value < signed.lower_bound.max(-WEAR_LIMIT),
            "out of bounds",
        ),
        (
            signed.plan_id != search.proposed[0].plan_id || signed.sequences.is_empty(),
            "without a source",
        ),
        (signed.session != command.session, "of another session"),
        (rejected, "after a rejection"),
        (stopped, "after a STOP"),
        (over, "for a part that has ended or is being stopped"),
        (
            silent as f64 * 1e-9 > PART_LIMIT,
            "for a part of which nothing has been heard",
        ),
        (
            Stamp::from(&signed.approved_at).0 < began,
            "though it was approved before the gate began",
        ),
        (now > Stamp::from(&signed.expires), "after it has expired"),
    ];
    let broken = why.iter().find(|(broken, _)| *broken);
    broken.map(|(_, what)| format!("{id} is written {what}"))
}
