//! Drivers whose place another has taken. One that still publishes shows that two drivers command the machine: it is told to
//! stop and is not listened to until one of them has ended.

use graph::{FaultCode, Stamp};
use probecell_msgs::{ControllerCommand, ControllerStatus};

use crate::{
    active_faults::{clear, raise},
    command,
    config::Config,
    ports::{MachineFault, Out},
    state::{Former, State},
};

/// Sessions of former drivers that are remembered.
const FORMER_LIMIT: usize = 16;

/// Why nothing begins while two drivers publish samples.
pub(crate) const SEVERAL: &str =
    "two drivers publish controller_status: all but one of them must be stopped";

/// Samples of two drivers arrive.
pub(crate) fn are_several(state: &State) -> bool {
    state.standing.contains(MachineFault::SeveralDrivers.code())
}

/// The driver of this session has taken the place of the one before with this sample: those that it has displaced.
pub(crate) fn displaced(state: &State, now: Stamp, status: &ControllerStatus) -> Vec<Former> {
    let mut former = state.former.clone();
    former.retain(|one| one.session != status.session);
    if let Some(known) = &state.controller {
        former.push(Former {
            session: known.status.session.clone(),
            // A clock that is ahead must not hide what the other goes on to publish.
            until: Stamp::from(&status.header.stamp).min(now),
            heard: None,
        });
    }
    let surplus = former.len().saturating_sub(FORMER_LIMIT);
    former.drain(..surplus);
    former
}

/// True for a sample of a former driver while the present one runs: it is not listened to. Where it is not merely late, the
/// fault is reported once, and the former driver is told to stop.
pub(crate) fn ignores(
    config: &Config,
    state: &mut State,
    now: Stamp,
    status: &ControllerStatus,
    out: &mut Out,
) -> bool {
    let Some(known) = state.controller.as_ref().filter(|known| !known.lost) else {
        return false;
    };
    let present = known.status.session.clone();
    let mut former = state.former.iter_mut();
    let Some(former) = former.find(|one| one.session == status.session && present != one.session)
    else {
        return false;
    };
    // Published before the other began: it came late, and is no sign that its driver still runs.
    if Stamp::from(&status.header.stamp) <= former.until {
        return true;
    }
    let is_new = former.heard.replace(now).is_none();
    let text = format!(
        "two drivers publish controller_status, in the sessions {present:?} and {:?}: the second is told to stop and is not listened to until one of them has ended",
        status.session
    );
    raise(state, now, MachineFault::SeveralDrivers, &text, out);
    if is_new && !config.replayed {
        let stop = ControllerCommand {
            kind: ControllerCommand::STOP,
            ..ControllerCommand::default()
        };
        // Nobody waits for its answer: what the former session says counts for nothing.
        command::send_to(state, now, status.session.clone(), stop, out);
    }
    true
}

/// Former drivers of which nothing has been heard for as long as a silent one is taken as lost have ended.
pub(crate) fn watch(config: &Config, state: &mut State, now: Stamp) {
    for former in &mut state.former {
        let silent = |heard: &mut Stamp| now.since_s(*heard) > config.silence_limit;
        former.heard.take_if(silent);
    }
    settle(state);
}

/// The fault ends when all but one of the drivers have ended.
pub(crate) fn settle(state: &mut State) {
    if state.former.iter().all(|former| former.heard.is_none()) {
        clear(state, MachineFault::SeveralDrivers);
    }
}
