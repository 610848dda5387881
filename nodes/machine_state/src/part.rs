//! The part that is being made: while `cycle` speaks of it, its corrections may be written. When `cycle` falls silent, or
//! another process of it knows nothing of the part, the machine is stopped, and the part is kept on `supervised_part`
//! until its end is reported.

use graph::Stamp;
use probecell_msgs::{Correction, CorrectionAcknowledgement as Ack, PartReport, PartStatus};

use crate::{
    active_faults::{clear, raise},
    config::Config,
    ports::{MachineFault, Out, Output},
    refusal::{Refusal, refuse},
    state::{Asker, State},
    stop,
};

/// Takes what `cycle` says of its part.
pub(crate) fn status(
    config: &Config,
    state: &mut State,
    now: Stamp,
    status: PartStatus,
    out: &mut Out,
) {
    let known = &state.part.status;
    if Stamp::from(&status.header.stamp) < Stamp::from(&known.header.stamp) {
        // A link delivers it after something newer.
        return;
    }
    let forgotten = known.stage != PartStatus::NONE
        && status.run_id != known.run_id
        && status.run_number < known.run_number;
    if forgotten {
        return abandon(
            config,
            state,
            now,
            "cycle was restarted and does not know it",
            out,
        );
    }
    if state.part.abandoned && status.run_id == known.run_id {
        return;
    }
    let same = status.run_id == known.run_id
        && status.run_number == known.run_number
        && (status.stage == PartStatus::NONE) == (known.stage == PartStatus::NONE);
    if status.stage == PartStatus::NONE {
        // Its end is known; its measurement may be resumed.
        state.part.stopped = None;
    }
    state.part.status = status;
    state.part.at = now;
    state.part.abandoned = false;
    if !same {
        publish(state, now, out);
    }
}

/// Takes the end of a part: nothing of it is alive any more.
pub(crate) fn ended(state: &mut State, now: Stamp, report: &PartReport, out: &mut Out) {
    if [PartReport::STOPPED, PartReport::SCRAP].contains(&report.verdict) {
        state.ended = state.ended.max(Some(Stamp::from(&report.header.stamp)));
    }
    let known = &mut state.part;
    (known.stopped).take_if(|stopped| *stopped == report.run_id);
    if known.status.stage != PartStatus::NONE && known.status.run_id == report.run_id {
        known.status.stage = PartStatus::NONE;
        known.status.header = report.header.clone();
        known.abandoned = false;
        clear(state, MachineFault::CycleLost);
        publish(state, now, out);
    }
}

/// An operator stops the machine: the part that is being made is over, whether or not `cycle` hears of it.
pub(crate) fn stopped(state: &mut State) {
    let part = &mut state.part;
    if part.status.stage != PartStatus::NONE {
        part.stopped = Some(part.status.run_id.clone());
    }
}

/// An operator has stopped the machine while the run was made.
pub(crate) fn is_stopped(state: &State, run_id: &str) -> bool {
    state.part.stopped.as_deref() == Some(run_id)
}

/// Stops the machine when `cycle` has fallen silent.
pub(crate) fn watch(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let part = &state.part;
    if part.status.stage != PartStatus::NONE
        && !part.abandoned
        && now.since_s(part.at) > config.part_limit
    {
        let text = format!("cycle has not reported on it for {} s", config.part_limit);
        abandon(config, state, now, &text, out);
    }
}

fn abandon(config: &Config, state: &mut State, now: Stamp, why: &str, out: &mut Out) {
    if state.part.abandoned {
        return;
    }
    state.part.abandoned = true;
    let text = format!("part {:?} is stopped: {why}", state.part.status.part_id);
    raise(state, now, MachineFault::CycleLost, &text, out);
    stop::stop(config, state, now, Asker::Gate, out);
}

/// The part that a correction was made for is being made, and waits for it.
pub(crate) fn check(
    config: &Config,
    state: &State,
    now: Stamp,
    correction: &Correction,
) -> Result<(), Refusal> {
    let part = &state.part;
    if state.rejected.contains(&correction.plan_id) {
        return refuse(
            Ack::REFUSED_STALE,
            "another correction from its measurement was rejected",
        );
    }
    if part.abandoned
        || is_stopped(state, &part.status.run_id)
        || [PartStatus::NONE, PartStatus::STOPPING].contains(&part.status.stage)
        || part.status.plan_id != correction.plan_id
    {
        return refuse(
            Ack::REFUSED_STALE,
            "the part that it was made for is not being made, or does not wait for it",
        );
    }
    if now.since_s(part.at) > config.part_limit {
        let text = format!(
            "cycle has not reported on the part for {} s",
            config.part_limit
        );
        return refuse(Ack::REFUSED_STALE, text);
    }
    Ok(())
}

/// Publishes the part as it is known here.
pub(crate) fn publish(state: &State, now: Stamp, out: &mut Out) {
    out.send(Output::Supervised(PartStatus {
        header: now.header(""),
        ..state.part.status.clone()
    }));
}
