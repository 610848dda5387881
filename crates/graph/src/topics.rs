//! The table of topics that nodes share: name, message, quality of service and the one producer of each.
//!
//! Names are relative to the cell's namespace. Subscribers are found from the inputs of the nodes ([`crate::Wiring`]). A
//! topic that no other node subscribes to can be declared by its node instead ([`crate::declare_topics!`]); [`of`] lists
//! both kinds. Contract topics keep the contract's names and QoS.

use crate::Instance;
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction, CorrectionAcknowledgement,
    Fault, FeatureResult, GapFinding, GapReport, GateHeartbeat, InspectionPlan, LossReport,
    MachineState, MeasurementOrder, Message, MessageType, OperationReport, OperationRequest,
    OperatorKeys, OperatorReply, OperatorRequest, OrderRequest, Orders, PartAlignment, PartReport,
    PartStatus, PassDecision, PlanProgress, ProbeEvent, ProbeTrigger, RecordingStatus,
    ReferenceMeasurement, StepJournal, ToolOffsets, TouchDeviation, Verdict,
    diagnostic_msgs::DiagnosticArray, sensor_msgs::JointState, std_msgs, tf2_msgs::TFMessage,
    visualization_msgs::MarkerArray,
};

/// Quality of service of a topic, in ROS 2 terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Reliable, or best effort.
    pub reliable: bool,
    /// Transient local: a late subscriber gets the last `depth` messages.
    pub transient_local: bool,
    /// Messages kept; `None` keeps all.
    pub depth: Option<u32>,
}

impl Qos {
    /// Reliable, volatile, keep last `depth`.
    pub const fn reliable(depth: u32) -> Self {
        Self {
            reliable: true,
            transient_local: false,
            depth: Some(depth),
        }
    }

    /// Reliable, transient local, keep last `depth`.
    pub const fn latched(depth: u32) -> Self {
        Self {
            reliable: true,
            transient_local: true,
            depth: Some(depth),
        }
    }

    /// Reliable, volatile, keep all.
    pub const KEEP_ALL: Self = Self {
        reliable: true,
        transient_local: false,
        depth: None,
    };
}

/// One topic of the cell.
#[derive(Clone, Copy, Debug)]
pub struct Topic {
    /// Name below the cell's namespace.
    pub name: &'static str,
    /// Its message.
    pub message: &'static MessageType,
    /// How it is delivered.
    pub qos: Qos,
    /// The one node (or `driver`, `signals`, `operator`, `recorder`, `instrument`) that publishes it.
    pub producer: &'static str,
}

/// Declares topics: `CONSTANT = "producer", "name", Message, quality of service;`. The table of this module is made of
/// it; a node outside the workspace declares its own topics in the same way.
#[macro_export]
macro_rules! declare_topics {
    ($($constant:ident = $producer:literal, $name:literal, $message:ty, $qos:expr;)*) => {
        $(
            #[doc = concat!("`", $name, "`, published by `", $producer, "`.")]
            pub const $constant: $crate::Topic = $crate::Topic {
                name: $name,
                message: <$message as probecell_msgs::Message>::TYPE,
                qos: $qos,
                producer: $producer,
            };
        )*
        /// Every topic declared here.
        pub const ALL: &[$crate::Topic] = &[$($constant),*];
    };
}

/// Prefix of the line of `cell_description`, a comment in TOML, that names the version of the program that the cell runs.
pub const PROGRAM_LINE: &str = "# program: probecell ";

/// The version of the program that a `cell_description` names: its first line is the key of the cell.
pub fn program(description: &str) -> Option<&str> {
    let mut lines = description.lines().take(2);
    lines.find_map(|line| line.strip_prefix(PROGRAM_LINE))
}

