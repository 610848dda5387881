//! `probecell diagnose --refine`: has the running cell that measured a session make the touches that part what is left.
//!
//! The cell plans and checks the touches (`plan`), measures them (`run` with that plan: no cut, no correction), and its
//! topics bring what was touched: this works through services and topics alone, whatever machine stands behind them.
//! What was measured is joined with the session, and both are diagnosed together. Distances in mm for people.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    time::{Duration, Instant},
};

use cell::Cell;
use diagnosis::joined::{added_to, further_name, further_number, join};
use diagnosis::next::{Effort, Wish};
use diagnosis::report::{Effect, NextMeasurement};
use diagnosis::{Options, Report, Residuals, Session, diagnose_with_residuals};
use graph::{Topic, topics};
use host::bus::{Bus, Received, Subscription};
use host::bus_qos;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    Fault, InspectionPlan, MachineState, Message, PartReport, ProbeEvent, ReferenceMeasurement,
    Service, from_cdr, srv, std_msgs, to_cdr,
};
use serde::Serialize;

use crate::{launcher, operator, report};

/// How long a cell may take to tell its machine and its last plan, and to answer a call.
const ANSWER_PATIENCE: Duration = Duration::from_secs(10);
/// How long what was touched last may be on its way after the cell has said that it is done.
const LATE_PATIENCE: Duration = Duration::from_secs(5);

/// An explanation that is more probable is left alone: the chance of a proposal is that of reaching it.
const SURE: f64 = 0.95;

/// Why a cell does not measure further.
#[derive(Debug, thiserror::Error)]
enum RefineError {
    /// Nobody answers.
    #[error("no cell {cell:?} runs that could measure further: {reason}")]
    NoCell { cell: String, reason: String },
    /// Another machine, or another part.
    #[error("cell {cell:?} does not hold what the bag measured: {reason}")]
    Other { cell: String, reason: String },
    /// It will not.
    #[error("cell {cell:?} refuses the further touches: {reason}")]
    Refused { cell: String, reason: String },
}

/// What came of it.
#[derive(Serialize)]
pub(super) struct Refined {
    /// The answer from the bag alone.
    before: Report,
    /// What was asked for; nothing where nothing was left to be told apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    asked: Option<Asked>,
    /// The answer from both.
    pub(super) after: Report,
    /// One explanation is left.
    resolved: bool,
    #[serde(skip)]
    pub(super) residuals: Residuals,
}

/// Touches that the cell has made.
#[derive(Serialize)]
struct Asked {
    /// Plan of the further touches.
    plan_id: String,
    /// Effects that they are to tell apart.
    separates: Vec<String>,
    /// Touches asked for.
    points: usize,
    /// Touches that found a surface.
    touched: usize,
    /// Predicted chance that they would leave one explanation.
    promised: f64,
}

/// Diagnoses a session, has the cell make the touches that are proposed, and diagnoses both; `told`: says so on the way.
pub(super) fn refine(
    cell: &Cell,
    first: &Session,
    options: &Options,
    patience: Duration,
    told: bool,
) -> anyhow::Result<Refined> {
    let tell = |text: &str| {
        if told {
            report::line(text);
        }
    };
    let (before, residuals) = diagnose_with_residuals(first, options)?;
    tell(&before.to_string());
    let Some((proposal, plan)) = proposal(first, options, &before)? else {
        tell(
            "Nothing is left that further touches of this plan would tell apart: nothing was measured.",
        );
        return Ok(Refined {
            after: before.clone(),
            resolved: resolved(&before),
            before,
            asked: None,
            residuals,
        });
    };
    let desk = Desk::join(cell, first)?;
    let plan_id = desk.next_name(first);
    tell(&question(&proposal, &cell.cell.name, &plan_id));
    desk.ask(&plan_id, &plan)?;
    let later = desk.measured(&plan_id, first, patience)?;
    desk.leave()?;
    let touched = (later.events.iter())
        .filter(|event| event.outcome == ProbeEvent::OUTCOME_TOUCHED)
        .count();
    let (after, residuals) = diagnose_with_residuals(&join(first, &later)?, options)?;
    tell(&after.to_string());
    let resolved = resolved(&after);
    tell(&answer(&proposal, touched, &before, &after));
    Ok(Refined {
        before,
        asked: Some(Asked {
            plan_id,
            separates: proposal.separates,
            points: plan.points.len(),
            touched,
            promised: proposal.chance,
        }),
        after,
        resolved,
        residuals,
    })
}

/// The touches that a thorough search proposes; `None` where nothing is left to be told apart, or nothing tells it.
fn proposal(
    session: &Session,
    options: &Options,
    before: &Report,
) -> anyhow::Result<Option<(NextMeasurement, InspectionPlan)>> {
    if resolved(before) {
        return Ok(None);
    }
    let options = Options {
        next: Wish {
            effort: Effort::Thorough,
            ..options.next
        },
        ..options.clone()
    };
    let (mut thorough, _) = diagnose_with_residuals(session, &options)?;
    let proposal =
        (!thorough.next_measurement.is_empty()).then(|| thorough.next_measurement.remove(0));
    Ok(proposal.and_then(|proposal| {
        let plan = proposal
            .plan
            .clone()
            .filter(|plan| !plan.points.is_empty())?;
        Some((proposal, plan))
    }))
}

