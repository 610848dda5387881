//! The rules of `gap`.

use diagnosis::{Session, SessionError, onset::ChangeMonitor};
use effects::session::joined::join;
use graph::Stamp;
use probecell_msgs::{InspectionPlan, MachineState, PlanId, builtin_interfaces::Time};

use crate::{
    config::Config,
    message::{finding_message, report_message},
    ports::{GapFault, Input, Out, Output},
    state::State,
};

/// Events kept while their plan has not arrived.
const WAITING_LIMIT: usize = 65_536;
/// Name of the session in reports.
const LIVE: &str = "live";

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
    match input {
        Input::Timer(_) => {}
        Input::Machine(machine) => state.robot_description = machine.data,
        Input::Plan(plan) => begin(config, state, plan),
        Input::Order(order) => {
            let known = state.plan.as_ref();
            if known.is_some_and(|plan| plan.plan_id == order.plan_id) {
                state.open.extend(order.order);
            }
        }
        Input::Event(event) => {
            if state.waiting.keep(event, WAITING_LIMIT).is_some() {
                let text = "an event was dropped because its plan did not arrive";
                out.fault(now, GapFault::SessionNotUsable, text);
            }
        }
        Input::Joints(joints) => {
            state.joints.push(joints.header.stamp.nanos(), joints);
        }
        Input::State(machine) => {
            let at = machine.header.stamp.nanos();
            state
                .states
                .push_turning(at, machine, MachineState::drives_as);
        }
        Input::Corrected(_) => state.watch = ChangeMonitor::default(),
        Input::Reference(reference) => {
            let of_plan = state
                .plan
                .as_ref()
                .is_some_and(|plan| plan.plan_id == reference.plan_id);
            if of_plan && !state.references.contains(&reference) {
                state.references.push(reference);
                if config.at_end_of_plan && state.open.is_empty() {
                    state.due = last_touch(state);
                }
            }
        }
    }
    take_touches(config, state);
    let passed = |at: i64| state.joints.is_past(at) && state.states.is_past(at);
    if state.due.is_some_and(passed) {
        state.due = None;
        diagnose(config, state, now, out);
        watch(config, state, now, out);
    }
}

/// Begins a plan, unless it is the current one.
fn begin(config: &Config, state: &mut State, plan: InspectionPlan) {
    if state.plan.as_ref() == Some(&plan) {
        return;
    }
    let supplements = |known: &InspectionPlan| {
        let known = PlanId::from(&known.plan_id);
        let first = known
            .supplemented()
            .map_or_else(|| known.to_string(), str::to_owned);
        PlanId::from(&plan.plan_id).supplemented() == Some(&first)
    };
    let supplements = state.plan.as_ref().is_some_and(supplements);
    state.earlier = (supplements.then(|| session(config, state)).flatten()).and_then(Result::ok);
    state.open = (0..plan.points.len() as u32).collect();
    state.events.clear();
    state.references.clear();
    state.joints.begin();
    state.states.begin();
    state.due = None;
    state.plan = Some(plan);
}

/// Takes the touches of the plan, and sees when a diagnosis is due.
fn take_touches(config: &Config, state: &mut State) {
    let Some(plan) = &state.plan else {
        return;
    };
    for event in (state.waiting).release(|event| event.plan_id == plan.plan_id) {
        let at = event.header.stamp.nanos();
        state.joints.mark(at);
        state.states.mark(at);
        let completes = state.open.remove(&event.point_index) && state.open.is_empty();
        state.events.push(event);
        let count = state.events.len() as u32;
        let between = config
            .every_touches
            .is_some_and(|every| count.is_multiple_of(every));
        if between || (completes && config.at_end_of_plan) {
            state.due = last_touch(state);
        }
    }
}

/// Stamp of the latest event, ns.
fn last_touch(state: &State) -> Option<i64> {
    let stamps = state.events.iter().map(|event| event.header.stamp);
    stamps.map(Time::nanos).max()
}

/// The session of the plan, joined with the one that it supplements; `None` without a plan.
fn session(config: &Config, state: &State) -> Option<Result<Session, SessionError>> {
    let session = Session {
        name: LIVE.to_owned(),
        robot_description: state.robot_description.clone(),
        plan: Some(state.plan.clone()?),
        events: state.events.clone(),
        joint_states: state.joints.samples(),
        joint_commands: Vec::new(),
        machine_states: state.states.samples(),
        references: state.references.clone(),
        declared: config.declared.clone(),
    };
    let Some(earlier) = &state.earlier else {
        return Some(Ok(session));
    };
    Some(join(earlier, &session))
}

fn diagnose(config: &Config, state: &State, now: Stamp, out: &mut Out) {
    let (Some(plan), Some(session)) = (&state.plan, session(config, state)) else {
        return;
    };
    let header = now.header("");
    let report = session.and_then(|session| diagnosis::diagnose(&session, &config.options));
    match report {
        Ok(report) => {
            if let Some(message) = report_message(&report, &plan.plan_id, header) {
                out.send(Output::Report(message));
            }
        }
        Err(error) => {
            let text = format!("plan {:?}: {error}", plan.plan_id);
            out.fault(now, GapFault::SessionNotUsable, text);
        }
    }
}

/// Compares a part that is measured completely with those before it, once.
fn watch(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let plan_id = state.plan.as_ref().map(|plan| plan.plan_id.clone());
    let (Some(rate), Some(plan_id)) = (config.false_alarms, plan_id) else {
        return;
    };
    // A supplement is of the same part.
    if !state.open.is_empty() || state.earlier.is_some() {
        return;
    }
    let Some(Ok(session)) = session(config, state) else {
        return;
    };
    // A session that cannot be used has been reported by its diagnosis.
    if let Ok(Some(change)) = state.watch.part(&session, &config.options, rate) {
        let message = finding_message(&change, &plan_id, rate, now.header(""));
        out.send(Output::Finding(message));
    }
}