declare_topics! {
    CONTROLLER_STATUS = "driver", "controller_status", ControllerStatus, Qos::reliable(100);
    PROBE_TRIGGERS = "driver", "probe_triggers", ProbeTrigger, Qos::KEEP_ALL;
    CONTROLLER_REPLIES = "driver", "controller_replies", ControllerReply, Qos::KEEP_ALL;
    SIGNALS = "signals", "signals", DiagnosticArray, Qos::reliable(100);
    REFERENCE = "instrument", "reference", ReferenceMeasurement, Qos::latched(1);

    PLAN_REQUESTS = "operator", "plan_requests", OperatorRequest, Qos::KEEP_ALL;
    RUN_REQUESTS = "operator", "run_requests", OperatorRequest, Qos::KEEP_ALL;
    CELL_DESCRIPTION = "operator", "cell_description", std_msgs::String, Qos::latched(1);
    LAUNCHER_FAULTS = "operator", "launcher/faults", Fault, Qos::KEEP_ALL;
    STOP_REQUESTS = "operator", "stop_requests", OperatorRequest, Qos::KEEP_ALL;
    APPROVALS = "operator", "approvals", OperatorRequest, Qos::KEEP_ALL;
    ORDER_REQUESTS = "operator", "order_requests", OrderRequest, Qos::KEEP_ALL;
    KEPT_ORDERS = "operator", "kept_orders", Orders, Qos::latched(1);
    OPERATOR_KEYS = "operator", "operator_keys", OperatorKeys, Qos::latched(1);

    ROBOT_DESCRIPTION = "machine_state", "robot_description", std_msgs::String, Qos::latched(1);
    JOINT_STATES = "machine_state", "joint_states", JointState, Qos::reliable(10);
    JOINT_COMMANDS = "machine_state", "joint_commands", JointState, Qos::reliable(10);
    MACHINE_STATE = "machine_state", "machine_state", MachineState, Qos::reliable(10);
    TOOL_OFFSETS = "machine_state", "tool_offsets", ToolOffsets, Qos::latched(1);
    CONTROLLER_COMMANDS = "machine_state", "controller_commands", ControllerCommand, Qos::KEEP_ALL;
    OPERATION_REPORTS = "machine_state", "operation_reports", OperationReport, Qos::KEEP_ALL;
    CORRECTION_ACKNOWLEDGEMENTS = "machine_state", "correction_acknowledgements", CorrectionAcknowledgement, Qos::latched(64);
    GATE_HEARTBEAT = "machine_state", "gate_heartbeat", GateHeartbeat, Qos::reliable(10);
    SUPERVISED_PART = "machine_state", "supervised_part", PartStatus, Qos::latched(1);
    STOP_REPLIES = "machine_state", "stop_replies", OperatorReply, Qos::KEEP_ALL;
    MACHINE_STATE_FAULTS = "machine_state", "machine_state/faults", Fault, Qos::KEEP_ALL;

    PROBE_EVENTS = "probe_events", "probe_events", ProbeEvent, Qos::KEEP_ALL;
    PROBE_EVENTS_FAULTS = "probe_events", "probe_events/faults", Fault, Qos::KEEP_ALL;

    INSPECTION_PLAN = "path_planning", "inspection_plan", InspectionPlan, Qos::latched(1);
    MEASUREMENT_ORDER = "path_planning", "measurement_order", MeasurementOrder, Qos::latched(1);
    PLAN_PROGRESS = "path_planning", "plan_progress", PlanProgress, Qos::KEEP_ALL;
    PLAN_REPLIES = "path_planning", "plan_replies", OperatorReply, Qos::KEEP_ALL;
    PATH_PLANNING_FAULTS = "path_planning", "path_planning/faults", Fault, Qos::KEEP_ALL;

    TOUCH_DEVIATIONS = "analysis", "touch_deviations", TouchDeviation, Qos::KEEP_ALL;
    FEATURE_RESULTS = "analysis", "feature_results", FeatureResult, Qos::latched(64);
    REFERENCE_RESULTS = "analysis", "reference_results", FeatureResult, Qos::latched(64);
    PART_ALIGNMENT = "analysis", "part_alignment", PartAlignment, Qos::latched(1);
    ANALYSIS_FAULTS = "analysis", "analysis/faults", Fault, Qos::KEEP_ALL;

    VERDICTS = "compensation", "verdicts", Verdict, Qos::latched(64);
    CORRECTIONS = "compensation", "corrections", Correction, Qos::latched(64);
    PASS_DECISIONS = "compensation", "pass_decisions", PassDecision, Qos::latched(1);
    APPROVAL_REPLIES = "compensation", "approval_replies", OperatorReply, Qos::KEEP_ALL;
    COMPENSATION_FAULTS = "compensation", "compensation/faults", Fault, Qos::KEEP_ALL;

    OPERATION_REQUESTS = "cycle", "operation_requests", OperationRequest, Qos::KEEP_ALL;
    PART_STATUS = "cycle", "part_status", PartStatus, Qos::latched(1);
    PART_REPORTS = "cycle", "part_reports", PartReport, Qos::latched(1);
    RUN_REPLIES = "cycle", "run_replies", OperatorReply, Qos::KEEP_ALL;
    ORDERS = "cycle", "orders", Orders, Qos::latched(1);
    ORDER_REPLIES = "cycle", "order_replies", OperatorReply, Qos::KEEP_ALL;

    GAP_REPORT = "gap", "gap_report", GapReport, Qos::latched(1);
    GAP_FINDINGS = "gap", "gap_findings", GapFinding, Qos::latched(64);
    GAP_FAULTS = "gap", "gap/faults", Fault, Qos::KEEP_ALL;
    TF = "visualization", "tf", TFMessage, Qos::reliable(100);
    TF_STATIC = "visualization", "tf_static", TFMessage, Qos::latched(1);
    TOUCH_MARKERS = "visualization", "touch_markers", MarkerArray, Qos::latched(1);
    VISUALIZATION_FAULTS = "visualization", "visualization/faults", Fault, Qos::KEEP_ALL;

    RECORDING_STATUS = "recorder", "recording_status", RecordingStatus, Qos::latched(1);
    LOSS_REPORTS = "recorder", "loss_reports", LossReport, Qos::latched(64);
}

/// The topic of that name, if the cell has it.
pub fn by_name(name: &str) -> Option<Topic> {
    ALL.iter().copied().find(|topic| topic.name == name)
}

/// Every topic of a cell of these nodes: those of the table, then those that only a node declares.
pub fn of(nodes: &[Box<dyn Instance>]) -> Vec<Topic> {
    let declared = nodes.iter().flat_map(|node| node.outputs());
    let mut topics = ALL.to_vec();
    for topic in declared {
        if !topics.iter().any(|known| known.name == topic.name) {
            topics.push(*topic);
        }
    }
    topics
}

/// Name of the topic on which the process of `node` publishes its step journal.
pub fn journal_name(node: &str) -> String {
    format!("{node}/steps")
}

/// Absolute name, message and quality of service of the topic on which whatever is on the bus reports its health, as every ROS 2
/// system does. The launcher publishes that of the cell's processes; no node subscribes to it.
pub const DIAGNOSTICS: (&str, &MessageType, Qos) = (
    "/diagnostics",
    <DiagnosticArray as Message>::TYPE,
    Qos::reliable(10),
);

/// Message and quality of service of every journal topic.
pub const JOURNAL: (&MessageType, Qos) = (<StepJournal as Message>::TYPE, Qos::KEEP_ALL);
