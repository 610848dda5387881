//! Why a bag is no session, in one sentence each.

use super::Missing;
use crate::damage::Damage;
use crate::error::Error;

/// Why a bag is no session.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SessionError {
    /// It cannot be read, or a topic of the contract carries another type.
    #[error(transparent)]
    Bag(#[from] Error),
    /// No topic of the contract.
    #[error(
        "the bag holds no cell: no topic ends in /robot_description, /probe_events or /joint_states"
    )]
    NoCell,
    /// More than one namespace.
    #[error("the bag holds several cells: {0}")]
    SeveralCells(String),
    /// Nothing on `robot_description`.
    #[error("no machine model on {0}")]
    NoRobotDescription(String),
    /// The machine model changed during the session.
    #[error("{count} different machine models on {topic}")]
    SeveralRobotDescriptions {
        /// Topic concerned.
        topic: String,
        /// Models that differ.
        count: usize,
    },
    /// Touches without a plan, or neither touches nor motion.
    #[error("no inspection plan on {0}")]
    NoPlan(String),
    /// The plan changed during the session.
    #[error("{} different inspection plans on {topic}: {}", .plans.len(), some(.plans))]
    SeveralPlans {
        /// Topic concerned.
        topic: String,
        /// Their ids.
        plans: Vec<String>,
    },
    /// The plan wanted is not in the bag.
    #[error("no inspection plan {wanted} in the bag; it has {}", some(.plans))]
    NoSuchPlan {
        /// Id asked for.
        wanted: String,
        /// Ids there are.
        plans: Vec<String>,
    },
    /// Events are missing, and all are wanted, or more are missing than there are.
    #[error(transparent)]
    MissingEvents(Missing),
    /// An event twice.
    #[error("probe event {0} is in the bag twice")]
    DuplicateEvent(u64),
    /// An event after a later one.
    #[error("probe event {sequence} is recorded after event {after}")]
    ReorderedEvent {
        /// Its number.
        sequence: u64,
        /// The largest number before it.
        after: u64,
    },
    /// An event of another plan.
    #[error("probe event {sequence} is of plan {found}, the bag has {expected}")]
    EventOfOtherPlan {
        /// Its number.
        sequence: u64,
        /// Plan it names.
        found: String,
        /// Plan of the bag.
        expected: String,
    },
    /// An event at a point that the plan does not have.
    #[error("probe event {sequence} names point {point_index}, the plan has {points} points")]
    NoSuchPoint {
        /// Its number.
        sequence: u64,
        /// Point it names.
        point_index: u32,
        /// Points of the plan.
        points: usize,
    },
    /// Names and values of different number.
    #[error("message {index} on {topic} has {names} axis names and {values} values of {field}")]
    AxisCount {
        /// Topic concerned.
        topic: String,
        /// Message on the topic, from 0.
        index: usize,
        /// Field concerned.
        field: &'static str,
        /// Number of names.
        names: usize,
        /// Number of values.
        values: usize,
    },
    /// NaN or infinity.
    #[error("{field} in message {index} on {topic} is not finite")]
    NotFinite {
        /// Topic concerned.
        topic: String,
        /// Message on the topic, from 0.
        index: usize,
        /// Field concerned, with its index in lists.
        field: String,
    },
    /// A point of an operation that the plan does not have.
    #[error(
        "the inspection plan's point {point} names operation {operation}, it has {operations} operations"
    )]
    NoSuchOperation {
        /// The point.
        point: usize,
        /// Operation it names.
        operation: i32,
        /// Operations of the plan.
        operations: usize,
    },
    /// Names and values of different number.
    #[error("message {index} on {topic} has {names} temperature names and {values} temperatures")]
    TemperatureCount {
        /// Topic concerned.
        topic: String,
        /// Message on the topic, from 0.
        index: usize,
        /// Number of names.
        names: usize,
        /// Number of values.
        values: usize,
    },
    /// A plan's point or reference that points outside of its list.
    #[error(
        "the inspection plan's point {point} names feature {feature}, it has {features} features"
    )]
    NoSuchFeature {
        /// The point.
        point: usize,
        /// Feature it names.
        feature: u32,
        /// Features of the plan.
        features: usize,
    },
    /// Any of the above in a bag that is damaged, which may be the cause.
    #[error("{problem} ({damage})")]
    Damaged {
        /// What is wrong with the session.
        problem: Box<SessionError>,
        /// What is wrong with the bag.
        damage: Damage,
    },
}

/// Names of a list that may be long: the first and the last of them.
fn some(names: &[String]) -> String {
    const FIRST: usize = 5;
    match names {
        [first @ .., last] if first.len() > FIRST + 1 => format!(
            "{}, {} more, and {last}",
            first[..FIRST].join(", "),
            first.len() - FIRST
        ),
        all => all.join(", "),
    }
}
