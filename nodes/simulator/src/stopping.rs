//! Programs that are ended, and a machine that stands some time after the command.

use graph::Stamp;
use probecell_msgs::ControllerCommand;

use crate::{
    config::Config,
    ports::{Out, Output},
    replies::{failed, reply},
    state::{State, Stopping},
};

/// Ends every program; the machine stands some time later.
pub(crate) fn stop(config: &Config, state: &mut State, now: Stamp, command: ControllerCommand) {
    let program = state.program.take().map(|program| program.command);
    let ended = program.into_iter().chain(state.awaiting.take());
    let stopping = state.stopping.get_or_insert_with(|| Stopping {
        until: now.after_s(config.raw.stop_s),
        ended: Vec::new(),
        stops: Vec::new(),
    });
    stopping.ended.extend(ended);
    stopping.stops.push(command);
}

/// Confirms a stop once the machine stands.
pub(crate) fn stand(state: &mut State, now: Stamp, out: &mut Out) {
    let Some(stopping) = state.stopping.take_if(|stopping| now >= stopping.until) else {
        return;
    };
    for command in &stopping.ended {
        out.send(failed(state, now, command, "stopped"));
    }
    for command in &stopping.stops {
        out.send(Output::Reply(reply(state, now, command)));
    }
}

/// Ends every program at once.
pub(crate) fn abort(state: &mut State, now: Stamp, text: &str, out: &mut Out) {
    for command in [
        state.program.take().map(|program| program.command),
        state.awaiting.take(),
    ]
    .into_iter()
    .flatten()
    {
        out.send(failed(state, now, &command, text));
    }
}
