//! The rules of `path_planning`.

use std::collections::BTreeSet;

use graph::{Node, Outbox, START, Stamp, inputs, outputs, topics};
use probecell_msgs::{
    Fault, InspectionPlan, MeasurementOrder, OperationReport, OperationRequest, OperatorReply,
    OperatorRequest, PlanProgress, ProbeEvent, sensor_msgs::JointState, std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::{
    again::{AgainError, Measurement},
    config::Config,
    further::{self, FurtherError},
    route::{Route, RouteError},
    task::{Planned, Task, Wanted},
    underway::{Purpose, Underway},
};

inputs! {
    /// What `path_planning` hears.
    pub enum Input {
        /// An operator wants to see the plan.
        Plan(OperatorRequest) = topics::PLAN_REQUESTS,
        /// What the cycle wants next.
        Request(OperationRequest) = topics::OPERATION_REQUESTS,
        /// What came of it.
        Report(OperationReport) = topics::OPERATION_REPORTS,
        /// One probing move and what came of it: what is touched is not left.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// Where the axes are.
        Joints(JointState) = topics::JOINT_STATES,
    }
}

outputs! {
    /// What `path_planning` says.
    pub enum Output {
        /// What to measure.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// In which order, by which moves.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// How far an order is.
        Progress(PlanProgress) = topics::PLAN_PROGRESS,
        /// The answer to an operator.
        Reply(OperatorReply) = topics::PLAN_REPLIES,
        /// What went wrong.
        Fault(Fault) = topics::PATH_PLANNING_FAULTS,
    }
}

/// The memory of `path_planning`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The pass that was cut or measured last: it tells how much is left on the surfaces.
    pub pass: Option<u32>,
    /// Further touches of the part as it is now, not measured yet, and their order.
    pub further: Option<(InspectionPlan, MeasurementOrder)>,
    /// Plans of this session's measurements.
    pub measured: BTreeSet<String>,
    /// The measurement that was asked for last; `None` once something is cut, or another plan is published.
    pub measurement: Option<Measurement>,
    /// The measurement that the machine makes now: number of its request, and its plan.
    pub running: Option<(u64, String)>,
    /// Where the axes stand, in the order of the chain's axes: m, rad.
    pub here: Option<Vec<f64>>,
    /// The order that is being made.
    pub underway: Option<Underway>,
    /// Orders begun so far: each has a timer of its own.
    pub begun: u32,
}

/// The node.
pub struct PathPlanningNode;

impl Node for PathPlanningNode {
    const NAME: &'static str = "path_planning";
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
            Input::Timer(number) => {
                let own = |underway: &mut Underway| underway.number == number;
                if let Some(underway) = state.underway.take_if(own) {
                    go_on(config, state, now, underway, out);
                }
            }
            Input::Event(event) => {
                if let Some(measurement) = &mut state.measurement {
                    measurement.take(&event);
                }
            }
            Input::Joints(joints) => {
                let positions = config.chain.positions(&joints.name, &joints.position);
                state.here = positions.ok().or(state.here.take());
            }
            Input::Report(report) => {
                state
                    .running
                    .take_if(|(request_id, _)| *request_id == report.request_id);
                let of_it = |underway: &Underway| underway.is_for(report.request_id);
                give_up(state, now, of_it, "its measurement has ended", out);
            }
            Input::Request(request) => {
                // What the machine did before is over, or the cycle gives it up.
                state.running = (request.kind == OperationRequest::MEASURE)
                    .then(|| (request.request_id, request.plan_id.clone()));
                let ended = |underway: &Underway| underway.is_ended_by(&request);
                give_up(state, now, ended, "the cell goes on with its part", out);
                if let Err(error) = requested(config, state, now, &request, out) {
                    state.running = None;
                    fault(now, error, out);
                }
            }
            Input::Plan(request) => {
                if let Err(error) = asked(config, state, now, &request, out) {
                    reply(now, request.request_id, Err(error.to_string()), out);
                }
            }
        }
    }
}

