//! The rules of `path_planning`.

use std::collections::BTreeSet;

use graph::{Node, Outbox, Stamp, inputs, outputs, topics};
use probecell_msgs::{
    Fault, InspectionPlan, MeasurementOrder, OperationReport, OperationRequest, OperatorReply,
    OperatorRequest, ProbeEvent, sensor_msgs::JointState, std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::{
    again::{AgainError, Measurement},
    config::Config,
    further::{self, FurtherError},
    route::{Route, RouteError},
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
            Input::Timer(_) => {}
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
            }
            Input::Request(request) => {
                // What the machine did before is over, or the cycle gives it up.
                state.running = (request.kind == OperationRequest::MEASURE)
                    .then(|| (request.request_id, request.plan_id.clone()));
                if let Err((code, text)) = requested(config, state, now, &request, out) {
                    state.running = None;
                    out.send(Output::Fault(Fault {
                        header: header(now),
                        node: Self::NAME.to_owned(),
                        severity: Fault::ERROR,
                        code: code.to_owned(),
                        text,
                    }));
                }
            }
            Input::Plan(request) => {
                let made = asked(config, state, now, &request, out);
                out.send(Output::Reply(OperatorReply {
                    header: header(now),
                    request_id: request.request_id,
                    accepted: made.is_ok(),
                    text: made.unwrap_or_else(|error| error.to_string()),
                }));
            }
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
) -> Result<(), (&'static str, String)> {
    let of_plan = |one: &&Measurement| {
        one.plan.plan_id == request.plan_id && one.only_measure == request.only_measure
    };
    match request.kind {
        OperationRequest::MEASURE
            if let Some(measurement) = state.measurement.as_ref().filter(of_plan) =>
        {
            // The plan stands: only what is left of it is touched.
            let order = measurement.order(&route(config), state.here.as_deref());
            let mut order = order.map_err(|error| ("plan_unknown", error.to_string()))?;
            order.header = header(now);
            "workpiece".clone_into(&mut order.header.frame_id);
            out.send(Output::Order(order));
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
            state.measured.insert(request.plan_id.clone());
            let allowance = allowance(config, request.pass_number);
            let published = publish(config, now, &request.plan_id, allowance, out);
            let (plan, _) = published.map_err(|error| ("plan_impossible", error.to_string()))?;
            state.measurement = Some(Measurement::new(plan, config.part.stages(), false));
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
}

/// What an operator wants: what is left of a measurement, a preview of the part's plan, or further touches for a run
/// that only measures.
fn asked(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: &OperatorRequest,
    out: &mut Outbox<Output>,
) -> Result<String, AskError> {
    let subject = &request.subject;
    if let Some(measurement) = &mut state.measurement
        && measurement.plan.plan_id == *subject
    {
        measurement.want(&request.points)?;
        let order = measurement.order(&route(config), state.here.as_deref())?;
        return Ok(described(&order));
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
        let (_, text) = publish(config, now, plan_id, 0.0, out)?;
        // Who hears the touches has the plan that was published last.
        state.measurement = None;
        return Ok(text);
    }
    if subject.is_empty() {
        return Err(FurtherError::Name.into());
    }
    // Where nothing was cut yet, the part is taken to be as the last pass leaves it.
    let last = config.allowances.last().copied().unwrap_or(0.0);
    let left = state.pass.map_or(last, |pass| allowance(config, pass));
    let own = named(config.part.plan(left), &request.subject, now);
    let plan = InspectionPlan {
        points: request.points.clone(),
        ..own.clone()
    };
    let order = further::plan(&route(config), &own, &plan)?;
    let text = described(&order);
    state.further = Some((plan, order));
    Ok(text)
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

/// Publishes the plan and its order; gives the plan and a sentence about them.
fn publish(
    config: &Config,
    now: Stamp,
    plan_id: &str,
    allowance: f64,
    out: &mut Outbox<Output>,
) -> Result<(InspectionPlan, String), RouteError> {
    let plan = named(config.part.plan(allowance), plan_id, now);
    let all: Vec<u32> = (0..plan.points.len() as u32).collect();
    let mut order = route(config).order_of(&plan, &all, config.part.stages(), &[])?;
    order.header = plan.header.clone();
    let text = described(&order);
    out.send(Output::Plan(plan.clone()));
    out.send(Output::Order(order));
    Ok((plan, text))
}

fn described(order: &MeasurementOrder) -> String {
    format!(
        "{} touches, {:.1} s between them ({:.1} s in the order given)",
        order.order.len(),
        order.air_time,
        order.given_air_time
    )
}

fn header(now: Stamp) -> std_msgs::Header {
    std_msgs::Header {
        stamp: now.time(),
        frame_id: String::new(),
    }
}
