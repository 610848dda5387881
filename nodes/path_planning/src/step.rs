//! The rules of `path_planning`.

use std::collections::BTreeSet;

use graph::{Node, Outbox, Stamp, inputs, outputs, topics};
use probecell_msgs::{
    Fault, InspectionPlan, MeasurementOrder, OperationRequest, OperatorReply, OperatorRequest,
    std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::{
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
            Input::Request(request) => {
                if let Err((code, text)) = requested(config, state, now, &request, out) {
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
    match request.kind {
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
            out.send(Output::Plan(plan));
            out.send(Output::Order(order));
        }
        OperationRequest::MEASURE => {
            state.pass = Some(request.pass_number);
            state.measured.insert(request.plan_id.clone());
            let allowance = allowance(config, request.pass_number);
            publish(config, now, &request.plan_id, allowance, out)
                .map_err(|error| ("plan_impossible", error.to_string()))?;
        }
        OperationRequest::CUT => {
            // What was planned was planned for the surfaces before.
            state.further = None;
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

/// What an operator wants: a preview of the part's plan, or further touches for a run that only measures.
fn asked(
    config: &Config,
    state: &mut State,
    now: Stamp,
    request: &OperatorRequest,
    out: &mut Outbox<Output>,
) -> Result<String, FurtherError> {
    if request.points.is_empty() {
        let plan_id = if request.subject.is_empty() {
            "preview"
        } else {
            &request.subject
        };
        return Ok(publish(config, now, plan_id, 0.0, out)?);
    }
    if request.subject.is_empty() || state.measured.contains(&request.subject) {
        return Err(FurtherError::Name);
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

/// Publishes the plan and its order; gives a sentence about them.
fn publish(
    config: &Config,
    now: Stamp,
    plan_id: &str,
    allowance: f64,
    out: &mut Outbox<Output>,
) -> Result<String, RouteError> {
    let plan = named(config.part.plan(allowance), plan_id, now);
    let all: Vec<u32> = (0..plan.points.len() as u32).collect();
    let mut order = route(config).order_of(&plan, &all, config.part.stages(), &[])?;
    order.header = plan.header.clone();
    let text = described(&order);
    out.send(Output::Plan(plan));
    out.send(Output::Order(order));
    Ok(text)
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
