//! Requests and responses of the services of a robot, as plain CDR, and the goal of a trajectory.
//!
//! Definitions: control_msgs (`FollowJointTrajectory`), action_msgs, rcl_interfaces and std_srvs of ROS 2; hashes after
//! REP 2016. Alignment counts from the end of the four-byte header.

use crate::driver::RosType;

/// `sensor_msgs/msg/JointState`.
pub(super) const JOINT_STATE: RosType = RosType {
    dds_name: "sensor_msgs::msg::dds_::JointState_",
    type_hash: "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
};
/// `std_msgs/msg/Bool`.
pub(super) const BOOL: RosType = RosType {
    dds_name: "std_msgs::msg::dds_::Bool_",
    type_hash: "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
};
/// `std_srvs/srv/Trigger`.
pub(super) const TRIGGER: RosType = RosType {
    dds_name: "std_srvs::srv::dds_::Trigger_",
    type_hash: "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
};
/// `rcl_interfaces/srv/SetParameters`.
pub(super) const SET_PARAMETERS: RosType = RosType {
    dds_name: "rcl_interfaces::srv::dds_::SetParameters_",
    type_hash: "RIHS01_56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
};
/// `rcl_interfaces/srv/GetParameters`.
pub(super) const GET_PARAMETERS: RosType = RosType {
    dds_name: "rcl_interfaces::srv::dds_::GetParameters_",
    type_hash: "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
};
/// Service `_action/send_goal` of `control_msgs/action/FollowJointTrajectory`.
pub(super) const SEND_GOAL: RosType = RosType {
    dds_name: "control_msgs::action::dds_::FollowJointTrajectory_SendGoal_",
    type_hash: "RIHS01_b13789dddc325a7a962825c45e28c77d37237ec129dd0c34dc5994562938c57f",
};
/// Service `_action/get_result` of the same.
pub(super) const GET_RESULT: RosType = RosType {
    dds_name: "control_msgs::action::dds_::FollowJointTrajectory_GetResult_",
    type_hash: "RIHS01_e3ceb38e3e1867c8dc0f46014df26e90eb93422f27e9e97f936e07f94be4bc8b",
};
/// Service `_action/cancel_goal` of any action.
pub(super) const CANCEL_GOAL: RosType = RosType {
    dds_name: "action_msgs::srv::dds_::CancelGoal_",
    type_hash: "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
};

/// `action_msgs/msg/GoalStatus`.
pub(super) const STATUS_SUCCEEDED: u8 = 4;

/// Identifier of a goal.
pub(super) type GoalId = [u8; 16];

const PARAMETER_DOUBLE: u8 = 3;
const PARAMETER_STRING: u8 = 4;

/// Where the joints are at an instant of a trajectory.
pub(super) struct Waypoint {
    /// s after the start.
    pub(super) time: f64,
    /// m or rad.
    pub(super) positions: Vec<f64>,
}

/// Value of a parameter that is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Parameter {
    Double(f64),
    Text(String),
}

/// Request of `send_goal`.
pub(super) fn send_goal(goal: &GoalId, joints: &[String], points: &[Waypoint]) -> Vec<u8> {
    let mut out = Writer::default();
    out.bytes(goal);
    out.header();
    out.count(joints.len());
    for joint in joints {
        out.text(joint);
    }
    out.count(points.len());
    for point in points {
        out.count(point.positions.len());
        for position in &point.positions {
            out.f64(*position);
        }
        // Velocities, accelerations, efforts: the controller's own.
        for _ in 0..3 {
            out.count(0);
        }
        let nanos = (point.time * 1e9).round() as i64;
        out.u32((nanos / 1_000_000_000) as u32);
        out.u32((nanos % 1_000_000_000) as u32);
    }
    // No trajectory of other kinds, no tolerances beyond the controller's.
    out.header();
    for _ in 0..6 {
        out.count(0);
    }
    out.u32(0);
    out.u32(0);
    out.0
}

/// Whether a goal was accepted.
pub(super) fn accepted(response: &[u8]) -> Option<bool> {
    Some(Reader::new(response)?.u8()? != 0)
}

/// Request of `get_result`.
pub(super) fn get_result(goal: &GoalId) -> Vec<u8> {
    let mut out = Writer::default();
    out.bytes(goal);
    out.0
}

/// Status, error code and text of a goal that has ended.
pub(super) fn result(response: &[u8]) -> Option<(u8, i32, String)> {
    let mut from = Reader::new(response)?;
    Some((from.u8()?, from.u32()? as i32, from.text()?))
}

/// Request of `cancel_goal` for all goals.
pub(super) fn cancel_all() -> Vec<u8> {
    let mut out = Writer::default();
    out.bytes(&[0; 16]);
    out.u32(0);
    out.u32(0);
    out.0
}

