//! What a diagnosis starts from: the messages of one session, as recorded or as they arrived live.
//!
//! Everything is plain messages of the interface contract; reading them from a recording is not done here.

mod checks;
pub mod joined;
pub mod model;
pub mod perfect;

use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{InspectionPlan, MachineState, ProbeEvent, ReferenceMeasurement};

use model::{DeclaredEffect, DeclaredError};

pub use checks::drives as check_drives;
pub(crate) use checks::{larger, touches as check_touches};

/// The messages of one session.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Session {
    /// Where it came from, for the report.
    pub name: String,
    /// URDF text of `robot_description`.
    pub robot_description: String,
    /// The plan that was measured; `None` in a drive session.
    pub plan: Option<InspectionPlan>,
    /// Touches, in any order.
    pub events: Vec<ProbeEvent>,
    /// Axis positions, speeds and efforts over time.
    pub joint_states: Vec<JointState>,
    /// Commanded positions, speeds and efforts over time.
    pub joint_commands: Vec<JointState>,
    /// Mode, tool and temperatures over time.
    pub machine_states: Vec<MachineState>,
    /// What outside instruments measured of the same points.
    pub references: Vec<ReferenceMeasurement>,
    /// Effects that belong to the cell's declared model: predicted, and not to be found again.
    #[serde(default)]
    pub declared: Vec<DeclaredEffect>,
}

impl Session {
    /// When its first touch (or sample) was taken, RFC 3339 in UTC; `None` where no stamp says.
    pub fn measured(&self) -> Option<String> {
        let touches = self.events.iter().map(|event| &event.header.stamp);
        let samples = self.joint_states.iter().map(|state| &state.header.stamp);
        let by_time = |stamp: &&Time| stamp.nanos();
        let first = touches.min_by_key(by_time);
        let first = *first.or_else(|| samples.min_by_key(by_time))?;
        if first.sec == 0 {
            return None;
        }
        Some(utc(first))
    }
}

/// An instant to the second, RFC 3339.
pub fn utc(at: Time) -> String {
    humantime::format_rfc3339_seconds(at.into()).to_string()
}

/// Why a session cannot be diagnosed.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The machine is not usable.
    #[error(transparent)]
    Chain(#[from] machine::ChainError),
    /// An event or the plan is not usable.
    #[error(transparent)]
    Deviation(#[from] machine::DeviationError),
    /// An effect of the declared model does not fit the machine.
    #[error("declared model: {0}")]
    Declared(#[from] DeclaredError),
    /// No robot description.
    #[error("the session has no robot_description")]
    NoMachine,
    /// No plan, and no effort or motion either.
    #[error(
        "the session has neither an inspection plan with touches nor joint states with commands or efforts"
    )]
    NoPlan,
    /// A sequence number came twice with other content.
    #[error("event {0} is recorded twice with different content")]
    Conflicting(u64),
    /// Too few touches.
    #[error("the session has {0} touches; at least {1} are needed")]
    TooFew(usize, usize),
    /// Magnitudes that no metre-based session has.
    #[error(
        "deviations have a median size of {size:.3} m: {suspect} may be in millimetres instead of metres"
    )]
    Unit {
        /// Median size of the deviations, m.
        size: f64,
        /// What has the largest numbers.
        suspect: &'static str,
    },
    /// A number that is no length of a machine.
    #[error("the {what} is {value:e} m: not finite, or farther than any machine reaches")]
    Far {
        /// Which number.
        what: String,
        /// As given, m.
        value: f64,
    },
    /// A point of an operation that the plan lacks.
    #[error("point {point} names operation {operation}, but the plan has {operations} operations")]
    Operation {
        /// The point.
        point: usize,
        /// Operation that it names.
        operation: i32,
        /// Operations of the plan.
        operations: usize,
    },
    /// An axis that the machine lacks.
    #[error("{topic} names axis `{axis}`, which the robot description lacks")]
    Axis {
        /// Topic concerned.
        topic: &'static str,
        /// The axis.
        axis: String,
    },
    /// A drive session in which nothing can be compared.
    #[error(
        "no axis of the drive session has enough samples of its effort, or of its commands and motion"
    )]
    NoEffort,
    /// A session in which the joints of an arm are not seen often enough.
    #[error("{0} has fewer than {1} samples of a joint of the arm")]
    Short(String, usize),
    /// A session of an arm whose motion has no sample that can be compared.
    #[error(
        "{0} has no sample of a joint that moves between samples at a usual step: is the unit of its times right?"
    )]
    Still(String),
    /// Efforts without a sign.
    #[error(
        "the effort of joint `{0}` never changes its sign although that of its weight does: it is a magnitude, which cannot be compared with a model"
    )]
    Magnitude(String),
    /// Drive effects that cannot be fitted.
    #[error("axis `{axis}`: its drive effects cannot be fitted: {singular}")]
    Singular {
        /// The axis.
        axis: String,
        /// Why not.
        singular: inference::least_squares::Singular,
    },
    /// An effect that is no effect.
    #[error("there is no effect `{name}` on this machine: did you mean `{nearest}`?")]
    UnknownEffect {
        /// As asked for.
        name: String,
        /// The most similar one.
        nearest: String,
    },
    /// A reference that does not belong.
    #[error("reference of `{instrument}`: {what}")]
    Reference {
        /// Its instrument.
        instrument: String,
        /// What is wrong.
        what: &'static str,
    },
    /// Sessions that do not share a machine.
    #[error("sessions `{0}` and `{1}` have different machines")]
    OtherMachine(String, String),
    /// Sessions whose cells declare different effects.
    #[error("sessions `{0}` and `{1}` have different declared effects: declare one model for both")]
    OtherModel(String, String),
    /// Sessions that do not share a clamping.
    #[error("plans `{0}` and `{1}` do not share part pose, stylus and rotary axes")]
    OtherPart(String, String),
}

/// Seconds of a stamp.
pub fn seconds(stamp: &Time) -> f64 {
    f64::from(stamp.sec.cast_unsigned()) + 1e-9 * f64::from(stamp.nanosec)
}
