//! A running cell as `probecell diagnose --refine` uses it: its services, and what it publishes.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    time::{Duration, Instant},
};

use cell::Cell;
use diagnosis::Session;
use graph::{Topic, topics};
use host::bus::{Bus, Received, Subscription};
use host::bus_qos;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    Fault, InspectionPlan, MachineState, Message, PartReport, PlanId, ProbeEvent,
    ReferenceMeasurement, Service, from_cdr, srv, std_msgs, to_cdr,
};

use crate::{cell_bus, cell_client::request_plan, output};

/// Timeout of a service, and of robot description and last plan, which the cell keeps for late joiners.
const REPLY_TIMEOUT: Duration = Duration::from_secs(10);
/// Timeout of the last messages of a measurement after its end was reported.
const LATE_TIMEOUT: Duration = Duration::from_secs(5);

/// Why a cell does not measure additional touches.
#[derive(Debug, thiserror::Error)]
enum RefineError {
    /// No reply.
    #[error("no running cell {cell:?} can measure additional touches: {reason}")]
    NoCell { cell: String, reason: String },
    /// Another machine, or another part.
    #[error("cell {cell:?} is not the one that recorded the bag: {reason}")]
    Other { cell: String, reason: String },
    /// It refuses.
    #[error("cell {cell:?} refuses the additional touches: {reason}")]
    Refused { cell: String, reason: String },
}

/// What the cell publishes.
enum CellMessage {
    Machine(String),
    Plan(InspectionPlan),
    Event(ProbeEvent),
    Joints(JointState),
    State(MachineState),
    Reference(ReferenceMeasurement),
    End(PartReport),
    Fault(Fault),
    Lost(&'static str, u64),
}

/// The running cell: its services, and what it publishes.
pub(super) struct RunningCell {
    cell: String,
    namespace: String,
    bus: Bus,
    messages: Receiver<CellMessage>,
    subscriptions: Vec<Subscription>,
    plan: InspectionPlan,
}

impl RunningCell {
    /// Joins the cell and makes sure that it still holds what the session measured.
    pub(super) fn join(cell: &Cell, first: &Session) -> anyhow::Result<Self> {
        let name = cell.cell.name.clone();
        let none = |reason: String| RefineError::NoCell {
            cell: name.clone(),
            reason,
        };
        let bus = Bus::open(
            &cell_bus::visitor_config(cell, "refine")?,
            "refine",
            &cell.namespace(),
        )
        .map_err(|error| none(error.to_string()))?;
        let (sender, messages) = channel();
        let mut running = Self {
            namespace: cell.namespace(),
            cell: name.clone(),
            bus,
            messages,
            subscriptions: Vec::new(),
            plan: InspectionPlan::default(),
        };
        running.subscribe(
            topics::ROBOT_DESCRIPTION,
            &sender,
            |one: std_msgs::String| CellMessage::Machine(one.data),
        )?;
        running.subscribe(topics::INSPECTION_PLAN, &sender, CellMessage::Plan)?;
        running.subscribe(topics::PROBE_EVENTS, &sender, CellMessage::Event)?;
        running.subscribe(topics::JOINT_STATES, &sender, CellMessage::Joints)?;
        running.subscribe(topics::MACHINE_STATE, &sender, CellMessage::State)?;
        running.subscribe(topics::REFERENCE, &sender, CellMessage::Reference)?;
        running.subscribe(topics::PART_REPORTS, &sender, CellMessage::End)?;
        for topic in topics::ALL {
            if topic.name.ends_with("/faults") {
                running.subscribe(*topic, &sender, CellMessage::Fault)?;
            }
        }
        let (machine, plan) = running.machine_and_plan().ok_or_else(|| {
            none("it publishes neither its robot description nor a plan".to_owned())
        })?;
        let other = |reason: String| RefineError::Other { cell: name, reason };
        if machine != first.robot_description {
            return Err(other("its robot description differs".to_owned()).into());
        }
        let measured = first.plan.as_ref();
        let same = measured.is_some_and(|recorded| {
            let supplements =
                PlanId::from(&plan.plan_id).supplemented() == Some(recorded.plan_id.as_str());
            supplements
                || (plan.plan_id == recorded.plan_id && plan.header.stamp == recorded.header.stamp)
        });
        if !same {
            let recorded = measured.map_or("", |recorded| &recorded.plan_id);
            let text = format!(
                "its last plan {:?} is not the plan {recorded:?} of the bag, or was published at another time",
                plan.plan_id
            );
            return Err(other(text).into());
        }
        running.plan = plan;
        Ok(running)
    }

    fn subscribe<M: Message>(
        &mut self,
        topic: Topic,
        sender: &Sender<CellMessage>,
        take: impl Fn(M) -> CellMessage + Send + Sync + 'static,
    ) -> anyhow::Result<()> {
        let (samples, losses) = (sender.clone(), sender.clone());
        // The receiver may be gone at the end.
        let on_sample = move |received: Received<'_>| {
            if let Ok(message) = from_cdr::<M>(&received.payload) {
                samples.send(take(message)).unwrap_or_default();
            }
        };
        let on_lost = move |lost: host::bus::Lost| {
            let lost = CellMessage::Lost(topic.name, lost.count);
            losses.send(lost).unwrap_or_default();
        };
        self.subscriptions.push(self.bus.subscribe(
            &format!("{}/{}", self.namespace, topic.name),
            topic.message,
            bus_qos(topic.qos),
            Box::new(on_sample),
            Box::new(on_lost),
        )?);
        Ok(())
    }

