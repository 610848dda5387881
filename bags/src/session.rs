//! One measuring or driving session of a cell, read out of a bag and checked against the interface contract.
//!
//! Positions m or rad as on the wire, times ns since 1970. Checked here: topics, types, the plan, the events' numbers,
//! finite values. Not checked: whether the measurements make sense, nor whether what a damaged bag still holds suffices.

mod checks;
mod error;

use std::collections::BTreeMap;

use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    InspectionPlan, MachineState, MeasurementOrder, Message, ProbeEvent, ProbeTrigger,
    ReferenceMeasurement, std_msgs,
};

use crate::damage::Damage;
use crate::error::Error;
use crate::reader::{Bag, Stamped};
use checks::{
    Mark, check_event, check_joints, check_machine, check_numbers, check_plan, check_plans, finite,
    instant, runs,
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
    /// Touches beyond 100,000 that are left out above, evenly spread.
    pub left_out: usize,
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
        let namespace = only_namespace(bag)?;
        Self::read_in(bag, &namespace, measurement)
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
        let cell = CellRecord::read(bag, namespace, damage)?;
        let topic = cell.topic("inspection_plan");
        let last = cell.events.last().map(|event| &cell.plan_ids[event.plan]);
        let plan = choose(&topic, &cell.plans, last, measurement)?;
        let mut session = cell.measurement(plan)?;
        let own = cell.own(plan);
        session.void = own.void;
        session.left_out = own.left_out;
        session.events = cell.events_of(bag, plan, &own.numbers, damage)?;
        let stamps = session.events.iter().map(|event| event.log_time);
        let (from, to) = stamps.fold((u64::MAX, 0), |(from, to), at| (from.min(at), to.max(at)));
        // What moves while nothing is touched is of no measurement; a drive session is nothing else.
        let during = match &session.plan {
            Some(_) => (from.saturating_sub(BESIDE), to.saturating_add(BESIDE)),
            None => (0, u64::MAX),
        };
        session.joint_states = samples(bag, &cell.topic("joint_states"), during, damage)?;
        session.joint_commands = samples(bag, &cell.topic("joint_commands"), during, damage)?;
        check_joints(&cell.topic("joint_states"), &session.joint_states)?;
        check_joints(&cell.topic("joint_commands"), &session.joint_commands)?;
        session.machine_states = cell.machine_states(bag, during, MAX_TURNING, damage)?;
        if session.plan.is_none()
            && (!session.events.is_empty()
                || session.joint_states.is_empty()
                || probing_was_meant(bag, namespace))
        {
            return Err(SessionError::NoPlan(topic));
        }
        Ok(session)
    }

    /// Gives every measurement of the only cell of a bag to `take`, in the order of the plans: what was read of it, or why it
    /// cannot be used. Its axes are those latched at the touches: `joint_states` holds the first of the bag alone, and
    /// `machine_states`, which `take` gets once and all have in common, where temperatures or the spindle turn.
    ///
    /// # Errors
    /// [`SessionError`] says what the bag lacks or contradicts as a whole.
    pub fn each_measurement(
        bag: &Bag,
        mut take: impl FnMut(&str, Result<Self, SessionError>, &[Stamped<MachineState>]),
    ) -> Result<Vec<Damage>, SessionError> {
        let namespace = only_namespace(bag)?;
        let mut damage = bag.damage();
        let read = |damage: &mut Vec<Damage>| {
            let cell = CellRecord::read(bag, &namespace, damage)?;
            let first = samples(bag, &cell.topic("joint_states"), (0, 0), damage)?;
            let states = cell.machine_states(bag, (0, 0), MAX_COMMON, damage)?;
            let events = collect::<ProbeEvent>(bag, &cell.topic("probe_events"), damage)?;
            Ok((cell, events, first, states))
        };
        let (cell, events, first, states) =
            read(&mut damage).map_err(|problem| with_damage(problem, &damage))?;
        for (index, plan) in cell.plans.iter().enumerate() {
            let id = plan.plan_id.as_str();
            if cell.plans[..index].iter().any(|known| known.plan_id == id) {
                let problem = SessionError::SeveralPlans {
                    topic: cell.topic("inspection_plan"),
                    plans: vec![id.to_owned(), id.to_owned()],
                };
                take(id, Err(problem), &states);
                continue;
            }
            let session = cell.measurement(Some(plan)).and_then(|session| {
                let own = cell.own(Some(plan));
                let events = own.numbers.iter().map(|&number| events[number].clone());
                let events: Vec<_> = events.collect();
                for (index, event) in events.iter().enumerate() {
                    check_event(&cell.topic("probe_events"), plan, index, &event.message)?;
                }
                Ok(Self {
                    joint_states: first.clone(),
                    void: own.void,
                    left_out: own.left_out,
                    events,
                    ..session
                })
            });
            take(id, session, &states);
        }
        Ok(damage)
    }
}

