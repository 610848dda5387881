//! Writes corrections to the controller, one after the other while no program runs, and acknowledges each by what the
//! driver has read back.
//!
//! Whether one may be written at all is decided by the gate (`crate::gate`), at the moment of writing.

use graph::Stamp;
use probecell_msgs::{
    ControllerCommand, ControllerReply, Correction, CorrectionAcknowledgement, CorrectionKind,
    offset,
};

use crate::{
    command,
    config::Config,
    gate,
    ports::{Out, Output},
    state::{ReadBack, State, Writing},
    table,
};

/// Queues an approved correction; one that is only proposed, or rejected, is ignored.
pub(crate) fn correct(
    config: &Config,
    state: &mut State,
    now: Stamp,
    correction: Correction,
    out: &mut Out,
) {
    // Made before this process began: whether its predecessor has written it is not known here, and the part has been
    // stopped. It is neither written nor answered a second time.
    if Stamp::from(&correction.header.stamp).0 < state.started as i64 {
        return;
    }
    if correction.approval == Correction::APPROVAL_REJECTED {
        state.rejected.insert(correction.plan_id.clone());
    }
    let inert = [Correction::APPROVAL_NONE, Correction::APPROVAL_REJECTED];
    let known = |other: &Correction| other.correction_id == correction.correction_id;
    if inert.contains(&correction.approval)
        || (state.writing.values()).any(|writing| known(&writing.correction))
        || state.deferred.iter().any(known)
    {
        return;
    }
    // It may wait here for a program to end, but not on its way. What is refused whenever it was signed is not asked when.
    let answered = state.applied.contains_key(&correction.correction_id)
        || config.replayed
        || correction.replayed;
    if let (false, Err(why)) = (answered, signatures::approval::is_fresh(now.0, &correction)) {
        let outcome = CorrectionAcknowledgement::REFUSED_STALE;
        let read = unread(&correction);
        return acknowledge(now, &correction, outcome, read, &why.to_string(), out);
    }
    state.deferred.push_back(correction);
    write_deferred(config, state, now, out);
}

pub(crate) fn write_deferred(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    while state.operation.is_none() && state.writing.is_empty() {
        let Some(correction) = state.deferred.pop_front() else {
            return;
        };
        write(config, state, now, &correction, out);
    }
}

fn write(config: &Config, state: &mut State, now: Stamp, correction: &Correction, out: &mut Out) {
    if let Some(read) = state.applied.get(&correction.correction_id).cloned() {
        let outcome = CorrectionAcknowledgement::ALREADY_APPLIED;
        let text = "it has been applied already";
        acknowledge(now, correction, outcome, read, text, out);
        return;
    }
    let kind = match gate::check(config, state, now, correction) {
        Ok(kind) => kind,
        Err(refusal) => {
            let read = unread(correction);
            return acknowledge(now, correction, refusal.outcome, read, &refusal.text, out);
        }
    };
    let command_id = command::send(state, now, command_of(kind, correction), out);
    let writing = Writing {
        correction: correction.clone(),
        until: now.after_s(config.reply_limit),
    };
    state.writing.insert(command_id, writing);
}

/// Nothing was read: the entries of a table stay unknown, a scalar is what the correction was computed from.
fn unread(correction: &Correction) -> ReadBack {
    let held = correction.previous_value;
    ReadBack {
        before: held,
        after: held,
        ..ReadBack::default()
    }
}

/// The command that writes a correction to the controller.
fn command_of(kind: CorrectionKind, correction: &Correction) -> ControllerCommand {
    let command = ControllerCommand {
        correction_id: correction.correction_id.clone(),
        ..ControllerCommand::default()
    };
    match kind {
        CorrectionKind::ToolPath => ControllerCommand {
            kind: ControllerCommand::SET_TOOL_PATH,
            feature: correction.feature_ids.first().cloned().unwrap_or_default(),
            path: correction.path.clone(),
            ..command
        },
        CorrectionKind::Volumetric => ControllerCommand {
            kind: ControllerCommand::SET_VOLUMETRIC,
            entries: correction.entries.clone(),
            values: correction.new_values.clone(),
            ..command
        },
        CorrectionKind::WorkOffset => ControllerCommand {
            kind: ControllerCommand::SET_WORK_OFFSET,
            axis: correction.axis.clone(),
            value: correction.new_value,
            ..command
        },
        CorrectionKind::ToolWear => ControllerCommand {
            kind: ControllerCommand::SET_TOOL_WEAR,
            tool_number: correction.tool_number,
            value: correction.new_value,
            ..command
        },
    }
}

/// Acknowledges a correction by the driver's reply to its command.
pub(crate) fn reply(
    state: &mut State,
    now: Stamp,
    correction: &Correction,
    reply: &ControllerReply,
    out: &mut Out,
) {
    let (read, written) = read_back(correction, reply);
    let done = reply.outcome == ControllerReply::DONE && written;
    let (outcome, text) = if done {
        (CorrectionAcknowledgement::APPLIED, "")
    } else if reply.text.is_empty() {
        let text = "the value read back differs from the value written";
        (CorrectionAcknowledgement::FAILED, text)
    } else {
        (CorrectionAcknowledgement::FAILED, reply.text.as_str())
    };
    if done {
        let id = correction.correction_id.clone();
        state.applied.insert(id, read.clone());
        if let (Correction::TOOL_PATH, Some(feature)) =
            (correction.kind, correction.feature_ids.first())
        {
            state.paths.insert(feature.clone(), reply.value);
        }
    }
    acknowledge(now, correction, outcome, read, text, out);
}

/// What the driver read before and after writing a correction, and whether the correction is in force.
fn read_back(correction: &Correction, reply: &ControllerReply) -> (ReadBack, bool) {
    let mut read = ReadBack {
        before: reply.value_before,
        after: reply.value,
        values_before: reply.values_before.clone(),
        values_after: reply.values.clone(),
    };
    if correction.kind != Correction::VOLUMETRIC {
        let written = offset::is_same(reply.value, correction.new_value);
        return (read, written);
    }
    let written = table::same(&reply.values, &correction.new_values);
    read.before = correction.previous_value;
    read.after = if written {
        correction.new_value
    } else {
        f64::NAN
    };
    (read, written)
}

/// Fails corrections whose command the driver has not answered in time: the next ones and the part wait for them.
pub(crate) fn expire(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let overdue = state
        .writing
        .iter()
        .filter(|(_, writing)| now > writing.until);
    let overdue: Vec<u64> = overdue.map(|(command_id, _)| *command_id).collect();
    for command_id in overdue {
        let Some(Writing { correction, .. }) = state.writing.remove(&command_id) else {
            continue;
        };
        let text = format!(
            "the driver did not answer within {} s: the value in the controller is unknown",
            config.reply_limit
        );
        let values = ReadBack {
            before: correction.previous_value,
            after: f64::NAN,
            ..ReadBack::default()
        };
        let failed = CorrectionAcknowledgement::FAILED;
        acknowledge(now, &correction, failed, values, &text, out);
    }
}

fn acknowledge(
    now: Stamp,
    correction: &Correction,
    outcome: u8,
    read: ReadBack,
    text: &str,
    out: &mut Out,
) {
    out.send(Output::Acknowledgement(CorrectionAcknowledgement {
        header: now.header(""),
        correction_id: correction.correction_id.clone(),
        outcome,
        value_before: read.before,
        value_after: read.after,
        text: text.to_owned(),
        values_before: read.values_before,
        values_after: read.values_after,
    }));
}
