//! Commands of a joint trajectory controller of ros2_control, from what it publishes of itself.
//!
//! `control_msgs/JointTrajectoryControllerState` has the commanded positions in `reference`, before ROS 2 Iron in `desired`. Fields are
//! read by their names, so that both are.

use anyhow::Context;
use bags::Bag;
use probecell_msgs::migration::Migration;
use probecell_msgs::record_from_cdr;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::std_msgs::Header;
use serde::Deserialize;

/// Name of the type.
pub(super) const TYPE: &str = "control_msgs/msg/JointTrajectoryControllerState";

/// The fields that are of interest, in the order of [`State`].
const FIELDS: &str = "std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint desired
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
";

#[derive(Deserialize)]
struct State {
    header: Header,
    joint_names: Vec<String>,
    reference: Point,
    desired: Point,
}

#[derive(Deserialize)]
struct Point {
    positions: Vec<f64>,
}

/// Commanded positions on a topic of that type.
pub(super) fn commands(bag: &Bag, topic: &str) -> anyhow::Result<Vec<JointState>> {
    let channel = bag.channels_of(topic).next().context("no topic")?;
    let migration =
        Migration::between(TYPE, &channel.definition, FIELDS).with_context(|| topic.to_owned())?;
    let mut all = Vec::new();
    for recorded in bag.messages_on(&[topic]) {
        let bytes = migration
            .migrate(&recorded?.payload)
            .with_context(|| topic.to_owned())?;
        let State {
            header,
            joint_names,
            reference,
            desired,
        } = record_from_cdr(TYPE, &bytes)?;
        let position = if reference.positions.is_empty() {
            desired
        } else {
            reference
        }
        .positions;
        if position.len() == joint_names.len() {
            all.push(JointState {
                header,
                name: joint_names,
                position,
                ..JointState::default()
            });
        }
    }
    Ok(all)
}
