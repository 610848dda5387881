//! Replies to commands.

use graph::Stamp;
use probecell_msgs::{ControllerCommand, ControllerReply};

use crate::{ports::Output, state::State};

/// The reply to a command that was carried out.
pub(crate) fn reply(state: &State, now: Stamp, command: &ControllerCommand) -> ControllerReply {
    ControllerReply {
        header: now.header(""),
        session: state.session.clone(),
        command_id: command.command_id,
        outcome: ControllerReply::DONE,
        ..ControllerReply::default()
    }
}

/// The reply that refuses a command.
pub(crate) fn refused(
    state: &State,
    now: Stamp,
    command: &ControllerCommand,
    text: impl Into<String>,
) -> Output {
    Output::Reply(ControllerReply {
        outcome: ControllerReply::REFUSED,
        text: text.into(),
        ..reply(state, now, command)
    })
}

/// The reply that ends a command which had begun.
pub(crate) fn failed(state: &State, now: Stamp, command: &ControllerCommand, text: &str) -> Output {
    Output::Reply(ControllerReply {
        outcome: ControllerReply::FAILED,
        text: text.to_owned(),
        ..reply(state, now, command)
    })
}
