//! What `cycle` subscribes to and publishes.

use graph::topics;
use probecell_msgs::{
    CorrectionAcknowledgement, Fault, OperationReport, OperationRequest, OperatorReply,
    OperatorRequest, OrderRequest, Orders, PartReport, PartStatus, PassDecision,
};

graph::ports! {
    "cycle"
    inputs {
        /// An operator requests a part, or a measurement.
        Run(OperatorRequest) = topics::RUN_REQUESTS,
        /// The outcome of an operation.
        Report(OperationReport) = topics::OPERATION_REPORTS,
        /// What follows from a measurement.
        Decision(PassDecision) = topics::PASS_DECISIONS,
        /// The part that is being made, as `machine_state` knows it.
        Supervised(PartStatus) = topics::SUPERVISED_PART,
        /// An operator stops the machine, and with it the part.
        Stop(OperatorRequest) = topics::STOP_REQUESTS,
        /// The outcome of a correction.
        Acknowledgement(CorrectionAcknowledgement) = topics::CORRECTION_ACKNOWLEDGEMENTS,
        /// Faults of `machine_state`.
        MachineFault(Fault) = topics::MACHINE_STATE_FAULTS,
        /// Faults of `probe_events`.
        ProbeFault(Fault) = topics::PROBE_EVENTS_FAULTS,
        /// Faults of `path_planning`.
        PlanningFault(Fault) = topics::PATH_PLANNING_FAULTS,
        /// Faults of `analysis`.
        AnalysisFault(Fault) = topics::ANALYSIS_FAULTS,
        /// Faults of processes, reported by the launcher.
        LauncherFault(Fault) = topics::LAUNCHER_FAULTS,
        /// An operator changes the orders.
        OrderRequest(OrderRequest) = topics::ORDER_REQUESTS,
        /// The orders that are on disk.
        KeptOrders(Orders) = topics::KEPT_ORDERS,
    }
    outputs {
        /// What the machine is to do next.
        Request(OperationRequest) = topics::OPERATION_REQUESTS,
        /// The part that is being made.
        Status(PartStatus) = topics::PART_STATUS,
        /// The end of a part.
        Part(PartReport) = topics::PART_REPORTS,
        /// The reply to an operator.
        Reply(OperatorReply) = topics::RUN_REPLIES,
        /// The orders.
        Orders(Orders) = topics::ORDERS,
        /// The reply to an operator who changes them.
        OrderReply(OperatorReply) = topics::ORDER_REPLIES,
    }
}
