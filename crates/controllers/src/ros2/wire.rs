//! Requests and responses of the services of a robot, as plain CDR, and the goal of a trajectory.
//!
//! Types of rcl_interfaces and action_msgs are those of `probecell_msgs`. Of control_msgs (`FollowJointTrajectory`) and
//! std_srvs this writes and reads the few fields that a cell needs; hashes after REP 2016. Alignment counts from the end of
//! the four-byte header.

use probecell_msgs::{
    Message as _, MessageType, Service as _, ServiceType,
    action_msgs::srv::{CancelGoal, CancelGoalRequest},
    from_cdr,
    rcl_interfaces::{
        self, ParameterType, ParameterValue,
        srv::{
            GetParameters, GetParametersRequest, GetParametersResponse, SetParameters,
            SetParametersRequest, SetParametersResponse,
        },
    },
    sensor_msgs::JointState,
    to_cdr,
};

use crate::driver::RosType;

const fn message(ty: &MessageType) -> RosType {
    RosType {
        dds_name: ty.dds_name,
        type_hash: ty.type_hash,
    }
}

const fn service(ty: &ServiceType) -> RosType {
    RosType {
        dds_name: ty.dds_name,
        type_hash: ty.type_hash,
    }
}

/// `sensor_msgs/msg/JointState`.
pub(super) const JOINT_STATE: RosType = message(JointState::TYPE);
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
pub(super) const SET_PARAMETERS: RosType = service(SetParameters::TYPE);
/// `rcl_interfaces/srv/GetParameters`.
pub(super) const GET_PARAMETERS: RosType = service(GetParameters::TYPE);
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
pub(super) const CANCEL_GOAL: RosType = service(CancelGoal::TYPE);

/// `action_msgs/msg/GoalStatus`.
pub(super) const STATUS_SUCCEEDED: u8 = 4;
const STATUS_CANCELED: u8 = 5;
const STATUS_ABORTED: u8 = 6;

/// `error_code` of a `FollowJointTrajectory` that could not be carried out as it was sent.
const INVALID: [(i32, &str); 3] = [
    (-1, "INVALID_GOAL"),
    (-2, "INVALID_JOINTS"),
    (-3, "OLD_HEADER_TIMESTAMP"),
];
/// Those of one that has left its tolerances.
const VIOLATED: [(i32, &str); 2] = [
    (-4, "PATH_TOLERANCE_VIOLATED"),
    (-5, "GOAL_TOLERANCE_VIOLATED"),
];

/// Identifier of a goal.
pub(super) type GoalId = [u8; 16];

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

/// Request of `send_goal`. It has succeeded only when each joint is at its target within `tolerance` (m or rad).
pub(super) fn send_goal(
    goal: &GoalId,
    joints: &[String],
    points: &[Waypoint],
    tolerance: f64,
) -> Vec<u8> {
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
    // No trajectory of other kinds; on the path, the controller's own tolerances.
    out.header();
    for _ in 0..4 {
        out.count(0);
    }
    out.count(joints.len());
    for joint in joints {
        out.text(joint);
        // Velocity and acceleration: the controller's own.
        for value in [tolerance, 0.0, 0.0] {
            out.f64(value);
        }
    }
    // None of components; as late as the controller allows.
    out.count(0);
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

/// How a goal has ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct GoalResult {
    status: u8,
    code: i32,
    text: String,
}

impl GoalResult {
    pub(super) fn has_succeeded(&self) -> bool {
        self.status == STATUS_SUCCEEDED
    }

    /// False where the controller says that the goal itself was wrong, or that it had to give way: no contact does that.
    pub(super) fn may_be_a_contact(&self) -> bool {
        INVALID.iter().all(|(code, _)| *code != self.code)
    }

    /// What the controller has answered, in a sentence.
    pub(super) fn sentence(&self) -> String {
        let how = match self.status {
            STATUS_CANCELED => "the controller has cancelled the trajectory".to_owned(),
            STATUS_ABORTED => "the controller has aborted the trajectory".to_owned(),
            other => format!("the controller has ended the trajectory with status {other}"),
        };
        let mut known = INVALID.iter().chain(&VIOLATED);
        let code = match (self.code, known.find(|(code, _)| *code == self.code)) {
            (0, _) => "without an error code".to_owned(),
            (code, Some((_, name))) => format!("with {name} ({code})"),
            (code, None) => format!("with error code {code}"),
        };
        match self.text.trim() {
            "" => format!("{how} {code}"),
            text => format!("{how} {code}: {text}"),
        }
    }
}

/// How a goal has ended.
pub(super) fn result(response: &[u8]) -> Option<GoalResult> {
    let mut from = Reader::new(response)?;
    Some(GoalResult {
        status: from.u8()?,
        code: from.u32()? as i32,
        text: from.text()?,
    })
}

/// Request of `cancel_goal` for all goals.
pub(super) fn cancel_all() -> Vec<u8> {
    to_cdr(&CancelGoalRequest::default())
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
    let value = match value {
        Parameter::Double(number) => ParameterValue {
            r#type: ParameterType::PARAMETER_DOUBLE,
            double_value: *number,
            ..ParameterValue::default()
        },
        Parameter::Text(text) => ParameterValue {
            r#type: ParameterType::PARAMETER_STRING,
            string_value: text.clone(),
            ..ParameterValue::default()
        },
    };
    let name = name.to_owned();
    to_cdr(&SetParametersRequest {
        parameters: vec![rcl_interfaces::Parameter { name, value }],
    })
}

/// Whether the one parameter was set, or why not; none for another answer.
pub(super) fn parameter_set(response: &[u8]) -> Option<Result<(), String>> {
    let response: SetParametersResponse = from_cdr(response).ok()?;
    let [result] = <[_; 1]>::try_from(response.results).ok()?;
    Some(result.successful.then_some(()).ok_or(result.reason))
}

/// Request of the values of parameters.
pub(super) fn get_parameters(names: &[&str]) -> Vec<u8> {
    to_cdr(&GetParametersRequest {
        names: names.iter().map(|&name| name.to_owned()).collect(),
    })
}

/// Values of `count` parameters that are doubles; a node that lacks one answers with none.
pub(super) fn doubles(response: &[u8], count: usize) -> Option<Vec<f64>> {
    let response: GetParametersResponse = from_cdr(response).ok()?;
    if response.values.len() != count {
        return None;
    }
    let double = |value: ParameterValue| {
        (value.r#type == ParameterType::PARAMETER_DOUBLE).then_some(value.double_value)
    };
    response.values.into_iter().map(double).collect()
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

    fn text(&mut self) -> Option<String> {
        let count = self.u32()? as usize;
        let bytes = self.take(count, 1)?;
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        Some(String::from_utf8_lossy(text).into_owned())
    }
}
