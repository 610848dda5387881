//! The way to the driver: every command carries the session of the driver that runs now, and a number of its own.

use graph::{Outbox, Stamp};
use probecell_msgs::ControllerCommand;

use crate::{ports::Output, state::State};

/// Sends a command to the driver and returns its number.
pub(crate) fn send(
    state: &mut State,
    now: Stamp,
    command: ControllerCommand,
    out: &mut Outbox<Output>,
) -> u64 {
    let command_id = state.next_command;
    state.next_command += 1;
    let session = state
        .controller
        .as_ref()
        .map(|known| known.status.session.clone())
        .unwrap_or_default();
    let header = now.header("");
    out.send(Output::Command(ControllerCommand {
        header,
        session,
        command_id,
        ..command
    }));
    command_id
}