/// Samples this long before the first and after the last touch of a measurement belong to it, ns.
const BESIDE: u64 = 60_000_000_000;
/// Most machine states that are kept outside a measurement, and most that all measurements share.
const MAX_TURNING: usize = 10_000;
const MAX_COMMON: usize = 1_000;

/// Most touches of a measurement that are read: of more, runs of successive ones that are spread evenly over it.
const MOST_EVENTS: usize = 25_000;
const RUN: usize = 32;

/// True of the numbers below `count` that are read: by the multiples of the golden ratio, whatever the period of the pattern that is
/// touched (Weyl 1916).
fn is_read(number: usize, count: usize) -> bool {
    let place = ((number / RUN) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    count <= MOST_EVENTS || place < (u64::MAX / count as u64).saturating_mul(MOST_EVENTS as u64)
}

/// The touches of a measurement.
struct Own {
    /// Their places among all touches of the cell.
    numbers: Vec<usize>,
    void: usize,
    left_out: usize,
}

/// What a bag holds of a cell but the samples over time.
struct CellRecord {
    namespace: String,
    robot_description: String,
    /// Those that differ.
    plans: Vec<InspectionPlan>,
    /// Its touches, of which everything else is read when it is known which are wanted.
    events: Vec<Mark>,
    /// The run of the driver of each event.
    runs: Vec<usize>,
    /// Plans that the events name.
    plan_ids: Vec<String>,
    missing: Vec<Missing>,
    references: Vec<Stamped<ReferenceMeasurement>>,
}

impl CellRecord {
    fn read(bag: &Bag, namespace: &str, damage: &mut Vec<Damage>) -> Result<Self, SessionError> {
        let topic = |name: &str| format!("{namespace}/{name}");
        let descriptions = collect::<std_msgs::String>(bag, &topic("robot_description"), damage)?;
        let plans = collect::<InspectionPlan>(bag, &topic("inspection_plan"), damage)?;
        let (mut events, mut plan_ids) = (Vec::new(), Vec::<String>::new());
        each::<ProbeEvent>(
            bag,
            &topic("probe_events"),
            (0, u64::MAX),
            damage,
            |event| {
                let id = &event.message.plan_id;
                let known = plan_ids.iter().rposition(|known| known == id);
                let plan = known.unwrap_or_else(|| {
                    plan_ids.push(id.clone());
                    plan_ids.len() - 1
                });
                events.push(Mark {
                    sequence: event.message.sequence,
                    latched: instant(&event.message.header),
                    log_time: event.log_time,
                    plan,
                });
                Ok(true)
            },
        )?;
        let references = collect::<ReferenceMeasurement>(bag, &topic("reference"), damage)?;
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
        let (mut sessions, mut of_triggers) = (Vec::<String>::new(), BTreeMap::new());
        let of_trigger = |trigger: Stamped<ProbeTrigger>| {
            let ProbeTrigger {
                session, sequence, ..
            } = trigger.message;
            if !session.is_empty() {
                let known = sessions.iter().rposition(|known| *known == session);
                let number = known.unwrap_or_else(|| {
                    sessions.push(session);
                    sessions.len() - 1
                });
                of_triggers.insert((instant(&trigger.message.header), sequence), number);
            }
            Ok(true)
        };
        let topic_of_triggers = topic("probe_triggers");
        if each(
            bag,
            &topic_of_triggers,
            (0, u64::MAX),
            &mut Vec::new(),
            of_trigger,
        )
        .is_err()
        {
            of_triggers.clear();
        }
        let runs = runs(&events, &of_triggers);
        let missing = check_numbers(&events, &runs)?;
        let plans = distinct(plans);
        if plans.len() > 1 {
            check_plans(&plans, &events, &plan_ids)?;
        }
        for (index, reference) in references.iter().enumerate() {
            let message = &reference.message;
            finite(&topic("reference"), index, "deviation", &message.deviation)?;
            let uncertainty = [message.standard_uncertainty];
            finite(
                &topic("reference"),
                index,
                "standard_uncertainty",
                &uncertainty,
            )?;
        }
        Ok(Self {
            namespace: namespace.to_owned(),
            robot_description: model.data,
            plans,
            events,
            runs,
            plan_ids,
            missing,
            references,
        })
    }

    fn topic(&self, name: &str) -> String {
        format!("{}/{name}", self.namespace)
    }

    /// True of the identifier of a plan whose touches are those of `plan`.
    fn is_of(&self, plan: Option<&InspectionPlan>, id: &str) -> bool {
        plan.is_none_or(|plan| self.plans.len() < 2 || plan.plan_id == id)
    }

    /// The touches of a plan that are valid.
    fn own(&self, plan: Option<&InspectionPlan>) -> Own {
        let of_plan: Vec<bool> = (self.plan_ids.iter())
            .map(|id| self.is_of(plan, id))
            .collect();
        let own = (0..self.events.len()).filter(|&number| of_plan[self.events[number].plan]);
        let mut numbers: Vec<usize> = own.collect();
        let all = numbers.len();
        let last = numbers.last().map(|&number| self.runs[number]);
        numbers.retain(|&number| Some(self.runs[number]) == last);
        let (valid, mut index) = (numbers.len(), 0);
        numbers.retain(|_| {
            index += 1;
            is_read(index - 1, valid)
        });
        Own {
            void: all - valid,
            left_out: valid - numbers.len(),
            numbers,
        }
    }

    /// The touches at these places, in order.
    fn events_of(
        &self,
        bag: &Bag,
        plan: Option<&InspectionPlan>,
        numbers: &[usize],
        damage: &mut Vec<Damage>,
    ) -> Result<Vec<Stamped<ProbeEvent>>, SessionError> {
        let (Some(&first), Some(&last)) = (numbers.first(), numbers.last()) else {
            return Ok(Vec::new());
        };
        let topic = self.topic("probe_events");
        let during = (self.events[first].log_time, self.events[last].log_time);
        let mut number = self
            .events
            .partition_point(|event| event.log_time < during.0);
        let mut wanted = numbers.iter().peekable();
        let mut events = Vec::with_capacity(numbers.len());
        each::<ProbeEvent>(bag, &topic, during, damage, |event| {
            if wanted.next_if_eq(&&number).is_some() {
                if let Some(plan) = plan {
                    check_event(&topic, plan, events.len(), &event.message)?;
                }
                events.push(event);
            }
            number += 1;
            Ok(wanted.peek().is_some())
        })?;
        Ok(events)
    }

    /// The measurement of a plan, without touches and samples over time.
    fn measurement(&self, plan: Option<&InspectionPlan>) -> Result<Session, SessionError> {
        if let Some(plan) = plan {
            check_plan(&self.topic("inspection_plan"), plan)?;
        }
        let references = self.references.iter();
        Ok(Session {
            namespace: self.namespace.clone(),
            robot_description: self.robot_description.clone(),
            plan: plan.cloned(),
            void: 0,
            left_out: 0,
            events: Vec::new(),
            joint_states: Vec::new(),
            joint_commands: Vec::new(),
            machine_states: Vec::new(),
            references: references
                .filter(|reference| self.is_of(plan, &reference.message.plan_id))
                .cloned()
                .collect(),
            missing: self.missing.clone(),
            damage: Vec::new(),
        })
    }

    /// The machine states received `during` some log times; before and after them those at which a temperature or the spindle
    /// turns, whose effect goes on, so many at most: beyond, every second one goes.
    fn machine_states(
        &self,
        bag: &Bag,
        during: (u64, u64),
        limit: usize,
        damage: &mut Vec<Damage>,
    ) -> Result<Vec<Stamped<MachineState>>, SessionError> {
        let topic = self.topic("machine_state");
        let mut kept: Vec<Stamped<MachineState>> = Vec::new();
        let mut turning = 0;
        // The last two: whether the earlier one turns shows with the next.
        let (mut last, mut turned) = (None::<Stamped<MachineState>>, true);
        let is_during = |one: &Stamped<MachineState>| (during.0..=during.1).contains(&one.log_time);
        let mut keep = |one: Stamped<MachineState>, turns: bool| {
            if is_during(&one) {
                kept.push(one);
            } else if turns {
                kept.push(one);
                turning += 1;
                if turning > limit {
                    let mut number = 0;
                    kept.retain(|one| {
                        number += usize::from(!is_during(one));
                        is_during(one) || number % 2 == 1
                    });
                    turning = turning.div_ceil(2);
                }
            }
        };
        let mut index = 0;
        each(bag, &topic, (0, u64::MAX), damage, |state| {
            check_machine(&topic, index, &state)?;
            index += 1;
            let turns = last.as_ref().is_some_and(|last: &Stamped<MachineState>| {
                !last.message.drives_as(&state.message)
            });
            if let Some(last) = last.replace(state) {
                keep(last, turns || turned);
            }
            turned = turns || index == 1;
            Ok(true)
        })?;
        if let Some(last) = last {
            keep(last, true);
        }
        Ok(kept)
    }
}

/// The samples of a topic received `during` some log times, and the first of all, from which time is counted.
fn samples(
    bag: &Bag,
    topic: &str,
    during: (u64, u64),
    damage: &mut Vec<Damage>,
) -> Result<Vec<Stamped<JointState>>, SessionError> {
    let mut found = Vec::new();
    each(bag, topic, (0, u64::MAX), damage, |first| {
        found.push(first);
        Ok(false)
    })?;
    let Some(begin) = found.first().map(|first| first.log_time) else {
        return Ok(found);
    };
    if during.1 < begin {
        return Ok(found);
    }
    if during.0 <= begin {
        found.clear();
    }
    each(bag, topic, during, damage, |sample| {
        found.push(sample);
        Ok(true)
    })?;
    Ok(found)
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

/// The namespace of the only cell of a bag.
fn only_namespace(bag: &Bag) -> Result<String, SessionError> {
    let mut found = namespaces(bag);
    match (found.pop(), found.is_empty()) {
        (None, _) => Err(with_damage(SessionError::NoCell, &bag.verify())),
        (Some(namespace), true) => Ok(namespace),
        (Some(last), false) => {
            found.push(last);
            Err(SessionError::SeveralCells(found.join(", ")))
        }
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
    let mut messages = Vec::new();
    each(bag, topic, (0, u64::MAX), damage, |message| {
        messages.push(message);
        Ok(true)
    })?;
    Ok(messages)
}

/// Gives the messages of a topic received `during` some log times to `take` until it answers false.
fn each<T: Message>(
    bag: &Bag,
    topic: &str,
    during: (u64, u64),
    damage: &mut Vec<Damage>,
    mut take: impl FnMut(Stamped<T>) -> Result<bool, SessionError>,
) -> Result<(), SessionError> {
    let typed = match bag.typed::<T>(topic) {
        Ok(typed) => typed.during(during),
        Err(Error::NoTopic { .. }) => return Ok(()),
        Err(error) => return Err(error.into()),
    };
    for message in typed {
        match message {
            Ok(message) => {
                if !take(message)? {
                    break;
                }
            }
            Err(Error::Damaged(found)) if damage.contains(&found) => {}
            Err(Error::Damaged(found)) => damage.push(found),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
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
fn choose<'a>(
    topic: &str,
    plans: &'a [InspectionPlan],
    last: Option<&String>,
    measurement: &Measurement,
) -> Result<Option<&'a InspectionPlan>, SessionError> {
    let wanted = match measurement {
        Measurement::Named(id) => Some(id.clone()),
        _ if plans.len() < 2 => return Ok(plans.last()),
        Measurement::Only => None,
        Measurement::Last => last.cloned(),
    };
    let ids = || plans.iter().map(|plan| plan.plan_id.clone()).collect();
    let mut chosen = plans
        .iter()
        .filter(|plan| wanted.as_ref() == Some(&plan.plan_id));
    match (chosen.next(), chosen.next()) {
        (Some(plan), None) => Ok(Some(plan)),
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