/// Code and text of a fault.
type Failure = (&'static str, String);

/// Begins to make an order: each stretch is a step of its own.
fn begin(state: &mut State, now: Stamp, task: Task, purpose: Purpose, out: &mut Outbox<Output>) {
    state.begun = state.begun.wrapping_add(1).max(START + 1);
    out.wake_at(now, state.begun);
    state.underway = Some(Underway {
        number: state.begun,
        task,
        purpose,
    });
}

/// One stretch of the work.
fn go_on(
    config: &Config,
    state: &mut State,
    now: Stamp,
    mut underway: Underway,
    out: &mut Outbox<Output>,
) {
    let made = underway.task.go_on(&route(config));
    let mut progress = underway.task.progress();
    progress.header = header(now);
    let purpose = match made {
        Ok(None) => {
            out.send(Output::Progress(progress));
            out.wake_at(now, underway.number);
            state.underway = Some(underway);
            return;
        }
        Ok(Some(planned)) => {
            progress.phase = PlanProgress::DONE;
            progress.air_time = planned.order.air_time;
            progress.given_air_time = planned.order.given_air_time;
            out.send(Output::Progress(progress));
            return made_for(config, state, now, underway.purpose, planned, out);
        }
        Err(error) => {
            progress.phase = PlanProgress::GIVEN_UP;
            out.send(Output::Progress(progress));
            (underway.purpose, error.to_string())
        }
    };
    match purpose {
        (Purpose::Measurement(_), text) => {
            state.running = None;
            fault(now, ("plan_impossible", text), out);
        }
        (Purpose::Rest(_), text) => {
            state.running = None;
            fault(now, ("plan_unknown", text), out);
        }
        (of_operator, text) => {
            let request_id = of_operator.of_operator().unwrap_or_default();
            reply(now, request_id, Err(text), out);
        }
    }
}

/// Ends work that is void, and tells who waits for it.
fn give_up(
    state: &mut State,
    now: Stamp,
    void: impl Fn(&Underway) -> bool,
    reason: &str,
    out: &mut Outbox<Output>,
) {
    let Some(underway) = state.underway.take_if(|underway| void(underway)) else {
        return;
    };
    out.send(Output::Progress(PlanProgress {
        header: header(now),
        phase: PlanProgress::GIVEN_UP,
        ..underway.task.progress()
    }));
    if let Some(request_id) = underway.purpose.of_operator() {
        let plan = &underway.task.plan().plan_id;
        let text = format!("plan {plan:?} is not made: {reason}");
        reply(now, request_id, Err(text), out);
    }
}

/// What an order that is made was made for.
fn made_for(
    config: &Config,
    state: &mut State,
    now: Stamp,
    purpose: Purpose,
    Planned {
        mut plan,
        mut order,
    }: Planned,
    out: &mut Outbox<Output>,
) {
    plan.header.stamp = now.time();
    order.header = plan.header.clone();
    let told = Ok(described(&order));
    match purpose {
        Purpose::Measurement(_) => {
            state.measured.insert(plan.plan_id.clone());
            let stages = config.part.stages();
            state.measurement = Some(Measurement::new(plan.clone(), stages, false));
            out.send(Output::Plan(plan));
            out.send(Output::Order(order));
        }
        // The plan stands: only what is left of it is touched.
        Purpose::Rest(_) => out.send(Output::Order(order)),
        Purpose::Preview(request_id) => {
            out.send(Output::Plan(plan));
            out.send(Output::Order(order));
            // Who hears the touches has the plan that was published last.
            state.measurement = None;
            reply(now, request_id, told, out);
        }
        Purpose::Again(request_id, points) => {
            let wanted = state.measurement.as_mut().map(|one| one.want(&points));
            let told = match wanted {
                Some(Err(error)) => Err(error.to_string()),
                _ => told,
            };
            reply(now, request_id, told, out);
        }
        Purpose::Further(request_id) => {
            state.further = Some((plan, order));
            reply(now, request_id, told, out);
        }
    }
}

/// What the cycle wants: plans for its measurements; the error is code and text of a fault.
fn requested(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: &OperationRequest,
    out: &mut Outbox<Output>,
) -> Result<(), Failure> {
    let of_plan = |one: &&Measurement| {
        one.plan.plan_id == request.plan_id && one.only_measure == request.only_measure
    };
    match request.kind {
        OperationRequest::MEASURE
            if let Some(measurement) = state.measurement.as_ref().filter(of_plan) =>
        {
            let task = measurement.begin(&route(config), state.here.as_deref());
            let task = task.map_err(|error| ("plan_unknown", error.to_string()))?;
            begin(state, now, task, Purpose::Rest(request.request_id), out);
        }
        OperationRequest::MEASURE if state.measured.contains(&request.plan_id) => {
            let error = AgainError::Over(request.plan_id.clone());
            return Err(("plan_unknown", error.to_string()));
        }
        OperationRequest::MEASURE if request.only_measure => {
            let further = state.further.take();
            let Some((mut plan, mut order)) =
                further.filter(|(plan, _)| plan.plan_id == request.plan_id)
            else {
                let text = format!(
                    "plan {:?} was not accepted for the part as it is now, or it was measured already",
                    request.plan_id
                );
                return Err(("plan_unknown", text));
            };
            plan.header.stamp = now.time();
            order.header = plan.header.clone();
            state.measured.insert(plan.plan_id.clone());
            state.measurement = Some(Measurement::new(plan.clone(), &[], true));
            out.send(Output::Plan(plan));
            out.send(Output::Order(order));
        }
        OperationRequest::MEASURE => {
            state.pass = Some(request.pass_number);
            let allowance = allowance(config, request.pass_number);
            let task = whole(config, now, &request.plan_id, allowance);
            let task = task.map_err(|error| ("plan_impossible", error.to_string()))?;
            let purpose = Purpose::Measurement(request.request_id);
            begin(state, now, task, purpose, out);
        }
        OperationRequest::CUT => {
            // What was planned was planned for the surfaces before, and what was measured of them is over.
            state.further = None;
            state.measurement = None;
            state.pass = Some(request.pass_number);
        }
        _ => {}
    }
    Ok(())
}

/// m; what a pass leaves on the sizes.
fn allowance(config: &Config, pass: u32) -> f64 {
    let known = config.allowances.get(pass as usize);
    known.copied().unwrap_or(0.0)
}

/// What is not planned.
#[derive(Debug, thiserror::Error)]
enum AskError {
    #[error(transparent)]
    Again(#[from] AgainError),
    #[error(transparent)]
    Further(#[from] FurtherError),
    #[error(transparent)]
    Route(#[from] RouteError),
    #[error(
        "plan {0:?} is being measured: a preview would take its place; ask again when that is done"
    )]
    Measuring(String),
    #[error("plan {0:?} is being made: ask again when that is done")]
    Planning(String),
}

/// What an operator wants: what is left of a measurement, a preview of the part's plan, or further touches for a run
/// that only measures. The answer comes when the order is made.
fn asked(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: &OperatorRequest,
    out: &mut Outbox<Output>,
) -> Result<(), AskError> {
    let subject = &request.subject;
    if let Some(underway) = &state.underway {
        return Err(AskError::Planning(underway.task.plan().plan_id.clone()));
    }
    if let Some(measurement) = &state.measurement
        && measurement.plan.plan_id == *subject
    {
        let mut wanted = measurement.clone();
        wanted.want(&request.points)?;
        let task = wanted.begin(&route(config), state.here.as_deref())?;
        let purpose = Purpose::Again(request.request_id, request.points.clone());
        begin(state, now, task, purpose, out);
        return Ok(());
    }
    if state.measured.contains(subject) {
        return Err(AgainError::Over(subject.clone()).into());
    }
    if request.points.is_empty() {
        let plan_id = if subject.is_empty() {
            "preview"
        } else {
            subject
        };
        if let Some((_, measured)) = &state.running {
            return Err(AskError::Measuring(measured.clone()));
        }
        let task = whole(config, now, plan_id, 0.0)?;
        begin(state, now, task, Purpose::Preview(request.request_id), out);
        return Ok(());
    }
    if subject.is_empty() {
        return Err(FurtherError::Name.into());
    }
    // Where nothing was cut yet, the part is taken to be as the last pass leaves it.
    let last = config.allowances.last().copied().unwrap_or(0.0);
    let left = state.pass.map_or(last, |pass| allowance(config, pass));
    let own = named(config.part.plan(left), subject, now);
    let plan = InspectionPlan {
        points: request.points.clone(),
        ..own.clone()
    };
    let task = further::begin(&route(config), (&own, config.part.poses()), &plan)?;
    begin(state, now, task, Purpose::Further(request.request_id), out);
    Ok(())
}

fn route(config: &Config) -> Route<'_> {
    Route {
        chain: &config.chain,
        clearance: config.clearance,
        overtravel: config.overtravel,
        kicks: config.kicks,
    }
}

/// The plan under a name, made now.
fn named(plan: InspectionPlan, plan_id: &str, now: Stamp) -> InspectionPlan {
    InspectionPlan {
        header: std_msgs::Header {
            stamp: now.time(),
            frame_id: "workpiece".to_owned(),
        },
        plan_id: plan_id.to_owned(),
        ..plan
    }
}

/// Begins to order the part's own plan, with an allowance (m) left on its sizes.
fn whole(config: &Config, now: Stamp, plan_id: &str, allowance: f64) -> Result<Task, RouteError> {
    let plan = named(config.part.plan(allowance), plan_id, now);
    let all: Vec<u32> = (0..plan.points.len() as u32).collect();
    let wanted = Wanted {
        plan: &plan,
        points: &all,
        stages: config.part.stages(),
        poses: config.part.poses(),
        seeds: &[],
        here: None,
    };
    Task::new(&route(config), &wanted)
}

fn described(order: &MeasurementOrder) -> String {
    format!(
        "{} touches, {:.1} s between them ({:.1} s in the order given)",
        order.order.len(),
        order.air_time,
        order.given_air_time
    )
}

fn fault(now: Stamp, (code, text): Failure, out: &mut Outbox<Output>) {
    out.send(Output::Fault(Fault {
        header: header(now),
        node: PathPlanningNode::NAME.to_owned(),
        severity: Fault::ERROR,
        code: code.to_owned(),
        text,
    }));
}

/// The answer to an operator: what was made, or why not.
fn reply(now: Stamp, request_id: u64, made: Result<String, String>, out: &mut Outbox<Output>) {
    out.send(Output::Reply(OperatorReply {
        header: header(now),
        request_id,
        accepted: made.is_ok(),
        text: made.unwrap_or_else(|reason| reason),
    }));
}

fn header(now: Stamp) -> std_msgs::Header {
    std_msgs::Header {
        stamp: now.time(),
        frame_id: String::new(),
    }
}
