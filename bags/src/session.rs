//! One measuring or driving session of a cell, read out of a bag and checked against the interface contract.
//!
//! Positions m or rad as on the wire, times ns since 1970. Checked here: topics, types, the plan, the events' numbers,
//! finite values. Not checked: whether the measurements make sense, nor whether what a damaged bag still holds suffices.

use std::fmt::Debug;

use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    InspectionPlan, InspectionPoint, MachineState, Message, ProbeEvent, ReferenceMeasurement,
    std_msgs,
};

use crate::container::Damage;
use crate::error::Error;
use crate::reader::{Bag, Stamped};

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
    #[error("{} different inspection plans on {topic}: {}", .plans.len(), .plans.join(", "))]
    SeveralPlans {
        /// Topic concerned.
        topic: String,
        /// Their ids.
        plans: Vec<String>,
    },
    /// The plan wanted is not in the bag.
    #[error("no inspection plan {wanted} in the bag; it has {}", .plans.join(", "))]
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
    #[error("probe event {0} stands in the bag twice")]
    DuplicateEvent(u64),
    /// An event after a later one.
    #[error("probe event {sequence} stands in the bag after event {after}")]
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
        /// Field concerned, with its place in lists.
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

/// Which measurement of a bag is meant, where a cell measured several plans.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Measurement {
    /// There must be only one.
    #[default]
    Only,
    /// The one of the last touch.
    Last,
    /// The one of this plan id.
    Named(String),
}

/// A gap in the events' numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{count} probe events are missing before event {before} (expected {expected})")]
pub struct Missing {
    /// Number that should have come.
    pub expected: u64,
    /// Number that came.
    pub before: u64,
    /// How many are missing.
    pub count: u64,
}

/// A session of one cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// `/<cell>`, without a slash at the end.
    pub namespace: String,
    /// URDF text.
    pub robot_description: String,
    /// `None`: a drive bag.
    pub plan: Option<InspectionPlan>,
    /// In the order of their numbers.
    pub events: Vec<Stamped<ProbeEvent>>,
    /// Measured axes.
    pub joint_states: Vec<Stamped<JointState>>,
    /// Commanded axes, where the controller tells them.
    pub joint_commands: Vec<Stamped<JointState>>,
    /// Machine state.
    pub machine_states: Vec<Stamped<MachineState>>,
    /// Measurements of an outside instrument.
    pub references: Vec<Stamped<ReferenceMeasurement>>,
    /// Stretches of events that are not in the bag.
    pub missing: Vec<Missing>,
    /// Damage of the bag; what is above is its complete part.
    pub damage: Vec<Damage>,
}

impl Session {
    /// Reads the only cell of a bag, which measured one plan.
    pub fn read(bag: &Bag) -> Result<Self, SessionError> {
        Self::read_measurement(bag, &Measurement::Only)
    }

    /// Reads one measurement of the only cell of a bag. A cell that cuts and measures in several passes has a plan for
    /// each; touches and references of the other plans are left out. Events may be missing unless the measurement is
    /// [`Measurement::Only`]: see [`Session::missing`].
    pub fn read_measurement(bag: &Bag, measurement: &Measurement) -> Result<Self, SessionError> {
        let mut found = namespaces(bag);
        match (found.pop(), found.is_empty()) {
            (None, _) => Err(with_damage(SessionError::NoCell, &bag.verify())),
            (Some(namespace), true) => Self::read_in(bag, &namespace, measurement),
            (Some(last), false) => {
                found.push(last);
                Err(SessionError::SeveralCells(found.join(", ")))
            }
        }
    }

    /// Reads the cell of that namespace (`/<cell>`), which measured one plan.
    pub fn read_cell(bag: &Bag, namespace: &str) -> Result<Self, SessionError> {
        Self::read_in(bag, namespace, &Measurement::Only)
    }

    fn read_in(
        bag: &Bag,
        namespace: &str,
        measurement: &Measurement,
    ) -> Result<Self, SessionError> {
        let mut damage = bag.damage();
        match Self::gather(bag, namespace, measurement, &mut damage) {
            // Who wants the only measurement wants all of it.
            Ok(Self { missing, .. })
                if *measurement == Measurement::Only && !missing.is_empty() =>
            {
                Err(with_damage(
                    SessionError::MissingEvents(missing[0]),
                    &damage,
                ))
            }
            Ok(session) => Ok(Self { damage, ..session }),
            Err(problem) => Err(with_damage(problem, &damage)),
        }
    }

    /// Whether it holds motion without touches.
    pub fn is_drive(&self) -> bool {
        self.plan.is_none()
    }