/// Request of a trigger: an empty structure is one byte.
pub(super) fn trigger() -> Vec<u8> {
    let mut out = Writer::default();
    out.bytes(&[0]);
    out.0
}

/// Whether a trigger has succeeded, and its text.
pub(super) fn triggered(response: &[u8]) -> Option<(bool, String)> {
    let mut from = Reader::new(response)?;
    Some((from.u8()? != 0, from.text()?))
}

/// Request that sets one parameter.
pub(super) fn set_parameter(name: &str, value: &Parameter) -> Vec<u8> {
    let mut out = Writer::default();
    out.count(1);
    out.text(name);
    let (kind, number, text) = match value {
        Parameter::Double(number) => (PARAMETER_DOUBLE, *number, ""),
        Parameter::Text(text) => (PARAMETER_STRING, 0.0, text.as_str()),
    };
    out.bytes(&[kind, 0]);
    out.i64(0);
    out.f64(number);
    out.text(text);
    for _ in 0..5 {
        out.count(0);
    }
    out.0
}

/// Whether the one parameter was set, or why not; none for another answer.
pub(super) fn parameter_set(response: &[u8]) -> Option<Result<(), String>> {
    let mut from = Reader::new(response)?;
    if from.u32()? != 1 {
        return None;
    }
    let successful = from.u8()? != 0;
    let reason = from.text()?;
    Some(if successful { Ok(()) } else { Err(reason) })
}

/// Request of the values of parameters.
pub(super) fn get_parameters(names: &[&str]) -> Vec<u8> {
    let mut out = Writer::default();
    out.count(names.len());
    for name in names {
        out.text(name);
    }
    out.0
}

/// Values of `count` parameters that are doubles; a node that lacks one answers with none.
pub(super) fn doubles(response: &[u8], count: usize) -> Option<Vec<f64>> {
    let mut from = Reader::new(response)?;
    if from.u32()? as usize != count {
        return None;
    }
    (0..count).map(|_| from.double()).collect()
}

/// The one `bool` of a message.
pub(super) fn flag(payload: &[u8]) -> Option<bool> {
    Some(Reader::new(payload)?.u8()? != 0)
}

struct Writer(Vec<u8>);

impl Default for Writer {
    fn default() -> Self {
        Self(vec![0, 1, 0, 0])
    }
}

impl Writer {
    fn align(&mut self, to: usize) {
        while !(self.0.len() - 4).is_multiple_of(to) {
            self.0.push(0);
        }
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes(&value.to_le_bytes());
    }

    fn count(&mut self, count: usize) {
        self.u32(count as u32);
    }

    fn i64(&mut self, value: i64) {
        self.align(8);
        self.bytes(&value.to_le_bytes());
    }

    fn f64(&mut self, value: f64) {
        self.align(8);
        self.bytes(&value.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.bytes(text.as_bytes());
        self.bytes(&[0]);
    }

    /// A `std_msgs/Header` without stamp (at once) and frame.
    fn header(&mut self) {
        self.u32(0);
        self.u32(0);
        self.text("");
    }
}

/// Reads little-endian CDR; everything is `None` beyond the end.
struct Reader<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn new(bytes: &'a [u8]) -> Option<Self> {
        let (header, body) = bytes.split_first_chunk::<4>()?;
        (header[1] == 1).then_some(Self { body, at: 0 })
    }

    fn take(&mut self, count: usize, align: usize) -> Option<&'a [u8]> {
        let begin = self.at.next_multiple_of(align);
        let end = begin.checked_add(count)?;
        self.at = end;
        self.body.get(begin..end)
    }

    fn u8(&mut self) -> Option<u8> {
        Some(self.take(1, 1)?[0])
    }

    fn u32(&mut self) -> Option<u32> {
        let bytes = self.take(4, 4)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    }

    fn f64(&mut self) -> Option<f64> {
        let bytes = self.take(8, 8)?;
        Some(f64::from_le_bytes(bytes.try_into().ok()?))
    }

    fn text(&mut self) -> Option<String> {
        let count = self.u32()? as usize;
        let bytes = self.take(count, 1)?;
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        Some(String::from_utf8_lossy(text).into_owned())
    }

    /// A `ParameterValue` that must be a double.
    fn double(&mut self) -> Option<f64> {
        let kind = self.u8()?;
        self.u8()?;
        self.take(8, 8)?;
        let number = self.f64()?;
        self.text()?;
        for size in [1, 1, 8, 8] {
            let count = self.u32()? as usize;
            if count > 0 {
                self.take(count.checked_mul(size)?, size)?;
            }
        }
        for _ in 0..self.u32()? {
            self.text()?;
        }
        (kind == PARAMETER_DOUBLE).then_some(number)
    }
}
