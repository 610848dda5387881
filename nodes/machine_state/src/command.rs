//! The way to the driver: every command carries the session of the driver that runs now, and a number of its own.

use graph::Stamp;
use probecell_msgs::{ControllerCommand, GateHeartbeat};

use crate::{
    ports::{Out, Output},
    state::State,
};

/// Sends a command to the driver that runs now and returns its number.
pub(crate) fn send(
    state: &mut State,
    now: Stamp,
    command: ControllerCommand,
    out: &mut Out,
) -> u64 {
    let session = state
        .controller
        .as_ref()
        .map(|known| known.status.session.clone())
        .unwrap_or_default();
    send_to(state, now, session, command, out)
}

/// Sends a command to the driver of a session and returns its number.
pub(crate) fn send_to(
    state: &mut State,
    now: Stamp,
    session: String,
    command: ControllerCommand,
    out: &mut Out,
) -> u64 {
    let command_id = state.next_command;
    state.next_command += 1;
    let header = now.header("");
    out.send(Output::Command(ControllerCommand {
        header,
        session,
        command_id,
        ..command
    }));
    command_id
}

/// Publishes a heartbeat.
pub(crate) fn publish_heartbeat(state: &mut State, now: Stamp, out: &mut Out) {
    state.beats += 1;
    let session = state.controller.as_ref().map(|known| &known.status.session);
    out.send(Output::Heartbeat(GateHeartbeat {
        header: now.header(""),
        session: session.cloned().unwrap_or_default(),
        started: state.epoch,
        count: state.beats,
    }));
}
