//! What `gap` subscribes to, publishes, and reports as faults.

use graph::topics;
use probecell_msgs::{
    CorrectionAcknowledgement, GapFinding, GapReport, InspectionPlan, MachineState,
    MeasurementOrder, ProbeEvent, ReferenceMeasurement, sensor_msgs::JointState, std_msgs,
};

graph::ports! {
    "gap"
    inputs {
        /// The robot description, URDF.
        Machine(std_msgs::String) = topics::ROBOT_DESCRIPTION,
        /// The inspection plan.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// The points of the plan that are touched now, for the first time or again.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// A probing move and its outcome.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// Positions of the axes.
        Joints(JointState) = topics::JOINT_STATES,
        /// Temperatures.
        State(MachineState) = topics::MACHINE_STATE,
        /// The same points as measured by an independent instrument.
        Reference(ReferenceMeasurement) = topics::REFERENCE,
        /// What was corrected: parts before and after it are not alike.
        Corrected(CorrectionAcknowledgement) = topics::CORRECTION_ACKNOWLEDGEMENTS,
    }
    outputs {
        /// Why the session differs from its model.
        Report(GapReport) = topics::GAP_REPORT,
        /// The gap has changed while parts are made.
        Finding(GapFinding) = topics::GAP_FINDINGS,
    }
    faults GapFault on topics::GAP_FAULTS {
        /// A measurement that cannot be diagnosed.
        SessionNotUsable = WARNING "session_not_usable",
    }
}