    fn gather(
        bag: &Bag,
        namespace: &str,
        measurement: &Measurement,
        damage: &mut Vec<Damage>,
    ) -> Result<Self, SessionError> {
        let topic = |name: &str| format!("{namespace}/{name}");
        let descriptions = collect::<std_msgs::String>(bag, &topic("robot_description"), damage)?;
        let joint_states = collect::<JointState>(bag, &topic("joint_states"), damage)?;
        let joint_commands = collect::<JointState>(bag, &topic("joint_commands"), damage)?;
        let machine_states = collect::<MachineState>(bag, &topic("machine_state"), damage)?;
        let plans = collect::<InspectionPlan>(bag, &topic("inspection_plan"), damage)?;
        let mut events = collect::<ProbeEvent>(bag, &topic("probe_events"), damage)?;
        let mut references = collect::<ReferenceMeasurement>(bag, &topic("reference"), damage)?;

        let mut models = distinct(descriptions);
        if models.len() > 1 {
            let count = models.len();
            return Err(SessionError::SeveralRobotDescriptions {
                topic: topic("robot_description"),
                count,
            });
        }
        let model = models
            .pop()
            .ok_or_else(|| SessionError::NoRobotDescription(topic("robot_description")))?;
        let missing = check_numbers(&events)?;
        let plans = distinct(plans);
        let several = plans.len() > 1;
        if several {
            check_plans(&plans, &events)?;
        }
        let plan = choose(&topic("inspection_plan"), plans, &events, measurement)?;
        if let Some(plan) = plan.as_ref().filter(|_| several) {
            events.retain(|event| event.message.plan_id == plan.plan_id);
            references.retain(|reference| reference.message.plan_id == plan.plan_id);
        }
        check_machine(&topic("machine_state"), &machine_states)?;
        check_joints(&topic("joint_states"), &joint_states)?;
        check_joints(&topic("joint_commands"), &joint_commands)?;
        match &plan {
            Some(plan) => {
                check_plan(&topic("inspection_plan"), plan)?;
                check_events(&topic("probe_events"), plan, &events)?;
            }
            None if !events.is_empty()
                || joint_states.is_empty()
                || probing_was_meant(bag, namespace) =>
            {
                return Err(SessionError::NoPlan(topic("inspection_plan")));
            }
            None => {}
        }
        for (index, reference) in references.iter().enumerate() {
            let message = &reference.message;
            finite(&topic("reference"), index, "deviation", &message.deviation)?;
            finite(
                &topic("reference"),
                index,
                "standard_uncertainty",
                &[message.standard_uncertainty],
            )?;
        }
        Ok(Self {
            namespace: namespace.to_owned(),
            robot_description: model.data,
            plan,
            events,
            joint_states,
            joint_commands,
            machine_states,
            references,
            missing,
            damage: Vec::new(),
        })
    }
}

fn with_damage(problem: SessionError, damage: &[Damage]) -> SessionError {
    match damage.iter().find(|damage| damage.kind.loses_messages()) {
        Some(damage) => SessionError::Damaged {
            problem: Box::new(problem),
            damage: damage.clone(),
        },
        None => problem,
    }
}

/// Namespaces that have a topic of the contract.
fn namespaces(bag: &Bag) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for channel in bag.channels() {
        for name in ["/robot_description", "/probe_events", "/joint_states"] {
            if let Some(namespace) = channel.topic.strip_suffix(name) {
                found.push(namespace.to_owned());
            }
        }
    }
    found.sort();
    found.dedup();
    found
}

/// A probing bag whose plan or touches are lost still has their channels.
fn probing_was_meant(bag: &Bag, namespace: &str) -> bool {
    ["inspection_plan", "probe_events"].iter().any(|name| {
        bag.channels_of(&format!("{namespace}/{name}"))
            .next()
            .is_some()
    })
}

