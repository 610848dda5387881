//! Settings of a robot on ROS 2: section `[ros2]` of a cell file.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;

use crate::driver::Demands;

/// As written in the cell file, section `[ros2]`. Names of topics, services and nodes are absolute.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    /// Topic of its joints, `sensor_msgs/msg/JointState`.
    #[serde(default = "joint_states")]
    pub joint_states: String,
    /// Action by which it moves, `control_msgs/action/FollowJointTrajectory`.
    pub action: String,
    /// Its name of each axis whose name differs from that in the robot description.
    #[serde(default)]
    pub joints: BTreeMap<String, String>,
    /// The probe.
    pub contact: RawContact,
    /// What cuts, and holds offsets; none: it only measures.
    pub program: Option<RawProgram>,
}

/// The signal of the probe, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawContact {
    /// Its level, `std_msgs/msg/Bool`: published when it changes, and at least once a second.
    pub topic: String,
    /// Where the positions at the contact come from.
    pub positions: ContactPositions,
    /// With `latched`: the positions at the contact, `sensor_msgs/msg/JointState`, stamped with its instant.
    pub latched_joint_states: Option<String>,
    /// With `interpolated`: how long after the contact the signal is published, on average.
    #[serde(default)]
    pub delay_ms: f64,
    /// With `interpolated`: standard uncertainty of the instant of a contact, after that delay is taken off.
    #[serde(default)]
    pub time_standard_uncertainty_ms: f64,
}

/// Where the positions at a contact come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactPositions {
    /// The robot latches them.
    Latched,
    /// From the samples of the joints up to the instant of the contact.
    Interpolated,
}

/// The robot's program, as written: services that cut, a node whose parameters are its offsets in m.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawProgram {
    /// The node whose parameters hold offsets.
    pub node: String,
    /// Service that stops an operation, `std_srvs/srv/Trigger`; it answers when nothing moves any more.
    pub stop: String,
    /// Parameter (a string) that receives the run of the part before each operation: another run is a new blank.
    pub run_parameter: Option<String>,
    /// What it cuts.
    pub operations: Vec<RawOperation>,
    /// Its wear offsets.
    #[serde(default)]
    pub tools: Vec<RawTool>,
    /// Its work offsets.
    #[serde(default)]
    pub work_offsets: Vec<RawWorkOffset>,
}

/// An operation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawOperation {
    /// Its name in the part.
    pub id: String,
    /// Service that cuts, `std_srvs/srv/Trigger`; it answers when it has ended.
    pub service: String,
}

/// A tool.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTool {
    /// Its number.
    pub number: u32,
    /// Parameter (a double, m) of its wear offset.
    pub parameter: String,
}

/// A work offset.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawWorkOffset {
    /// Axis: a linear joint, or of an arm X, Y or Z of the frame of its program (the part frame).
    pub axis: String,
    /// Parameter (a double, m).
    pub parameter: String,
}

fn joint_states() -> String {
    "/joint_states".to_owned()
}

impl RawConfig {
    /// Checks the settings, and that the machine has what the cell corrects. An error is a sentence.
    pub(super) fn checked(&self, demands: &Demands<'_>) -> Result<(), String> {
        self.check_names()?;
        self.check_contact()?;
        self.check_program()?;
        self.check_demands(demands)
    }

    fn check_names(&self) -> Result<(), String> {
        let mut names = vec![
            ("ros2.joint_states", &self.joint_states),
            ("ros2.action", &self.action),
            ("ros2.contact.topic", &self.contact.topic),
        ];
        if let Some(topic) = &self.contact.latched_joint_states {
            names.push(("ros2.contact.latched_joint_states", topic));
        }
        if let Some(program) = &self.program {
            names.extend([
                ("ros2.program.node", &program.node),
                ("ros2.program.stop", &program.stop),
            ]);
            let services = program.operations.iter().map(|one| &one.service);
            names.extend(services.map(|name| ("ros2.program.operations.service", name)));
        }
        match names.into_iter().find(|(_, name)| !is_absolute(name)) {
            Some((key, name)) => Err(format!(
                "{key} = {name:?} is no absolute name of ROS 2, such as \"/robot/joint_states\""
            )),
            None => Ok(()),
        }
    }

    fn check_contact(&self) -> Result<(), String> {
        let contact = &self.contact;
        for (key, value) in [
            ("delay_ms", contact.delay_ms),
            (
                "time_standard_uncertainty_ms",
                contact.time_standard_uncertainty_ms,
            ),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(format!(
                    "ros2.contact.{key} = {value} must be a finite number that is not negative"
                ));
            }
        }
        let by_time = contact.delay_ms != 0.0 || contact.time_standard_uncertainty_ms != 0.0;
        match (contact.positions, &contact.latched_joint_states) {
            (ContactPositions::Latched, None) => Err(
                "ros2.contact.positions = \"latched\" needs latched_joint_states".to_owned(),
            ),
            (ContactPositions::Latched, Some(_)) if by_time => Err(
                "ros2.contact: delay_ms and time_standard_uncertainty_ms belong to positions = \"interpolated\""
                    .to_owned(),
            ),
            (ContactPositions::Interpolated, Some(_)) => Err(
                "ros2.contact.latched_joint_states belongs to positions = \"latched\"".to_owned(),
            ),
            (ContactPositions::Interpolated, None)
                if contact.time_standard_uncertainty_ms == 0.0 =>
            {
                Err("ros2.contact.time_standard_uncertainty_ms must be above 0: no instant is known exactly".to_owned())
            }
            _ => Ok(()),
        }
    }

    fn check_program(&self) -> Result<(), String> {
        let Some(program) = &self.program else {
            return Ok(());
        };
        let mut seen = BTreeSet::new();
        let operations = program.operations.iter().map(|one| one.id.clone());
        let tools = program
            .tools
            .iter()
            .map(|one| format!("tool {}", one.number));
        let offsets = program.work_offsets.iter();
        let offsets = offsets.map(|one| format!("work offset {}", one.axis));
        for name in operations.chain(tools).chain(offsets) {
            if !seen.insert(name.clone()) {
                return Err(format!("ros2.program: {name} is listed twice"));
            }
        }
        Ok(())
    }

    fn check_demands(&self, demands: &Demands<'_>) -> Result<(), String> {
        let program = self.program.as_ref();
        let tools = program.map_or(&[][..], |program| &program.tools);
        for (id, number) in &demands.corrected_tools {
            if !tools.iter().any(|tool| tool.number == *number) {
                return Err(format!(
                    "compensation.characteristics: {id:?} is corrected by tool {number}, which is not one of ros2.program.tools"
                ));
            }
        }
        let offsets = program.map_or(&[][..], |program| &program.work_offsets);
        for axis in &demands.work_offset_axes {
            if !offsets.iter().any(|own| own.axis == *axis) {
                return Err(format!(
                    "compensation.work_offset.axes: {axis:?} is not one of ros2.program.work_offsets"
                ));
            }
        }
        match demands.volumetric_entries.first() {
            Some(name) => Err(format!(
                "compensation.volumetric.links: {name:?}: a robot on ROS 2 has no volumetric table"
            )),
            None => Ok(()),
        }
    }
}

/// Letters, digits and underscores between slashes, the first of which begins the name.
fn is_absolute(name: &str) -> bool {
    name.strip_prefix('/').is_some_and(|rest| {
        rest.split('/').all(|part| {
            part.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
                && part
                    .chars()
                    .all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
        })
    })
}