/// One explanation is left; effects that no touch within reach parts count as one.
fn resolved(result: &Report) -> bool {
    let alone = |effect: &Effect| effect.indistinguishable_from.is_empty();
    match result.next_measurement.first() {
        None => result.effects.iter().all(alone),
        Some(next) => {
            let first = next.explanations.first();
            first.is_some_and(|one| one.probability > SURE)
        }
    }
}

fn question(proposal: &NextMeasurement, cell: &str, plan_id: &str) -> String {
    let mut lines = vec![format!(
        "\nCell {cell:?} is asked for {} further touches, plan {plan_id:?}, to tell apart {} \
         (predicted chance {:.2}):",
        proposal.points.len(),
        proposal.separates.join(", "),
        proposal.chance
    )];
    for point in &proposal.points {
        let [x, y, z] = point.position.map(|value| value * 1e3);
        let turned: Vec<String> = (point.rotary_positions.iter())
            .map(|angle| format!("{:.1}°", angle.to_degrees()))
            .collect();
        let turned = if turned.is_empty() {
            String::new()
        } else {
            format!(" at {}", turned.join(" "))
        };
        lines.push(format!(
            "  {} ({x:.3}, {y:.3}, {z:.3}) mm{turned}, {:.0} mm/min: {}",
            point.feature,
            point.feed * 60e3,
            point.why
        ));
    }
    lines.join("\n")
}

fn answer(proposal: &NextMeasurement, touched: usize, before: &Report, after: &Report) -> String {
    let names = |result: &Report| {
        let one = |effect: &Effect| {
            let mut names = vec![effect.effect.as_str()];
            names.extend(effect.indistinguishable_from.iter().map(String::as_str));
            names.join(" or ")
        };
        let all: Vec<String> = result.effects.iter().map(one).collect();
        if all.is_empty() {
            "no effect named".to_owned()
        } else {
            all.join(" and ")
        }
    };
    let kept = if resolved(after) {
        "kept"
    } else {
        "not kept, more than one is left"
    };
    format!(
        "\nBefore: {}\nAfter {touched} further touches: {}\nPromised with a chance of {:.2} to leave one: {kept}.",
        names(before),
        names(after),
        proposal.chance
    )
}

/// What reaches the desk.
enum Heard {
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

/// A place in the running cell from which it is asked and heard.
struct Desk {
    cell: String,
    namespace: String,
    bus: Bus,
    heard: Receiver<Heard>,
    subscriptions: Vec<Subscription>,
    plan: InspectionPlan,
}

impl Desk {
    /// Joins the cell and makes sure that it still holds what the session measured.
    fn join(cell: &Cell, first: &Session) -> anyhow::Result<Self> {
        let name = cell.cell.name.clone();
        let none = |reason: String| RefineError::NoCell {
            cell: name.clone(),
            reason,
        };
        let bus = Bus::open(&launcher::bus_config(cell)?, "refine", &cell.namespace())
            .map_err(|error| none(error.to_string()))?;
        let (sender, heard) = channel();
        let mut desk = Self {
            namespace: cell.namespace(),
            cell: name.clone(),
            bus,
            heard,
            subscriptions: Vec::new(),
            plan: InspectionPlan::default(),
        };
        desk.hear(
            topics::ROBOT_DESCRIPTION,
            &sender,
            |one: std_msgs::String| Heard::Machine(one.data),
        )?;
        desk.hear(topics::INSPECTION_PLAN, &sender, Heard::Plan)?;
        desk.hear(topics::PROBE_EVENTS, &sender, Heard::Event)?;
        desk.hear(topics::JOINT_STATES, &sender, Heard::Joints)?;
        desk.hear(topics::MACHINE_STATE, &sender, Heard::State)?;
        desk.hear(topics::REFERENCE, &sender, Heard::Reference)?;
        desk.hear(topics::PART_REPORTS, &sender, Heard::End)?;
        for topic in topics::ALL {
            if topic.name.ends_with("/faults") {
                desk.hear(*topic, &sender, Heard::Fault)?;
            }
        }
        let (machine, plan) = desk
            .first_heard()
            .ok_or_else(|| none("it tells neither its machine nor its last plan".to_owned()))?;
        let other = |reason: String| RefineError::Other { cell: name, reason };
        if machine != first.robot_description {
            return Err(other("its robot description is another".to_owned()).into());
        }
        let measured = first.plan.as_ref();
        let same = measured.is_some_and(|own| {
            let further = added_to(&plan.plan_id) == Some(own.plan_id.as_str());
            further || (plan.plan_id == own.plan_id && plan.header.stamp == own.header.stamp)
        });
        if !same {
            let own = measured.map(|own| own.plan_id.clone()).unwrap_or_default();
            let text = format!(
                "its last plan is {:?} of another time or name than the bag's {own:?}",
                plan.plan_id
            );
            return Err(other(text).into());
        }
        desk.plan = plan;
        Ok(desk)
    }

