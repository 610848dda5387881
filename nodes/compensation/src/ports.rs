//! What `compensation` subscribes to, publishes, and reports as faults.

use graph::topics;
use probecell_msgs::{
    Correction, FeatureResult, InspectionPlan, OperationRequest, OperatorKeys, OperatorReply,
    OperatorRequest, PartAlignment, PartReport, PassDecision, ProbeEvent, ToolOffsets,
    TouchDeviation, Verdict,
};

graph::ports! {
    "compensation"
    inputs {
        /// A measured feature or width.
        Feature(FeatureResult) = topics::FEATURE_RESULTS,
        /// What the cycle does next, and which pass a plan belongs to.
        Request(OperationRequest) = topics::OPERATION_REQUESTS,
        /// Offsets in force in the controller.
        Offsets(ToolOffsets) = topics::TOOL_OFFSETS,
        /// An operator approves or rejects.
        Approval(OperatorRequest) = topics::APPROVALS,
        /// The end of a part: no correction proposed for it may reach the machine.
        Part(PartReport) = topics::PART_REPORTS,
        /// The plan of the measurement.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// A probing move, with the axis positions.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// The deviation of a touch, with its uncertainty.
        Deviation(TouchDeviation) = topics::TOUCH_DEVIATIONS,
        /// A feature as measured by an independent instrument.
        Reference(FeatureResult) = topics::REFERENCE_RESULTS,
        /// The alignment of the part.
        Alignment(PartAlignment) = topics::PART_ALIGNMENT,
        /// The operators' keys in force.
        Keys(OperatorKeys) = topics::OPERATOR_KEYS,
    }
    outputs {
        /// The verdict on one size, on the volumetric table or on the position of the part.
        Verdict(Verdict) = topics::VERDICTS,
        /// A correction, proposed or approved.
        Correction(Correction) = topics::CORRECTIONS,
        /// The decision that follows from the verdicts of a measurement.
        Decision(PassDecision) = topics::PASS_DECISIONS,
        /// The answer to an operator.
        Reply(OperatorReply) = topics::APPROVAL_REPLIES,
    }
    faults CompensationFault on topics::COMPENSATION_FAULTS {
        /// Nobody approved or rejected a proposed correction in time.
        ApprovalOverdue = ERROR "approval_overdue",
        /// An unsigned approval is accepted, because the cell file allows it.
        ApprovalUnsigned = WARNING "approval_unsigned",
    }
}
