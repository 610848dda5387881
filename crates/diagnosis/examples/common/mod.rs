//! Reading a bag into the messages a diagnosis starts from.

use std::path::Path;

use bags::Bag;
use diagnosis::Session;

/// The only session of a bag.
pub(crate) fn read(path: &Path) -> anyhow::Result<Session> {
    let read = bags::Session::read(&Bag::open(path)?)?;
    Ok(Session {
        name: path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        robot_description: read.robot_description,
        plan: read.plan,
        events: read
            .events
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        joint_states: read
            .joint_states
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        joint_commands: read
            .joint_commands
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        machine_states: read
            .machine_states
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        references: read
            .references
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        declared: Vec::new(),
    })
}

/// A session parted in two by turns: the readings of its first, third, … pose, and those of the others.
#[allow(dead_code, reason = "not every program that reads bags parts them")]
pub(crate) fn halves(session: &Session) -> (Session, Session) {
    let mut pose = 0;
    let mut parts = [Vec::new(), Vec::new()];
    for (number, event) in session.events.iter().enumerate() {
        let before = number.checked_sub(1).map(|last| &session.events[last]);
        let moved = before.is_some_and(|before| before.axis_positions != event.axis_positions);
        pose += usize::from(moved);
        parts[pose % 2].push(event.clone());
    }
    let [first, second] = parts.map(|events| Session {
        events,
        ..session.clone()
    });
    (first, second)
}
