//! What must hold of each command, by what has happened and what the gate has heard.

use graph::{Stamp, topics};
use probecell_msgs::{
    ControllerCommand, ControllerStatus, Correction, OperatorKeys, PartReport, PartStatus, from_cdr,
};
use signatures::{Approval, SecretKey, Trust};

use super::{
    PERIOD, Search,
    state::{Heard, State},
};
use crate::settings::{PART_LIMIT, WEAR_LIMIT};

/// A message reaches the gate.
pub(super) fn hear(search: &Search, state: &mut State, topic: &str, payload: u32) {
    let bytes = search.store.bytes(payload);
    let period = state.period;
    let heard = &mut state.heard;
    if topic == topics::CORRECTIONS.name {
        let rejected = from_cdr::<Correction>(&bytes)
            .is_ok_and(|one| one.approval == Correction::APPROVAL_REJECTED);
        heard.rejected |= rejected;
    } else if topic == topics::PART_REPORTS.name {
        heard.over |= from_cdr::<PartReport>(&bytes).is_ok();
    } else if topic == topics::STOP_REQUESTS.name {
        heard.stopped = true;
    } else if topic == topics::OPERATOR_KEYS.name {
        let number = from_cdr::<OperatorKeys>(&bytes).map_or(0, |keys| keys.number);
        heard.keys = heard.keys.max((number, Some(payload)));
    } else if topic == topics::CONTROLLER_STATUS.name {
        let session = from_cdr::<ControllerStatus>(&bytes).map(|sample| sample.session);
        let known = (0..=state.driver.restarts).rev();
        let mut known = known.filter(|&one| session.as_ref() == Ok(&search.session(one)));
        heard.session = known.next().unwrap_or(heard.session);
    } else if topic == topics::PART_STATUS.name
        && let Ok(status) = from_cdr::<PartStatus>(&bytes)
    {
        heard.over |= [PartStatus::NONE, PartStatus::STOPPING].contains(&status.stage);
        let stamp = Stamp::from(&status.header.stamp).0;
        if stamp >= heard.alive.1 {
            heard.alive = (period, stamp);
        }
    }
}

/// Why a command must not be.
pub(super) fn command(
    search: &Search,
    state: &mut State,
    now: Stamp,
    payload: u32,
    writes: &mut usize,
) -> Option<String> {
    let command: ControllerCommand = from_cdr(&search.store.bytes(payload)).ok()?;
    let first = !std::mem::replace(&mut state.heard.commanded, true);
    if first && command.kind != ControllerCommand::STOP {
        return Some("the first command of a gate is not STOP".to_owned());
    }
    if command.kind != ControllerCommand::SET_TOOL_WEAR {
        return None;
    }
    *writes += 1;
    let id = &command.correction_id;
    if !state.written.insert(id.clone()) {
        return Some(format!("{id} is written twice"));
    }
    let trust = Trust {
        cell: Some(SecretKey::of_simulations().public()),
        automatic: false,
        unsigned_operators: false,
    };
    let keys = state.heard.keys.1.map(|keys| search.store.bytes(keys));
    let keys = keys.and_then(|keys| from_cdr::<OperatorKeys>(&keys).ok());
    let signed = (state.approved.iter())
        .filter_map(|&payload| from_cdr::<Correction>(&search.store.bytes(payload)).ok())
        .filter(|one| {
            one.correction_id == *id
                && (one.tool_number, one.new_value) == (command.tool_number, command.value)
                && trust.check(keys.as_ref(), one) == Ok(Approval::Signed)
        });
    let mut broken = "without a signature of an operator in force";
    for signed in signed {
        match wrong(search, state, now, &command, &signed) {
            None => return None,
            Some(what) => broken = what,
        }
    }
    Some(format!("{id} is written {broken}"))
}

/// Why a write must not be, though its correction is signed.
fn wrong(
    search: &Search,
    state: &State,
    now: Stamp,
    command: &ControllerCommand,
    signed: &Correction,
) -> Option<&'static str> {
    let Heard {
        rejected,
        over,
        stopped,
        alive: (alive, _),
        session,
        began,
        ..
    } = state.heard;
    let silent = i64::from(state.period - alive) * PERIOD;
    let limit = WEAR_LIMIT.min(signed.upper_bound);
    let session = search.session(session);
    let why = [
        (
            command.value > limit || command.value < signed.lower_bound.max(-WEAR_LIMIT),
            "out of bounds",
        ),
        (
            signed.plan_id != search.proposed[0].plan_id || signed.sequences.is_empty(),
            "without a source",
        ),
        (
            signed.session != session || command.session != session,
            "in another session of the driver",
        ),
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
    broken.map(|(_, what)| *what)
}
