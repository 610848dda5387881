//! Messages of the template, filled.

use graph::Stamp;
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, MachineState, ProbeTrigger, ProbingMove,
};

use crate::machine::{AXES, Machine, TOOL};

/// The outcome of a command.
pub(crate) fn reply(
    session: &str,
    command: &ControllerCommand,
    (outcome, text): (u8, &str),
    [value_before, value]: [f64; 2],
) -> ControllerReply {
    ControllerReply {
        header: host::now().header(""),
        session: session.to_owned(),
        command_id: command.command_id,
        outcome,
        value_before,
        value,
        text: text.to_owned(),
        ..ControllerReply::default()
    }
}

/// The end of the move `to`, by a trigger or not, of a plan, with the number of the touch.
pub(crate) fn trigger(
    machine: &Machine,
    session: &str,
    (to, tripped): (&ProbingMove, bool),
    (plan_id, sequence): (String, u64),
) -> ProbeTrigger {
    ProbeTrigger {
        header: host::now().header("foundation"),
        session: session.to_owned(),
        plan_id,
        sequence,
        point_index: to.point_index,
        tripped,
        axis_names: AXES.map(str::to_owned).to_vec(),
        axis_positions: machine.position.to_vec(),
        feed: to.feed,
        ..ProbeTrigger::default()
    }
}

/// `command`: what is under way.
pub(crate) fn status(
    machine: &Machine,
    session: &str,
    command: Option<&ControllerCommand>,
    now: i64,
) -> ControllerStatus {
    let program = command.map(|one| [&*one.operation, &one.plan_id].concat());
    ControllerStatus {
        header: Stamp(now).header("foundation"),
        session: session.to_owned(),
        mode: MachineState::MODE_AUTO,
        execution: u8::from(command.is_some()),
        program: program.unwrap_or_default(),
        feed_override: 1.0,
        axis_names: AXES.map(str::to_owned).to_vec(),
        axis_positions: machine.position.to_vec(),
        tool_numbers: vec![TOOL],
        tool_wear: vec![machine.wear],
        ..ControllerStatus::default()
    }
}
