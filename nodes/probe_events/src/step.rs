//! The rules of `probe_events`.

use std::collections::VecDeque;

use graph::{Node, Outbox, Stamp, inputs, outputs, topics};
use machine::Nominal;
use probecell_msgs::{
    Fault, InspectionPlan, InspectionPoint, ProbeEvent, ProbeTrigger, geometry_msgs, std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::config::Config;

inputs! {
    /// What `probe_events` hears.
    pub enum Input {
        /// The raw end of a probing move.
        Trigger(ProbeTrigger) = topics::PROBE_TRIGGERS,
        /// What is measured.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
    }
}

outputs! {
    /// What `probe_events` says.
    pub enum Output {
        /// One probing move and what came of it.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// What went wrong.
        Fault(Fault) = topics::PROBE_EVENTS_FAULTS,
    }
}

/// Triggers kept for a plan that has not come yet.
const WAITING_LIMIT: usize = 4096;
/// Moves in a row without contact after which the probe is called dead: one may be missing material.
const DEAD_AFTER: u32 = 2;

/// The memory of `probe_events`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Number of the next event.
    pub next_sequence: u64,
    /// The plan heard last.
    pub plan: Option<InspectionPlan>,
    /// Triggers whose plan has not come yet.
    pub waiting: VecDeque<ProbeTrigger>,
    /// Moves in a row that ended without contact.
    pub misses: u32,
}

/// The node.
pub struct ProbeEventsNode;

impl Node for ProbeEventsNode {
    const NAME: &'static str = "probe_events";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;

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
                state.waiting.push_back(trigger);
                if state.waiting.len() > WAITING_LIMIT {
                    state.waiting.pop_front();
                    fault(
                        now,
                        Fault::ERROR,
                        "trigger_not_usable",
                        "a trigger waited too long for its plan",
                        out,
                    );
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
        fault(now, Fault::ERROR, "trigger_not_usable", &text, out);
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
        header: std_msgs::Header {
            stamp: trigger.header.stamp,
            frame_id: "part".to_owned(),
        },
        sequence: state.next_sequence,
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
    state.next_sequence += 1;
}

/// The approach is against the outward normal: that is how measuring programs are made.
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
        fault(now, Fault::ERROR, "probe_stuck", &text, out);
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
    fault(now, Fault::WARNING, "no_contact", &text, out);
    if state.misses == DEAD_AFTER {
        let text = format!(
            "{DEAD_AFTER} moves in a row ended without contact: the probe does not trigger"
        );
        fault(now, Fault::ERROR, "probe_dead", &text, out);
    }
    ProbeEvent::OUTCOME_NO_CONTACT
}

fn fault(now: Stamp, severity: u8, code: &str, text: &str, out: &mut Outbox<Output>) {
    out.send(Output::Fault(Fault {
        header: std_msgs::Header {
            stamp: now.time(),
            frame_id: String::new(),
        },
        node: ProbeEventsNode::NAME.to_owned(),
        severity,
        code: code.to_owned(),
        text: text.to_owned(),
    }));
}
