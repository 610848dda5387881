//! One measuring or driving session of a cell, read out of a bag and checked against the interface contract.
//!
//! Positions m or rad as on the wire, times ns since 1970. Checked here: topics, types, the plan, the events' numbers,
//! finite values. Not checked: whether the measurements make sense, nor whether what a damaged bag still holds suffices.

mod checks;
mod error;

use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    InspectionPlan, MachineState, MeasurementOrder, Message, ProbeEvent, ProbeTrigger,
    ReferenceMeasurement, std_msgs,
};

use crate::damage::Damage;
use crate::error::Error;
use crate::reader::{Bag, Stamped};
use checks::{
    check_events, check_joints, check_machine, check_numbers, check_plan, check_plans, finite, runs,
};

pub use error::SessionError;

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
    /// In the order of their numbers, which are those of one run of the driver.
    pub events: Vec<Stamped<ProbeEvent>>,
    /// Measured axes.
    pub joint_states: Vec<Stamped<JointState>>,
    /// Commanded axes, where the controller reports them.
    pub joint_commands: Vec<Stamped<JointState>>,
    /// Machine state.
    pub machine_states: Vec<Stamped<MachineState>>,
    /// Measurements of an outside instrument.
    pub references: Vec<Stamped<ReferenceMeasurement>>,
    /// Stretches of events that are not in the bag.
    pub missing: Vec<Missing>,
    /// Touches of the same plan from before a restart of the driver: void, for the axes may have another origin since, and
    /// left out above.
    pub void: usize,
    /// Damage of the bag; what is above is its complete part.
    pub damage: Vec<Damage>,
}

impl Session {
    /// Reads the only cell of a bag, which measured one plan.
    ///
    /// # Errors
    /// [`SessionError`] says what the bag lacks or contradicts.
    pub fn read(bag: &Bag) -> Result<Self, SessionError> {
        Self::read_measurement(bag, &Measurement::Only)
    }

    /// Reads one measurement of the only cell of a bag. A cell that cuts and measures in several passes has a plan for
    /// each; touches and references of the other plans are left out. Events may be missing unless the measurement is
    /// [`Measurement::Only`]: see [`Session::missing`].
    ///
    /// # Errors
    /// [`SessionError`] says what the bag lacks or contradicts.
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

    /// The measuring orders of its plan; none where the bag holds no such topic. Damage is left to [`Session::damage`].
    ///
    /// # Errors
    /// [`SessionError`] where the topic holds other messages, or numbers that are not finite.
    pub fn orders(&self, bag: &Bag) -> Result<Vec<MeasurementOrder>, SessionError> {
        let topic = format!("{}/measurement_order", self.namespace);
        let orders = distinct(collect::<MeasurementOrder>(bag, &topic, &mut Vec::new())?);
        let plan_id = self.plan.as_ref().map(|plan| &plan.plan_id);
        let own = orders
            .into_iter()
            .filter(|order| Some(&order.plan_id) == plan_id);
        let own: Vec<MeasurementOrder> = own.collect();
        for (index, order) in own.iter().enumerate() {
            for step in &order.moves {
                finite(&topic, index, "axis_positions", &step.axis_positions)?;
            }
        }
        Ok(own)
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
        let events = collect::<ProbeEvent>(bag, &topic("probe_events"), damage)?;
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
        // Numbers of touches begin again with each run of the driver.
        let triggers = collect::<ProbeTrigger>(bag, &topic("probe_triggers"), &mut Vec::new());
        let runs = runs(&events, &triggers.unwrap_or_default());
        let missing = check_numbers(&events, &runs)?;
        let plans = distinct(plans);
        let several = plans.len() > 1;
        if several {
            check_plans(&plans, &events)?;
        }
        let plan = choose(&topic("inspection_plan"), plans, &events, measurement)?;
        let mut events: Vec<(Stamped<ProbeEvent>, usize)> = events.into_iter().zip(runs).collect();
        if let Some(plan) = plan.as_ref().filter(|_| several) {
            events.retain(|(event, _)| event.message.plan_id == plan.plan_id);
            references.retain(|reference| reference.message.plan_id == plan.plan_id);
        }
        let (of_plan, last) = (events.len(), events.last().map(|(_, run)| *run));
        events.retain(|(_, run)| Some(*run) == last);
        let events: Vec<Stamped<ProbeEvent>> = events.into_iter().map(|(event, _)| event).collect();
        let void = of_plan - events.len();
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
            void,
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
