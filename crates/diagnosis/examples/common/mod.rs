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