    fn hear<M: Message>(
        &mut self,
        topic: Topic,
        sender: &Sender<Heard>,
        take: impl Fn(M) -> Heard + Send + Sync + 'static,
    ) -> anyhow::Result<()> {
        let (samples, losses) = (sender.clone(), sender.clone());
        // Who has left hears nothing more.
        let on_sample = move |received: Received<'_>| {
            if let Ok(message) = from_cdr::<M>(&received.payload) {
                samples.send(take(message)).unwrap_or_default();
            }
        };
        let on_lost = move |lost: host::bus::Lost| {
            let heard = Heard::Lost(topic.name, lost.count);
            losses.send(heard).unwrap_or_default();
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

    /// Robot description and last plan, which the cell keeps for late comers.
    fn first_heard(&self) -> Option<(String, InspectionPlan)> {
        let deadline = Instant::now() + ANSWER_PATIENCE;
        let (mut machine, mut plan) = (None, None);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.heard.recv_timeout(left).ok()? {
                Heard::Machine(text) => machine = Some(text),
                Heard::Plan(one) => plan = Some(one),
                _ => {}
            }
            if let (Some(machine), Some(plan)) = (&machine, &plan) {
                return Some((machine.clone(), plan.clone()));
            }
        }
    }

    /// Name of the next plan that adds to the session's.
    fn next_name(&self, first: &Session) -> String {
        let own = first.plan.as_ref().map_or("", |plan| &plan.plan_id);
        further_name(own, further_number(&self.plan.plan_id) + 1)
    }

    /// Has the cell plan the touches and begin to measure them.
    fn ask(&self, plan_id: &str, plan: &InspectionPlan) -> anyhow::Result<()> {
        let request = srv::PlanRequest {
            plan_id: plan_id.to_owned(),
            points: plan.points.clone(),
        };
        let planned = operator::ask_for_plan(&self.bus, &self.namespace, &request);
        let planned = planned.map_err(|error| RefineError::NoCell {
            cell: self.cell.clone(),
            reason: error.to_string(),
        })?;
        self.accepted(planned.accepted, planned.text)?;
        let request = srv::RunRequest {
            part_id: plan.part_id.clone(),
            plan_id: plan_id.to_owned(),
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
            .call(&topic, S::TYPE, &to_cdr(request), ANSWER_PATIENCE)
            .map_err(|error| none(error.to_string()))?;
        Ok(from_cdr(&answered).map_err(|error| none(error.to_string()))?)
    }

    /// Waits until the plan is measured; gives what was measured as a session of its own.
    fn measured(
        &self,
        plan_id: &str,
        first: &Session,
        patience: Duration,
    ) -> anyhow::Result<Session> {
        let mut later = Session {
            name: plan_id.to_owned(),
            robot_description: first.robot_description.clone(),
            declared: first.declared.clone(),
            ..Session::default()
        };
        let mut deadline = Instant::now() + patience;
        let mut ended = false;
        while !(ended && complete(&later)) {
            let left = deadline.saturating_duration_since(Instant::now());
            let heard = match self.heard.recv_timeout(left) {
                Ok(heard) => heard,
                Err(_) if ended => break,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    let text = format!(
                        "cell {:?} did not end plan {plan_id:?} within {} s; {} touches came",
                        self.cell,
                        patience.as_secs(),
                        later.events.len()
                    );
                    return Err(launcher::Failed(text).into());
                }
            };
            match heard {
                Heard::End(part) if part.plan_id == plan_id => {
                    if part.verdict != PartReport::MEASURED {
                        let text = format!("cell {:?} stopped: {}", self.cell, part.text);
                        return Err(launcher::Failed(text).into());
                    }
                    ended = true;
                    deadline = Instant::now() + LATE_PATIENCE;
                }
                other => take(&mut later, plan_id, other),
            }
        }
        if !complete(&later) {
            report::remark("warning: not every further touch was heard");
        }
        Ok(later)
    }

    fn leave(mut self) -> anyhow::Result<()> {
        self.subscriptions.clear();
        self.bus.close(Duration::from_secs(2))?;
        Ok(())
    }
}

/// Takes in what belongs to the plan.
fn take(later: &mut Session, plan_id: &str, heard: Heard) {
    match heard {
        Heard::Plan(plan) if plan.plan_id == plan_id => later.plan = Some(plan),
        Heard::Event(event) if event.plan_id == plan_id => later.events.push(event),
        Heard::Reference(one) if one.plan_id == plan_id => later.references.push(one),
        Heard::Joints(joints) => later.joint_states.push(joints),
        Heard::State(state) => later.machine_states.push(state),
        Heard::Fault(fault) => report::remark(&format!(
            "fault {} of {}: {}",
            fault.code, fault.node, fault.text
        )),
        Heard::Lost(topic, count) => report::remark(&format!(
            "warning: {count} messages on {topic} were lost on their way"
        )),
        _ => {}
    }
}

/// Every point was tried, and the axes were heard after the last.
fn complete(later: &Session) -> bool {
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
