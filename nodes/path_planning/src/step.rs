//! The rules of `path_planning`.

use graph::{Node, Outbox, Stamp, inputs, outputs, topics};
use probecell_msgs::{
    Fault, InspectionPlan, MeasurementOrder, OperationRequest, OperatorReply, OperatorRequest,
    std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::{
    config::Config,
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

/// `path_planning` remembers nothing: a plan is a function of the part and the pass.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {}

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
        _state: &mut State,
        now: Stamp,
        input: Input,
        out: &mut Outbox<Output>,
    ) {
        match input {
            Input::Timer(_) => {}
            Input::Request(request) => {
                if request.kind == OperationRequest::MEASURE {
                    let allowance = config
                        .allowances
                        .get(request.pass_number as usize)
                        .copied()
                        .unwrap_or(0.0);
                    if let Err(error) = publish(config, now, &request.plan_id, allowance, out) {
                        out.send(Output::Fault(Fault {
                            header: header(now),
                            node: Self::NAME.to_owned(),
                            severity: Fault::ERROR,
                            code: "plan_impossible".to_owned(),
                            text: error.to_string(),
                        }));
                    }
                }
            }
            Input::Plan(request) => {
                let plan_id = if request.subject.is_empty() {
                    "preview"
                } else {
                    &request.subject
                };
                let made = publish(config, now, plan_id, 0.0, out);
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

/// Publishes the plan and its order; gives a sentence about them.
fn publish(
    config: &Config,
    now: Stamp,
    plan_id: &str,
    allowance: f64,
    out: &mut Outbox<Output>,
) -> Result<String, RouteError> {
    let mut plan = config.part.plan(allowance);
    plan.header = std_msgs::Header {
        stamp: now.time(),
        frame_id: "workpiece".to_owned(),
    };
    plan_id.clone_into(&mut plan.plan_id);
    let route = Route {
        chain: &config.chain,
        clearance: config.clearance,
        overtravel: config.overtravel,
        kicks: config.kicks,
    };
    let all: Vec<u32> = (0..plan.points.len() as u32).collect();
    let mut order = route.order_of(&plan, &all, config.part.stages(), &[])?;
    order.header = plan.header.clone();
    let text = format!(
        "{} touches, {:.1} s between them ({:.1} s in the order given)",
        order.order.len(),
        order.air_time,
        order.given_air_time
    );
    out.send(Output::Plan(plan));
    out.send(Output::Order(order));
    Ok(text)
}

fn header(now: Stamp) -> std_msgs::Header {
    std_msgs::Header {
        stamp: now.time(),
        frame_id: String::new(),
    }
}
