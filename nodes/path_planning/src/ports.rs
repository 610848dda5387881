//! What `path_planning` subscribes to and publishes.

use graph::{Stamp, topics};
use probecell_msgs::{
    InspectionPlan, MeasurementOrder, OperationReport, OperationRequest, OperatorReply,
    OperatorRequest, PlanProgress, ProbeEvent, sensor_msgs::JointState,
};

graph::ports! {
    "path_planning"
    inputs {
        /// An operator's request for a plan.
        Plan(OperatorRequest) = topics::PLAN_REQUESTS,
        /// The next operation of the cycle.
        Request(OperationRequest) = topics::OPERATION_REQUESTS,
        /// The result of an operation.
        Report(OperationReport) = topics::OPERATION_REPORTS,
        /// One probing move and its outcome: a point that was touched no longer remains.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// Where the axes are.
        Joints(JointState) = topics::JOINT_STATES,
    }
    outputs {
        /// What to measure.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// In which order, by which moves.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// How far an order has come.
        Progress(PlanProgress) = topics::PLAN_PROGRESS,
        /// The answer to an operator.
        Reply(OperatorReply) = topics::PLAN_REPLIES,
    }
    faults PlanningFault on topics::PATH_PLANNING_FAULTS {
        /// The part cannot be measured as planned: a point is out of reach, or no collision-free path leads to it.
        PlanImpossible = ERROR "plan_impossible",
        /// A measurement was requested of a plan that does not exist, or that cannot be resumed.
        PlanUnknown = ERROR "plan_unknown",
    }
}

/// A fault and its text.
pub(crate) type Failure = (PlanningFault, String);

/// The answer to an operator: what was planned, or why not.
pub(crate) fn reply(now: Stamp, request_id: u64, result: Result<String, String>) -> Output {
    Output::Reply(OperatorReply {
        header: now.header(""),
        request_id,
        accepted: result.is_ok(),
        text: result.unwrap_or_else(|reason| reason),
    })
}
