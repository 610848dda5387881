//! The rules of `probe_events`.

use std::collections::VecDeque;

use graph::{Node, Outbox, Stamp, faults, inputs, outputs, topics};
use machine::Nominal;
use probecell_msgs::{
    Fault, InspectionPlan, InspectionPoint, ProbeEvent, ProbeTrigger, geometry_msgs,
};
use serde::{Deserialize, Serialize};

use crate::config::Config;

inputs! {
    /// What `probe_events` subscribes to.
    pub enum Input {
        /// The raw end of a probing move.
        Trigger(ProbeTrigger) = topics::PROBE_TRIGGERS,
        /// What is measured.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
    }
}

outputs! {
    /// What `probe_events` publishes.
    pub enum Output {
        /// A probing move and its outcome.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// A fault.
        Fault(Fault) = topics::PROBE_EVENTS_FAULTS,
    }
}

faults! {
    /// What `probe_events` can find wrong.
    pub enum ProbeEventsFault of "probe_events" {
        /// A probing move ended without contact.
        NoContact = WARNING "no_contact",
        /// Several consecutive moves ended without contact.
        ProbeDead = ERROR "probe_dead",
        /// The probe was tripped before the move began.
        ProbeStuck = ERROR "probe_stuck",
        /// A trigger from which no event can be made.
        TriggerNotUsable = ERROR "trigger_not_usable",
    }
}

/// Triggers kept while their plan has not arrived.
const WAITING_LIMIT: usize = 4096;
/// Consecutive moves without contact after which the probe is considered dead: a single one may be missing material.
const DEAD_AFTER: u32 = 2;

/// The state of `probe_events`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The last plan received.
    pub plan: Option<InspectionPlan>,
    /// Triggers whose plan has not arrived yet.
    pub waiting: VecDeque<ProbeTrigger>,
    /// Consecutive moves that ended without contact.
    pub misses: u32,
    /// Session of the driver and number of the last trigger received: numbers rise in a session.
    pub last: Option<(String, u64)>,
}

/// The node.
pub struct ProbeEventsNode;

impl Node for ProbeEventsNode {
    const NAME: &'static str = "probe_events";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;
    type Fault = ProbeEventsFault;

    fn start(_config: &Config) -> State {
        State::default()
    }

    fn step(
        config: &Config,
        state: &mut State,
        now: Stamp,
        input: Input,
        out: &mut Outbox<Output>,
    ) {
        match input {
            Input::Timer(_) => {}
            Input::Trigger(trigger) => {
                let again = (state.last.as_ref()).is_some_and(|(session, number)| {
                    !session.is_empty()
                        && *session == trigger.session
                        && trigger.sequence <= *number
                });
                if again {
                    return;
                }
                state.last = Some((trigger.session.clone(), trigger.sequence));
                state.waiting.push_back(trigger);
                if state.waiting.len() > WAITING_LIMIT {
                    state.waiting.pop_front();
                    let text = "a trigger was dropped because its plan did not arrive";
                    out.fault(now, ProbeEventsFault::TriggerNotUsable, text);
                }
                take_waiting(config, state, now, out);
            }
            Input::Plan(plan) => {
                state.plan = Some(plan);
                take_waiting(config, state, now, out);
            }
        }
    }
}

fn take_waiting(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    let Some(plan) = state.plan.clone() else {
        return;
    };
    for trigger in std::mem::take(&mut state.waiting) {
        if trigger.plan_id == plan.plan_id {
            take(config, state, now, &plan, &trigger, out);
        } else {
            state.waiting.push_back(trigger);
        }
    }
}

fn take(
    config: &Config,
    state: &mut State,
    now: Stamp,
    plan: &InspectionPlan,
    trigger: &ProbeTrigger,
    out: &mut Outbox<Output>,
) {
    let unusable = |text: String, out: &mut Outbox<Output>| {
        out.fault(now, ProbeEventsFault::TriggerNotUsable, text);
    };
    let Some(nominal) = plan.points.get(trigger.point_index as usize) else {
        let text = format!(
            "point {} is not in plan {:?}",
            trigger.point_index, plan.plan_id
        );
        return unusable(text, out);
    };
    let positions = match config
        .chain
        .positions(&trigger.axis_names, &trigger.axis_positions)
    {
        Ok(positions) => positions,
        Err(error) => {
            return unusable(
                format!("trigger at point {}: {error}", trigger.point_index),
                out,
            );
        }
    };
    let part = match Nominal::from_plan(plan) {
        Ok(part) => part,
        Err(error) => return unusable(error.to_string(), out),
    };
    let outcome = outcome(state, now, trigger, out);
    let tip = config
        .chain
        .ball_in_part(&positions, &part.part_pose, &part.ball);
    out.send(Output::Event(ProbeEvent {
        header: Stamp::from(&trigger.header.stamp).header("part"),
        sequence: trigger.sequence,
        plan_id: plan.plan_id.clone(),
        point_index: trigger.point_index,
        outcome,
        axis_names: trigger.axis_names.clone(),
        axis_positions: trigger.axis_positions.clone(),
        tip: geometry_msgs::Point {
            x: tip.x,
            y: tip.y,
            z: tip.z,
        },
        approach: approach(nominal),
        feed: trigger.feed,
    }));
}

/// The approach opposes the outward normal, as in every measuring program.
fn approach(nominal: &InspectionPoint) -> geometry_msgs::Vector3 {
    let normal = &nominal.normal;
    geometry_msgs::Vector3 {
        x: -normal.x,
        y: -normal.y,
        z: -normal.z,
    }
}

fn outcome(state: &mut State, now: Stamp, trigger: &ProbeTrigger, out: &mut Outbox<Output>) -> u8 {
    if trigger.tripped_before {
        let text = format!(
            "the probe was tripped before the move to point {} began",
            trigger.point_index
        );
        out.fault(now, ProbeEventsFault::ProbeStuck, text);
        return ProbeEvent::OUTCOME_EARLY;
    }
    if trigger.tripped {
        state.misses = 0;
        return ProbeEvent::OUTCOME_TOUCHED;
    }
    state.misses += 1;
    let text = format!(
        "the move to point {} ended without contact",
        trigger.point_index
    );
    out.fault(now, ProbeEventsFault::NoContact, text);
    if state.misses == DEAD_AFTER {
        let text = format!(
            "{DEAD_AFTER} consecutive moves ended without contact: the probe does not trigger"
        );
        out.fault(now, ProbeEventsFault::ProbeDead, text);
    }
    ProbeEvent::OUTCOME_NO_CONTACT
}