    /// Robot description and last plan, which the cell keeps for late joiners.
    fn machine_and_plan(&self) -> Option<(String, InspectionPlan)> {
        let deadline = Instant::now() + REPLY_TIMEOUT;
        let (mut machine, mut plan) = (None, None);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.messages.recv_timeout(left).ok()? {
                CellMessage::Machine(text) => machine = Some(text),
                CellMessage::Plan(one) => plan = Some(one),
                _ => {}
            }
            if let (Some(machine), Some(plan)) = (&machine, &plan) {
                return Some((machine.clone(), plan.clone()));
            }
        }
    }

    /// Name of the next plan that adds to the session's.
    pub(super) fn next_name(&self, first: &Session) -> String {
        let own = first.plan.as_ref().map_or("", |plan| &plan.plan_id);
        let measured = PlanId::from(&self.plan.plan_id).supplement_number();
        PlanId::from(own).supplement(measured + 1).to_string()
    }

    /// Has the cell plan the touches and start to measure them.
    pub(super) fn request(&self, plan_id: &str, plan: &InspectionPlan) -> anyhow::Result<()> {
        let request = srv::PlanRequest {
            plan_id: plan_id.to_owned(),
            points: plan.points.clone(),
        };
        let planned = request_plan(&self.bus, &self.namespace, &request);
        let planned = planned.map_err(|error| RefineError::NoCell {
            cell: self.cell.clone(),
            reason: error.to_string(),
        })?;
        self.accepted(planned.accepted, planned.text)?;
        let request = srv::RunRequest {
            part_id: plan.part_id.clone(),
            plan_id: plan_id.to_owned(),
            ..srv::RunRequest::default()
        };
        let begun: srv::RunResponse = self.call::<srv::Run>("run", &request)?;
        self.accepted(begun.accepted, begun.text)
    }

    fn accepted(&self, accepted: bool, reason: String) -> anyhow::Result<()> {
        if accepted {
            return Ok(());
        }
        let cell = self.cell.clone();
        Err(RefineError::Refused { cell, reason }.into())
    }

    fn call<S: Service>(&self, name: &str, request: &S::Request) -> anyhow::Result<S::Response> {
        let none = |reason: String| RefineError::NoCell {
            cell: self.cell.clone(),
            reason,
        };
        let topic = format!("{}/{name}", self.namespace);
        let answered = self
            .bus
            .call(&topic, S::TYPE, &to_cdr(request), REPLY_TIMEOUT)
            .map_err(|error| none(error.to_string()))?;
        Ok(from_cdr(&answered).map_err(|error| none(error.to_string()))?)
    }

    /// Waits until the plan is measured; gives what was measured as a session of its own.
    pub(super) fn measured(
        &self,
        plan_id: &str,
        first: &Session,
        timeout: Duration,
    ) -> anyhow::Result<Session> {
        let mut later = Session {
            name: plan_id.to_owned(),
            robot_description: first.robot_description.clone(),
            declared: first.declared.clone(),
            ..Session::default()
        };
        let mut deadline = Instant::now() + timeout;
        let mut ended = false;
        while !(ended && complete(&later)) {
            let left = deadline.saturating_duration_since(Instant::now());
            let message = match self.messages.recv_timeout(left) {
                Ok(message) => message,
                Err(_) if ended => break,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    let text = format!(
                        "cell {:?} did not end plan {plan_id:?} within {} s; {} touches came",
                        self.cell,
                        timeout.as_secs(),
                        later.events.len()
                    );
                    return Err(cell_bus::CellFailure(text).into());
                }
            };
            match message {
                CellMessage::End(part) if part.plan_id == plan_id => {
                    if part.verdict != PartReport::MEASURED {
                        let text = format!("cell {:?} stopped: {}", self.cell, part.text);
                        return Err(cell_bus::CellFailure(text).into());
                    }
                    ended = true;
                    deadline = Instant::now() + LATE_TIMEOUT;
                }
                other => add(&mut later, plan_id, other),
            }
        }
        if !complete(&later) {
            output::warning("not every additional touch was received");
        }
        Ok(later)
    }

    pub(super) fn leave(mut self) -> anyhow::Result<()> {
        self.subscriptions.clear();
        self.bus.close(Duration::from_secs(2))?;
        Ok(())
    }
}

/// Adds a message that belongs to the plan.
fn add(later: &mut Session, plan_id: &str, message: CellMessage) {
    match message {
        CellMessage::Plan(plan) if plan.plan_id == plan_id => later.plan = Some(plan),
        CellMessage::Event(event) if event.plan_id == plan_id => later.events.push(event),
        CellMessage::Reference(one) if one.plan_id == plan_id => later.references.push(one),
        CellMessage::Joints(joints) => later.joint_states.push(joints),
        CellMessage::State(state) => later.machine_states.push(state),
        CellMessage::Fault(fault) => output::remark(&format!(
            "fault {} of {}: {}",
            fault.code, fault.node, fault.text
        )),
        CellMessage::Lost(topic, count) => output::warning(&format!(
            "{count} messages on {topic} were lost in transport"
        )),
        _ => {}
    }
}

/// Every point has an event, and axes and state were received after the last.
pub(crate) fn complete(later: &Session) -> bool {
    let Some(plan) = &later.plan else {
        return false;
    };
    let tried = |point: usize| {
        let mut events = later.events.iter();
        events.any(|event| event.point_index as usize == point)
    };
    let order = |stamp: Time| (stamp.sec, stamp.nanosec);
    let last = later
        .events
        .iter()
        .map(|event| order(event.header.stamp))
        .max();
    let axes = later.joint_states.last().map(|one| order(one.header.stamp));
    let states = later
        .machine_states
        .last()
        .map(|one| order(one.header.stamp));
    (0..plan.points.len()).all(tried) && axes > last && states > last
}