/// All messages of a topic, none if it is not there. Damage is collected once.
fn collect<T: Message>(
    bag: &Bag,
    topic: &str,
    damage: &mut Vec<Damage>,
) -> Result<Vec<Stamped<T>>, SessionError> {
    let typed = match bag.typed::<T>(topic) {
        Ok(typed) => typed,
        Err(Error::NoTopic { .. }) => return Ok(Vec::new()),
        Err(error) => return Err(error.into()),
    };
    let mut messages = Vec::new();
    for message in typed {
        match message {
            Ok(message) => messages.push(message),
            Err(Error::Damaged(found)) if damage.contains(&found) => {}
            Err(Error::Damaged(found)) => damage.push(found),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(messages)
}

/// Contents without repetition: a latched topic may be published again unchanged.
fn distinct<T: PartialEq>(messages: Vec<Stamped<T>>) -> Vec<T> {
    let mut found: Vec<T> = Vec::new();
    for Stamped { message, .. } in messages {
        if !found.contains(&message) {
            found.push(message);
        }
    }
    found
}

fn finite(
    topic: &str,
    index: usize,
    field: impl std::fmt::Display,
    values: &[f64],
) -> Result<(), SessionError> {
    if values.iter().all(|value| value.is_finite()) {
        return Ok(());
    }
    Err(SessionError::NotFinite {
        topic: topic.to_owned(),
        index,
        field: field.to_string(),
    })
}

fn check_joints(topic: &str, states: &[Stamped<JointState>]) -> Result<(), SessionError> {
    for (index, Stamped { message, .. }) in states.iter().enumerate() {
        let fields = [
            ("position", &message.position),
            ("velocity", &message.velocity),
            ("effort", &message.effort),
        ];
        for (field, values) in fields {
            // sensor_msgs/JointState allows each list to be empty.
            if !values.is_empty() && values.len() != message.name.len() {
                let (names, values) = (message.name.len(), values.len());
                return Err(SessionError::AxisCount {
                    topic: topic.to_owned(),
                    index,
                    field,
                    names,
                    values,
                });
            }
            finite(topic, index, field, values)?;
        }
    }
    Ok(())
}

fn check_plan(topic: &str, plan: &InspectionPlan) -> Result<(), SessionError> {
    let pose = &plan.part_pose;
    let position = [pose.position.x, pose.position.y, pose.position.z];
    let orientation = [
        pose.orientation.x,
        pose.orientation.y,
        pose.orientation.z,
        pose.orientation.w,
    ];
    finite(
        topic,
        0,
        "part_pose",
        &[&position[..], &orientation[..]].concat(),
    )?;
    let ball = &plan.stylus.ball_center;
    finite(
        topic,
        0,
        "stylus",
        &[ball.x, ball.y, ball.z, plan.stylus.ball_radius],
    )?;
    for (number, feature) in plan.features.iter().enumerate() {
        let (origin, axis) = (&feature.origin, &feature.axis);
        let fields: [(&str, &[f64]); 4] = [
            ("origin", &[origin.x, origin.y, origin.z]),
            ("axis", &[axis.x, axis.y, axis.z]),
            ("radius", &[feature.radius]),
            ("half_angle", &[feature.half_angle]),
        ];
        // A tolerance may be open to one side; no number it must not be.
        let tolerances = [feature.lower_tolerance, feature.upper_tolerance];
        let tolerances = tolerances.map(|value| if value.is_nan() { value } else { 0.0 });
        for (field, values) in fields.into_iter().chain([("tolerance", &tolerances[..])]) {
            finite(topic, 0, format_args!("features[{number}].{field}"), values)?;
        }
    }
    for (number, operation) in plan.operations.iter().enumerate() {
        let fields: [(&str, &[f64]); 2] = [
            (
                "tool_radius or feed",
                &[operation.tool_radius, operation.feed],
            ),
            ("rotary_positions", &operation.rotary_positions),
        ];
        for (field, values) in fields {
            finite(
                topic,
                0,
                format_args!("operations[{number}].{field}"),
                values,
            )?;
        }
    }
    for (number, point) in plan.points.iter().enumerate() {
        check_point(topic, plan, number, point)?;
    }
    Ok(())
}

fn check_point(
    topic: &str,
    plan: &InspectionPlan,
    number: usize,
    point: &InspectionPoint,
) -> Result<(), SessionError> {
    if point.feature as usize >= plan.features.len() {
        let (feature, features) = (point.feature, plan.features.len());
        return Err(SessionError::NoSuchFeature {
            point: number,
            feature,
            features,
        });
    }
    // -1: not cut on this machine; 0 is what a plan without operations leaves unsaid.
    let unsaid = plan.operations.is_empty() && point.operation == 0;
    if !unsaid && !(-1..plan.operations.len() as i32).contains(&point.operation) {
        let (operation, operations) = (point.operation, plan.operations.len());
        return Err(SessionError::NoSuchOperation {
            point: number,
            operation,
            operations,
        });
    }
    let (at, normal) = (&point.position, &point.normal);
    let fields: [(&str, &[f64]); 9] = [
        ("position", &[at.x, at.y, at.z]),
        ("normal", &[normal.x, normal.y, normal.z]),
        ("rotary_positions", &point.rotary_positions),
        ("approach_distance", &[point.approach_distance]),
        ("retract_distance", &[point.retract_distance]),
        ("feed", &[point.feed]),
        ("cut_length", &[point.cut_length]),
        ("tool_height", &[point.tool_height]),
        ("overhang", &[point.overhang]),
    ];
    for (field, values) in fields {
        finite(topic, 0, format_args!("points[{number}].{field}"), values)?;
    }
    Ok(())
}

fn check_machine(topic: &str, states: &[Stamped<MachineState>]) -> Result<(), SessionError> {
    for (index, Stamped { message, .. }) in states.iter().enumerate() {
        let (names, values) = (message.temperature_names.len(), message.temperatures.len());
        if names != values {
            return Err(SessionError::TemperatureCount {
                topic: topic.to_owned(),
                index,
                names,
                values,
            });
        }
        finite(topic, index, "temperatures", &message.temperatures)?;
        finite(topic, index, "spindle_speed", &[message.spindle_speed])?;
        finite(topic, index, "feed_override", &[message.feed_override])?;
    }
    Ok(())
}

/// Events are numbered from 0 in the order they stand, whatever plan they are of. Gives the gaps.
fn check_numbers(events: &[Stamped<ProbeEvent>]) -> Result<Vec<Missing>, SessionError> {
    let mut next = 0;
    let mut seen = std::collections::BTreeSet::new();
    let mut missing = Vec::new();
    for event in events {
        let sequence = event.message.sequence;
        if !seen.insert(sequence) {
            return Err(SessionError::DuplicateEvent(sequence));
        }
        if sequence < next {
            return Err(SessionError::ReorderedEvent {
                sequence,
                after: next - 1,
            });
        }
        if sequence > next {
            missing.push(Missing {
                expected: next,
                before: sequence,
                count: sequence - next,
            });
        }
        next = sequence.saturating_add(1);
    }
    let lost = |gap: &&Missing| gap.count > events.len() as u64;
    match missing.iter().find(lost) {
        Some(gap) => Err(SessionError::MissingEvents(*gap)),
        None => Ok(missing),
    }
}

/// Every event is of some plan of the bag.
fn check_plans(
    plans: &[InspectionPlan],
    events: &[Stamped<ProbeEvent>],
) -> Result<(), SessionError> {
    let known = |event: &&Stamped<ProbeEvent>| {
        !plans
            .iter()
            .any(|plan| plan.plan_id == event.message.plan_id)
    };
    match events.iter().find(known) {
        Some(event) => Err(SessionError::EventOfOtherPlan {
            sequence: event.message.sequence,
            found: event.message.plan_id.clone(),
            expected: plans
                .iter()
                .map(|plan| plan.plan_id.clone())
                .collect::<Vec<_>>()
                .join(" or "),
        }),
        None => Ok(()),
    }
}

/// The plan of the measurement that is wanted.
fn choose(
    topic: &str,
    mut plans: Vec<InspectionPlan>,
    events: &[Stamped<ProbeEvent>],
    measurement: &Measurement,
) -> Result<Option<InspectionPlan>, SessionError> {
    let wanted = match measurement {
        Measurement::Named(id) => Some(id.clone()),
        _ if plans.len() < 2 => return Ok(plans.pop()),
        Measurement::Only => None,
        Measurement::Last => events.last().map(|event| event.message.plan_id.clone()),
    };
    let ids = || plans.iter().map(|plan| plan.plan_id.clone()).collect();
    let mut chosen = plans
        .iter()
        .filter(|plan| wanted.as_ref() == Some(&plan.plan_id));
    match (chosen.next(), chosen.next()) {
        (Some(plan), None) => Ok(Some(plan.clone())),
        (None, _) if wanted.is_some() => Err(SessionError::NoSuchPlan {
            wanted: wanted.unwrap_or_default(),
            plans: ids(),
        }),
        _ => Err(SessionError::SeveralPlans {
            topic: topic.to_owned(),
            plans: ids(),
        }),
    }
}

fn check_events(
    topic: &str,
    plan: &InspectionPlan,
    events: &[Stamped<ProbeEvent>],
) -> Result<(), SessionError> {
    for (index, Stamped { message: event, .. }) in events.iter().enumerate() {
        let sequence = event.sequence;
        if event.plan_id != plan.plan_id {
            let (found, expected) = (event.plan_id.clone(), plan.plan_id.clone());
            return Err(SessionError::EventOfOtherPlan {
                sequence,
                found,
                expected,
            });
        }
        if event.point_index as usize >= plan.points.len() {
            let (point_index, points) = (event.point_index, plan.points.len());
            return Err(SessionError::NoSuchPoint {
                sequence,
                point_index,
                points,
            });
        }
        if event.axis_names.len() != event.axis_positions.len() {
            return Err(SessionError::AxisCount {
                topic: topic.to_owned(),
                index,
                field: "axis_positions",
                names: event.axis_names.len(),
                values: event.axis_positions.len(),
            });
        }
        finite(topic, index, "axis_positions", &event.axis_positions)?;
        finite(
            topic,
            index,
            "tip",
            &[event.tip.x, event.tip.y, event.tip.z],
        )?;
        let approach = &event.approach;
        finite(
            topic,
            index,
            "approach",
            &[approach.x, approach.y, approach.z, event.feed],
        )?;
    }
    Ok(())
}
