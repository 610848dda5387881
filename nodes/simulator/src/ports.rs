//! What the simulated machine subscribes to and publishes: the topics of a driver.

use graph::topics;
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, GateHeartbeat, InspectionPlan,
    MeasurementOrder, ProbeTrigger, ReferenceMeasurement,
};

graph::ports! {
    "simulator"
    inputs {
        /// A command.
        Command(ControllerCommand) = topics::CONTROLLER_COMMANDS,
        /// A sign of life of the gate.
        Heartbeat(GateHeartbeat) = topics::GATE_HEARTBEAT,
        /// The inspection plan.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// The measuring order, with its moves.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
    }
    outputs {
        /// A raw sample.
        Status(ControllerStatus) = topics::CONTROLLER_STATUS,
        /// The raw end of a probing move.
        Trigger(ProbeTrigger) = topics::PROBE_TRIGGERS,
        /// The outcome of a command.
        Reply(ControllerReply) = topics::CONTROLLER_REPLIES,
        /// The same points by the reference instrument.
        Reference(ReferenceMeasurement) = topics::REFERENCE,
    }
}
