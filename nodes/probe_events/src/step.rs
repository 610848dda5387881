//! The rules of `probe_events`.

use graph::Stamp;
use machine::Nominal;
use probecell_msgs::{InspectionPlan, InspectionPoint, ProbeEvent, ProbeTrigger, geometry_msgs};

use crate::{
    config::Config,
    ports::{Input, Out, Output, ProbeEventsFault},
    state::State,
};

/// Triggers kept while their plan has not arrived.
const WAITING_LIMIT: usize = 4096;
/// Consecutive moves without contact after which the probe is considered dead: a single one may be missing material.
const DEAD_AFTER: u32 = 2;

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
    match input {
        Input::Timer(_) => {}
        Input::Trigger(trigger) => {
            let again = (state.last.as_ref()).is_some_and(|(session, number)| {
                !session.is_empty() && *session == trigger.session && trigger.sequence <= *number
            });
            if again {
                return;
            }
            state.last = Some((trigger.session.clone(), trigger.sequence));
            if state.waiting.keep(trigger, WAITING_LIMIT).is_some() {
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

fn take_waiting(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let Some(plan) = state.plan.clone() else {
        return;
    };
    for trigger in (state.waiting).release(|trigger| trigger.plan_id == plan.plan_id) {
        take(config, state, now, &plan, &trigger, out);
    }
}

fn take(
    config: &Config,
    state: &mut State,
    now: Stamp,
    plan: &InspectionPlan,
    trigger: &ProbeTrigger,
    out: &mut Out,
) {
    let unusable = |text: String, out: &mut Out| {
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

fn outcome(state: &mut State, now: Stamp, trigger: &ProbeTrigger, out: &mut Out) -> u8 {
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
