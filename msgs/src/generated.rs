// Generated from msg/, srv/, action/ and standard/ by `cargo run -p xtask -- codegen`. Edit those, not this.

use crate::schema::{MessageType, ServiceType};

use serde::{Deserialize, Serialize};

/// A command to the driver. Only machine_state publishes it, after all its checks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControllerCommand {
    pub header: crate::std_msgs::Header,
    /// session of the driver that it is addressed to
    pub session: String,
    /// counts from the start of machine_state (ns since 1970), without gaps
    pub command_id: u64,
    /// one of the constants above
    pub kind: u8,
    /// id of the operation to run
    pub operation: String,
    /// plan to measure
    pub plan_id: String,
    /// order in which to touch the plan's points
    pub order: Vec<u32>,
    pub tool_number: u32,
    /// joint whose work offset is set
    pub axis: String,
    /// m or rad, absolute new value of an offset
    pub value: f64,
    /// id of the feature whose path is offset
    pub feature: String,
    /// m, absolute offset along the outward normal at each point of the feature, in plan order
    pub path: Vec<f64>,
    /// the Correction that it carries out; empty for a motion
    pub correction_id: String,
    /// SET_VOLUMETRIC: ISO 230-1 name of each entry of the table
    pub entries: Vec<String>,
    /// m or rad, absolute new value of each entry
    pub values: Vec<f64>,
    /// RUN_OPERATION, RUN_MEASUREMENT: the run of the part that it belongs to
    pub run_id: String,
}

impl ControllerCommand {
    /// cut: run the program of an operation
    pub const RUN_OPERATION: u8 = 0;
    /// probe: run the measuring program of a plan in the order given
    pub const RUN_MEASUREMENT: u8 = 1;
    /// write value to the wear offset of tool_number
    pub const SET_TOOL_WEAR: u8 = 2;
    /// write value to the work offset of axis
    pub const SET_WORK_OFFSET: u8 = 3;
    /// feed hold and abort
    pub const STOP: u8 = 4;
    /// offset the tool path that cuts feature by path
    pub const SET_TOOL_PATH: u8 = 5;
    /// write values to the volumetric table, all at once, and enable it
    pub const SET_VOLUMETRIC: u8 = 6;
}

crate::code::codes! {
    /// Values of `ControllerCommand.kind`.
    pub enum ControllerCommandKind of "ControllerCommand.kind" {
        /// cut: run the program of an operation
        RunOperation = 0,
        /// probe: run the measuring program of a plan in the order given
        RunMeasurement = 1,
        /// write value to the wear offset of tool_number
        SetToolWear = 2,
        /// write value to the work offset of axis
        SetWorkOffset = 3,
        /// feed hold and abort
        Stop = 4,
        /// offset the tool path that cuts feature by path
        SetToolPath = 5,
        /// write values to the volumetric table, all at once, and enable it
        SetVolumetric = 6,
    }
}

crate::schema::message! {
    ControllerCommand: "probecell_msgs", "msg", "ControllerCommand",
    "RIHS01_727999f5d5171d9f26aad1f5299b5273b112505b4a8ea94806afe79e8228e0ee",
    concat!(
        include_str!("../msg/ControllerCommand.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["session", 17, 0, 0, "", ""]
    ["command_id", 9, 0, 0, "", ""]
    ["kind", 3, 0, 0, "", ""]
    ["operation", 17, 0, 0, "", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["order", 151, 0, 0, "", ""]
    ["tool_number", 7, 0, 0, "", ""]
    ["axis", 17, 0, 0, "", ""]
    ["value", 11, 0, 0, "", ""]
    ["feature", 17, 0, 0, "", ""]
    ["path", 155, 0, 0, "", ""]
    ["correction_id", 17, 0, 0, "", ""]
    ["entries", 161, 0, 0, "", ""]
    ["values", 155, 0, 0, "", ""]
    ["run_id", 17, 0, 0, "", ""]
}

/// The outcome of a ControllerCommand.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControllerReply {
    pub header: crate::std_msgs::Header,
    pub session: String,
    pub command_id: u64,
    /// one of the constants above
    pub outcome: u8,
    /// m or rad, offset read before it was written
    pub value_before: f64,
    /// m or rad, offset read back after it was written
    pub value: f64,
    /// reason for REFUSED or FAILED; of a fault `code: sentence`, with a code of machine_state
    pub text: String,
    /// m or rad, entries of the volumetric table read before they were written, in the command's order
    pub values_before: Vec<f64>,
    /// m or rad, the same read back after they were written
    pub values: Vec<f64>,
}

impl ControllerReply {
    pub const DONE: u8 = 0;
    pub const REFUSED: u8 = 1;
    pub const FAILED: u8 = 2;
}

crate::code::codes! {
    /// Values of `ControllerReply.outcome`.
    pub enum ControllerReplyOutcome of "ControllerReply.outcome" {
        /// `DONE`.
        Done = 0,
        /// `REFUSED`.
        Refused = 1,
        /// `FAILED`.
        Failed = 2,
    }
}

crate::schema::message! {
    ControllerReply: "probecell_msgs", "msg", "ControllerReply",
    "RIHS01_8865f5da80564a406cdfb04605c7c9d0336cd0ecd68deec9c1fcd90aca4d85d6",
    concat!(
        include_str!("../msg/ControllerReply.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["session", 17, 0, 0, "", ""]
    ["command_id", 9, 0, 0, "", ""]
    ["outcome", 3, 0, 0, "", ""]
    ["value_before", 11, 0, 0, "", ""]
    ["value", 11, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
    ["values_before", 155, 0, 0, "", ""]
    ["values", 155, 0, 0, "", ""]
}

/// One raw sample of a controller, as its driver read it. Only machine_state subscribes to it; all others subscribe to
/// joint_states and machine_state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControllerStatus {
    /// stamp: instant of the sample
    pub header: crate::std_msgs::Header,
    /// session of the driver, from its start to its end; a command for another session is refused
    pub session: String,
    /// MachineState.MODE_*
    pub mode: u8,
    /// MachineState.EXECUTION_*
    pub execution: u8,
    /// name of the program that is open
    pub program: String,
    /// line of that program
    pub line: u32,
    /// tool in the spindle
    pub tool_number: u32,
    /// 1.0 = 100 %
    pub feed_override: f64,
    /// rad/s
    pub spindle_speed: f64,
    /// joints of the machine model
    pub axis_names: Vec<String>,
    /// m or rad, readings
    pub axis_positions: Vec<f64>,
    /// m or rad, commanded positions; empty where the controller does not report them
    pub axis_commands: Vec<f64>,
    /// m/s or rad/s; empty where the controller does not report them
    pub axis_velocities: Vec<f64>,
    /// N or N m, at the joint; empty where the controller does not report them
    pub axis_efforts: Vec<f64>,
    /// level of the probe input
    pub probe_tripped: bool,
    pub temperature_names: Vec<String>,
    /// degree Celsius
    pub temperatures: Vec<f64>,
    /// texts of the active alarms
    pub alarms: Vec<String>,
    /// tools that the wear below belongs to
    pub tool_numbers: Vec<u32>,
    /// m, wear offset of each tool, as the controller holds it (a diameter or a radius)
    pub tool_wear: Vec<f64>,
    /// ISO 230-1 names (EX0C) of the entries of the volumetric table; empty: it has no such table
    pub volumetric_entries: Vec<String>,
    /// m or rad, value in force of each entry: 0 while the table is disabled
    pub volumetric_values: Vec<f64>,
    /// linear joints whose work offset the controller reports
    pub work_offset_axes: Vec<String>,
    /// m, work offset in force of each: the position of programme zero
    pub work_offsets: Vec<f64>,
}

crate::schema::message! {
    ControllerStatus: "probecell_msgs", "msg", "ControllerStatus",
    "RIHS01_7c0f83e31178ef7d861bc897dc232e1c4426bd9ee0f6723fe662cbf5fa617109",
    concat!(
        include_str!("../msg/ControllerStatus.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["session", 17, 0, 0, "", ""]
    ["mode", 3, 0, 0, "", ""]
    ["execution", 3, 0, 0, "", ""]
    ["program", 17, 0, 0, "", ""]
    ["line", 7, 0, 0, "", ""]
    ["tool_number", 7, 0, 0, "", ""]
    ["feed_override", 11, 0, 0, "", ""]
    ["spindle_speed", 11, 0, 0, "", ""]
    ["axis_names", 161, 0, 0, "", ""]
    ["axis_positions", 155, 0, 0, "", ""]
    ["axis_commands", 155, 0, 0, "", ""]
    ["axis_velocities", 155, 0, 0, "", ""]
    ["axis_efforts", 155, 0, 0, "", ""]
    ["probe_tripped", 15, 0, 0, "", ""]
    ["temperature_names", 161, 0, 0, "", ""]
    ["temperatures", 155, 0, 0, "", ""]
    ["alarms", 161, 0, 0, "", ""]
    ["tool_numbers", 151, 0, 0, "", ""]
    ["tool_wear", 155, 0, 0, "", ""]
    ["volumetric_entries", 161, 0, 0, "", ""]
    ["volumetric_values", 155, 0, 0, "", ""]
    ["work_offset_axes", 161, 0, 0, "", ""]
    ["work_offsets", 155, 0, 0, "", ""]
}

/// A correction of an offset, with everything that the gate of machine_state checks before it reaches the machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Correction {
    pub header: crate::std_msgs::Header,
    pub correction_id: String,
    /// session of the driver in which its source was measured
    pub session: String,
    /// computed from a recording: never written to a machine
    pub replayed: bool,
    /// one of TOOL_WEAR to VOLUMETRIC
    pub kind: u8,
    pub tool_number: u32,
    /// joint of a work offset
    pub axis: String,
    /// m or rad, value from which the change was computed. TOOL_PATH: largest offset of the path,
    pub previous_value: f64,
    /// m. VOLUMETRIC: largest displacement of the tip over the poses measured, m
    /// m or rad; TOOL_PATH: largest magnitude of the offsets; VOLUMETRIC: as previous_value
    pub new_value: f64,
    /// m, TOOL_PATH: offset along the outward normal at each point of feature_ids[0], in plan order
    pub path: Vec<f64>,
    /// m or rad, least new_value allowed
    pub lower_bound: f64,
    /// m or rad, greatest new_value allowed
    pub upper_bound: f64,
    /// source measurement
    pub plan_id: String,
    /// source measurement
    pub feature_ids: Vec<String>,
    /// source: sequence of each ProbeEvent
    pub sequences: Vec<u64>,
    /// m
    pub measured_error: f64,
    /// m
    pub standard_uncertainty: f64,
    /// one of APPROVAL_*
    pub approval: u8,
    pub approved_by: String,
    /// it is refused after this instant
    pub expires: crate::builtin_interfaces::Time,
    /// VOLUMETRIC: ISO 230-1 name of each entry (EX0C, EA0B), all that the controller has
    pub entries: Vec<String>,
    /// m or rad, value of each entry from which the change was computed
    pub previous_values: Vec<f64>,
    /// m or rad, absolute new value of each entry
    pub new_values: Vec<f64>,
    /// m or rad, greatest magnitude of each new value allowed
    pub value_limits: Vec<f64>,
    /// m or rad, standard uncertainty of each new value; 0 where the entry was not estimated
    pub value_uncertainties: Vec<f64>,
    /// instant of the approval or rejection, by the clock of the cell
    pub approved_at: crate::builtin_interfaces::Time,
    /// what who approves was shown: text, or `sha256:` and its digest
    pub shown: String,
    /// ed25519, 64 bytes: see docs/approvals.md. Empty: not signed
    pub signature: Vec<u8>,
}

impl Correction {
    pub const TOOL_WEAR: u8 = 0;
    pub const WORK_OFFSET: u8 = 1;
    pub const TOOL_PATH: u8 = 2;
    /// the whole volumetric table, whose entries were estimated together
    pub const VOLUMETRIC: u8 = 3;
    /// proposed only
    pub const APPROVAL_NONE: u8 = 0;
    /// by the policy of the cell file
    pub const APPROVAL_POLICY: u8 = 1;
    pub const APPROVAL_OPERATOR: u8 = 2;
    pub const APPROVAL_REJECTED: u8 = 3;
}

crate::code::codes! {
    /// Values of `Correction.kind`.
    pub enum CorrectionKind of "Correction.kind" {
        /// `TOOL_WEAR`.
        ToolWear = 0,
        /// `WORK_OFFSET`.
        WorkOffset = 1,
        /// `TOOL_PATH`.
        ToolPath = 2,
        /// the whole volumetric table, whose entries were estimated together
        Volumetric = 3,
    }
}

crate::code::codes! {
    /// Values of `Correction.approval`.
    pub enum CorrectionApproval of "Correction.approval" {
        /// proposed only
        None = 0,
        /// by the policy of the cell file
        Policy = 1,
        /// `APPROVAL_OPERATOR`.
        Operator = 2,
        /// `APPROVAL_REJECTED`.
        Rejected = 3,
    }
}

crate::schema::message! {
    Correction: "probecell_msgs", "msg", "Correction",
    "RIHS01_f37a9f4aa6f210055581c6aced2694d05e41b1b9239092d7ec7d17bd8a10a646",
    concat!(
        include_str!("../msg/Correction.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["correction_id", 17, 0, 0, "", ""]
    ["session", 17, 0, 0, "", ""]
    ["replayed", 15, 0, 0, "", ""]
    ["kind", 3, 0, 0, "", ""]
    ["tool_number", 7, 0, 0, "", ""]
    ["axis", 17, 0, 0, "", ""]
    ["previous_value", 11, 0, 0, "", ""]
    ["new_value", 11, 0, 0, "", ""]
    ["path", 155, 0, 0, "", ""]
    ["lower_bound", 11, 0, 0, "", ""]
    ["upper_bound", 11, 0, 0, "", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["feature_ids", 161, 0, 0, "", ""]
    ["sequences", 153, 0, 0, "", ""]
    ["measured_error", 11, 0, 0, "", ""]
    ["standard_uncertainty", 11, 0, 0, "", ""]
    ["approval", 3, 0, 0, "", ""]
    ["approved_by", 17, 0, 0, "", ""]
    ["expires", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    ["entries", 161, 0, 0, "", ""]
    ["previous_values", 155, 0, 0, "", ""]
    ["new_values", 155, 0, 0, "", ""]
    ["value_limits", 155, 0, 0, "", ""]
    ["value_uncertainties", 155, 0, 0, "", ""]
    ["approved_at", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    ["shown", 17, 0, 0, "", ""]
    ["signature", 147, 0, 0, "", ""]
}

/// The outcome of a Correction at the machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CorrectionAcknowledgement {
    pub header: crate::std_msgs::Header,
    pub correction_id: String,
    /// one of the constants above
    pub outcome: u8,
    /// m or rad, read from the controller; VOLUMETRIC: previous_value of the correction
    pub value_before: f64,
    /// m or rad, read back from the controller; VOLUMETRIC: new_value of the correction, NaN unless
    pub value_after: f64,
    /// every entry was read back as requested
    pub text: String,
    /// m or rad, entries of a volumetric table read from the controller, in the order of the correction
    pub values_before: Vec<f64>,
    /// m or rad, the same read back
    pub values_after: Vec<f64>,
}

impl CorrectionAcknowledgement {
    pub const APPLIED: u8 = 0;
    pub const ALREADY_APPLIED: u8 = 1;
    pub const REFUSED_NOT_APPROVED: u8 = 2;
    pub const REFUSED_STALE: u8 = 3;
    pub const REFUSED_OUT_OF_BOUNDS: u8 = 4;
    pub const REFUSED_REPLAY: u8 = 5;
    pub const REFUSED_NO_SOURCE: u8 = 6;
    pub const FAILED: u8 = 7;
}

crate::code::codes! {
    /// Values of `CorrectionAcknowledgement.outcome`.
    pub enum CorrectionAcknowledgementOutcome of "CorrectionAcknowledgement.outcome" {
        /// `APPLIED`.
        Applied = 0,
        /// `ALREADY_APPLIED`.
        AlreadyApplied = 1,
        /// `REFUSED_NOT_APPROVED`.
        RefusedNotApproved = 2,
        /// `REFUSED_STALE`.
        RefusedStale = 3,
        /// `REFUSED_OUT_OF_BOUNDS`.
        RefusedOutOfBounds = 4,
        /// `REFUSED_REPLAY`.
        RefusedReplay = 5,
        /// `REFUSED_NO_SOURCE`.
        RefusedNoSource = 6,
        /// `FAILED`.
        Failed = 7,
    }
}

crate::schema::message! {
    CorrectionAcknowledgement: "probecell_msgs", "msg", "CorrectionAcknowledgement",
    "RIHS01_f4a80a304d09c08facc63a5a3d88717422a441022db64b5248a7334893d7d1fa",
    concat!(
        include_str!("../msg/CorrectionAcknowledgement.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["correction_id", 17, 0, 0, "", ""]
    ["outcome", 3, 0, 0, "", ""]
    ["value_before", 11, 0, 0, "", ""]
    ["value_after", 11, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
    ["values_before", 155, 0, 0, "", ""]
    ["values_after", 155, 0, 0, "", ""]
}

/// A fault of a node, named by a code. Each node publishes its faults on NODE/faults.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    pub header: crate::std_msgs::Header,
    pub node: String,
    /// one of WARNING to ERROR; an ERROR stops the part
    pub severity: u8,
    /// closed list of the node, in its crate documentation: probe_dead, estop, ...
    pub code: String,
    pub text: String,
}

impl Fault {
    pub const WARNING: u8 = 0;
    pub const ERROR: u8 = 1;
    /// a process ended and what it knew is lost; reported by the launcher
    pub const PROCESS_ENDED: &'static str = "process_ended";
    /// the driver was restarted; the axes may have another origin
    pub const CONTROLLER_RESTARTED: &'static str = "controller_restarted";
}

crate::code::codes! {
    /// Values of `Fault.severity`.
    pub enum FaultSeverity of "Fault.severity" {
        /// `WARNING`.
        Warning = 0,
        /// `ERROR`.
        Error = 1,
    }
}

crate::schema::message! {
    Fault: "probecell_msgs", "msg", "Fault",
    "RIHS01_2cee159971e5e34eede5eab835eb9be85993e58f86acb91233c5045c232008bd",
    concat!(
        include_str!("../msg/Fault.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["node", 17, 0, 0, "", ""]
    ["severity", 3, 0, 0, "", ""]
    ["code", 17, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
}

/// A fitted feature. Published on feature_results: reliable, transient local, depth 64.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeatureResult {
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    pub part_id: String,
    pub feature_id: String,
    /// InspectionFeature kind, or one of ROUNDNESS to TOTAL_RUN_OUT
    pub kind: u8,
    /// one of CONFORMS to INVALID
    pub decision: u8,
    /// one of LEAST_SQUARES to MAXIMUM_INSCRIBED, of the fit
    pub criterion: u8,
    /// datums that define the part frame; empty: the part frame as programmed
    pub aligned_to: Vec<String>,
    /// number of touches used
    pub touches: u32,
    /// sequence of each ProbeEvent used
    pub sequences: Vec<u64>,
    /// sequence of each ProbeEvent excluded as an outlier
    pub left_out: Vec<u64>,
    /// m, part frame, as aligned: fitted centre or point
    pub origin: crate::geometry_msgs::Point,
    /// unit vector, part frame, as aligned: fitted direction
    pub axis: crate::geometry_msgs::Vector3,
    /// m: diameter; plane: distance from the part origin along its nominal normal
    pub size: f64,
    /// m
    pub nominal_size: f64,
    /// m, size minus nominal_size
    pub size_deviation: f64,
    /// m, peak to valley of the residuals
    pub form: f64,
    /// m, standard
    pub form_uncertainty: f64,
    /// m, of origin from its nominal position: of a plane along its normal, of an axis across it
    pub position: f64,
    /// m, standard; 0: the touches do not determine the position
    pub position_uncertainty: f64,
    /// rad, of axis from its nominal direction
    pub orientation: f64,
    /// rad, standard; 0: the touches do not determine the orientation
    pub orientation_uncertainty: f64,
    /// m, PROFILE, SURFACE: mean deviation at each point, in plan order; else empty
    pub deviations: Vec<f64>,
    /// m, of size_deviation
    pub standard_uncertainty: f64,
    /// ratio: expanded uncertainty = coverage_factor * standard_uncertainty
    pub coverage_factor: f64,
    /// m, largest range of repeated touches of one point
    pub repeat_spread: f64,
    pub text: String,
}

impl FeatureResult {
    /// inside the limits by more than the expanded uncertainty (ISO 14253-1:2013)
    pub const CONFORMS: u8 = 0;
    /// outside the limits by more than the expanded uncertainty
    pub const DOES_NOT_CONFORM: u8 = 1;
    /// within the expanded uncertainty of a limit
    pub const INDETERMINATE: u8 = 2;
    /// could not be measured; text says why
    pub const INVALID: u8 = 3;
    pub const LEAST_SQUARES: u8 = 0;
    /// ISO 1101
    pub const MINIMUM_ZONE: u8 = 1;
    pub const MINIMUM_CIRCUMSCRIBED: u8 = 2;
    pub const MAXIMUM_INSCRIBED: u8 = 3;
    /// kinds of geometrical tolerances (ISO 1101): size is the width or diameter of the zone
    pub const ROUNDNESS: u8 = 64;
    pub const CYLINDRICITY: u8 = 65;
    pub const FLATNESS: u8 = 66;
    pub const PARALLELISM: u8 = 67;
    pub const PERPENDICULARITY: u8 = 68;
    pub const POSITION: u8 = 69;
    pub const PROFILE: u8 = 70;
    pub const CIRCULAR_RUN_OUT: u8 = 71;
    pub const TOTAL_RUN_OUT: u8 = 72;
}

crate::code::codes! {
    /// Values of `FeatureResult.decision`.
    pub enum FeatureResultDecision of "FeatureResult.decision" {
        /// inside the limits by more than the expanded uncertainty (ISO 14253-1:2013)
        Conforms = 0,
        /// outside the limits by more than the expanded uncertainty
        DoesNotConform = 1,
        /// within the expanded uncertainty of a limit
        Indeterminate = 2,
        /// could not be measured; text says why
        Invalid = 3,
    }
}

crate::code::codes! {
    /// Values of `FeatureResult.criterion`.
    pub enum FeatureResultCriterion of "FeatureResult.criterion" {
        /// `LEAST_SQUARES`.
        LeastSquares = 0,
        /// ISO 1101
        MinimumZone = 1,
        /// `MINIMUM_CIRCUMSCRIBED`.
        MinimumCircumscribed = 2,
        /// `MAXIMUM_INSCRIBED`.
        MaximumInscribed = 3,
    }
}

crate::schema::message! {
    FeatureResult: "probecell_msgs", "msg", "FeatureResult",
    "RIHS01_7c546fc5441e0af8631203f2611bd9e4ca3b772ef9777ddc6ca0db78528ca56d",
    concat!(
        include_str!("../msg/FeatureResult.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: geometry_msgs/Point\n",
        include_str!("../standard/geometry_msgs/msg/Point.msg"),
        "================================================================================\nMSG: geometry_msgs/Vector3\n",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["feature_id", 17, 0, 0, "", ""]
    ["kind", 3, 0, 0, "", ""]
    ["decision", 3, 0, 0, "", ""]
    ["criterion", 3, 0, 0, "", ""]
    ["aligned_to", 161, 0, 0, "", ""]
    ["touches", 7, 0, 0, "", ""]
    ["sequences", 153, 0, 0, "", ""]
    ["left_out", 153, 0, 0, "", ""]
    ["origin", 1, 0, 0, "geometry_msgs/msg/Point", ""]
    ["axis", 1, 0, 0, "geometry_msgs/msg/Vector3", ""]
    ["size", 11, 0, 0, "", ""]
    ["nominal_size", 11, 0, 0, "", ""]
    ["size_deviation", 11, 0, 0, "", ""]
    ["form", 11, 0, 0, "", ""]
    ["form_uncertainty", 11, 0, 0, "", ""]
    ["position", 11, 0, 0, "", ""]
    ["position_uncertainty", 11, 0, 0, "", ""]
    ["orientation", 11, 0, 0, "", ""]
    ["orientation_uncertainty", 11, 0, 0, "", ""]
    ["deviations", 155, 0, 0, "", ""]
    ["standard_uncertainty", 11, 0, 0, "", ""]
    ["coverage_factor", 11, 0, 0, "", ""]
    ["repeat_spread", 11, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
}

/// An effect that explains part of the difference between a session and its declared model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapEffect {
    /// identifier of the effect vocabulary
    pub effect: String,
    /// ratio, 0 to 1
    pub probability: f64,
    pub parameter_names: Vec<String>,
    /// in parameter_units
    pub parameter_values: Vec<f64>,
    pub parameter_units: Vec<String>,
    /// in parameter_units
    pub parameter_ci95_lower: Vec<f64>,
    /// in parameter_units
    pub parameter_ci95_upper: Vec<f64>,
    /// m, on touches not used for the fit
    pub rms_before: f64,
    /// m, on touches not used for the fit
    pub rms_after: f64,
    /// m
    pub rms_after_ci95_lower: f64,
    /// m
    pub rms_after_ci95_upper: f64,
    pub indistinguishable_from: Vec<String>,
}

crate::schema::message! {
    GapEffect: "probecell_msgs", "msg", "GapEffect",
    "RIHS01_c32e78420153ba91222c4d1a1c40316dbdb27beef5ab96cfac43f8747cd23c50",
    include_str!("../msg/GapEffect.msg"),
    ["effect", 17, 0, 0, "", ""]
    ["probability", 11, 0, 0, "", ""]
    ["parameter_names", 161, 0, 0, "", ""]
    ["parameter_values", 155, 0, 0, "", ""]
    ["parameter_units", 161, 0, 0, "", ""]
    ["parameter_ci95_lower", 155, 0, 0, "", ""]
    ["parameter_ci95_upper", 155, 0, 0, "", ""]
    ["rms_before", 11, 0, 0, "", ""]
    ["rms_after", 11, 0, 0, "", ""]
    ["rms_after_ci95_lower", 11, 0, 0, "", ""]
    ["rms_after_ci95_upper", 11, 0, 0, "", ""]
    ["indistinguishable_from", 161, 0, 0, "", ""]
}

/// The difference from the declared model has changed while parts are made. Published on gap_findings: reliable, transient local,
/// depth 64.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapFinding {
    pub header: crate::std_msgs::Header,
    /// the measurement after which the change is certain
    pub plan_id: String,
    /// its number among the parts watched, from 1
    pub part: u32,
    /// the first measurement that has changed
    pub onset_plan_id: String,
    /// its number among the parts watched, from 1
    pub onset_part: u32,
    /// its first touch
    pub onset: crate::builtin_interfaces::Time,
    /// of 1,000 parts without a change, as the cell file states
    pub false_alarms: f64,
    /// effects that explain the change equally well, the best first; none: no known effect does
    pub effects: Vec<String>,
    /// ratio, 0 to 1, that it is one of them
    pub probability: f64,
    /// of the first of effects
    pub parameter_names: Vec<String>,
    /// in parameter_units
    pub parameter_values: Vec<f64>,
    pub parameter_units: Vec<String>,
    /// in parameter_units
    pub parameter_ci95_lower: Vec<f64>,
    /// in parameter_units
    pub parameter_ci95_upper: Vec<f64>,
    /// m, of the change over the points of the plan
    pub rms_before: f64,
    /// m, of what the first of effects leaves of it
    pub rms_after: f64,
    /// what to do about the first of effects, with its size
    pub remedy: String,
    /// touches of the same part that would discriminate the effects; nothing in the cell asks for them by itself
    pub further: Vec<InspectionPoint>,
}

crate::schema::message! {
    GapFinding: "probecell_msgs", "msg", "GapFinding",
    "RIHS01_b22ce3877676723a4d74924c684fb76a7ef748a16330fefb680ca201d50fb4a1",
    concat!(
        include_str!("../msg/GapFinding.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: probecell_msgs/InspectionPoint\n",
        include_str!("../msg/InspectionPoint.msg"),
        "================================================================================\nMSG: geometry_msgs/Point\n",
        include_str!("../standard/geometry_msgs/msg/Point.msg"),
        "================================================================================\nMSG: geometry_msgs/Vector3\n",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["part", 7, 0, 0, "", ""]
    ["onset_plan_id", 17, 0, 0, "", ""]
    ["onset_part", 7, 0, 0, "", ""]
    ["onset", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    ["false_alarms", 11, 0, 0, "", ""]
    ["effects", 161, 0, 0, "", ""]
    ["probability", 11, 0, 0, "", ""]
    ["parameter_names", 161, 0, 0, "", ""]
    ["parameter_values", 155, 0, 0, "", ""]
    ["parameter_units", 161, 0, 0, "", ""]
    ["parameter_ci95_lower", 155, 0, 0, "", ""]
    ["parameter_ci95_upper", 155, 0, 0, "", ""]
    ["rms_before", 11, 0, 0, "", ""]
    ["rms_after", 11, 0, 0, "", ""]
    ["remedy", 17, 0, 0, "", ""]
    ["further", 145, 0, 0, "probecell_msgs/msg/InspectionPoint", ""]
}

/// Why a session differs from the declared model. Published on gap_report: reliable, transient local, depth 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapReport {
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    pub samples: u32,
    /// one of the constants above
    pub verdict: u8,
    /// m
    pub rms: f64,
    /// m
    pub noise_floor: f64,
    /// in the order in which they were attributed
    pub effects: Vec<GapEffect>,
    /// the whole report, schema probecell/gap-report/1
    pub json: String,
}

impl GapReport {
    pub const NO_GAP: u8 = 0;
    pub const EXPLAINED: u8 = 1;
    pub const PARTLY_EXPLAINED: u8 = 2;
    pub const UNEXPLAINED: u8 = 3;
}

crate::code::codes! {
    /// Values of `GapReport.verdict`.
    pub enum GapReportVerdict of "GapReport.verdict" {
        /// `NO_GAP`.
        NoGap = 0,
        /// `EXPLAINED`.
        Explained = 1,
        /// `PARTLY_EXPLAINED`.
        PartlyExplained = 2,
        /// `UNEXPLAINED`.
        Unexplained = 3,
    }
}

crate::schema::message! {
    GapReport: "probecell_msgs", "msg", "GapReport",
    "RIHS01_f1b534141c4e3358b8547a9e409ce5e83acdb0abc3d4de5a6c15091e9077684f",
    concat!(
        include_str!("../msg/GapReport.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: probecell_msgs/GapEffect\n",
        include_str!("../msg/GapEffect.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["samples", 7, 0, 0, "", ""]
    ["verdict", 3, 0, 0, "", ""]
    ["rms", 11, 0, 0, "", ""]
    ["noise_floor", 11, 0, 0, "", ""]
    ["effects", 145, 0, 0, "probecell_msgs/msg/GapEffect", ""]
    ["json", 17, 0, 0, "", ""]
}

/// A sign of life of machine_state, the gate, ten times a second. A driver whose machine moves stops it when it falls silent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GateHeartbeat {
    pub header: crate::std_msgs::Header,
    /// session of the driver that it supervises; empty before the first sample of a controller
    pub session: String,
    /// ns since 1970, start of the process: another value is another process
    pub started: u64,
    /// from 1 in a process, without gaps
    pub count: u64,
}

crate::schema::message! {
    GateHeartbeat: "probecell_msgs", "msg", "GateHeartbeat",
    "RIHS01_878df513d1882e854527c51a71c25ae1247060f4277e40a2eb6f59eb760ae359",
    concat!(
        include_str!("../msg/GateHeartbeat.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["session", 17, 0, 0, "", ""]
    ["started", 9, 0, 0, "", ""]
    ["count", 9, 0, 0, "", ""]
}

/// A nominal feature of the part, in the part frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InspectionFeature {
    pub id: String,
    /// one of the constants above
    pub kind: u8,
    /// m, part frame: a point of the plane or axis, the centre of a sphere
    pub origin: crate::geometry_msgs::Point,
    /// unit vector, part frame (the outward normal of a plane)
    pub axis: crate::geometry_msgs::Vector3,
    /// m
    pub radius: f64,
    /// rad, half apex angle of a cone
    pub half_angle: f64,
    /// m, limit of the deviation of size
    pub lower_tolerance: f64,
    /// m, limit of the deviation of size
    pub upper_tolerance: f64,
}

impl InspectionFeature {
    pub const PLANE: u8 = 0;
    pub const CYLINDER: u8 = 1;
    pub const BORE: u8 = 2;
    pub const SPHERE: u8 = 3;
    pub const CONE: u8 = 4;
    pub const PROFILE: u8 = 5;
    pub const SURFACE: u8 = 6;
}

crate::code::codes! {
    /// Values of `InspectionFeature.kind`.
    pub enum InspectionFeatureKind of "InspectionFeature.kind" {
        /// `PLANE`.
        Plane = 0,
        /// `CYLINDER`.
        Cylinder = 1,
        /// `BORE`.
        Bore = 2,
        /// `SPHERE`.
        Sphere = 3,
        /// `CONE`.
        Cone = 4,
        /// `PROFILE`.
        Profile = 5,
        /// `SURFACE`.
        Surface = 6,
    }
}

crate::schema::message! {
    InspectionFeature: "probecell_msgs", "msg", "InspectionFeature",
    "RIHS01_affa7af2f22deb4124f87f898afa3c9adb138e345f21196adee51bac094d4534",
    concat!(
        include_str!("../msg/InspectionFeature.msg"),
        "================================================================================\nMSG: geometry_msgs/Point\n",
        include_str!("../standard/geometry_msgs/msg/Point.msg"),
        "================================================================================\nMSG: geometry_msgs/Vector3\n",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg")
    ),
    ["id", 17, 0, 0, "", ""]
    ["kind", 3, 0, 0, "", ""]
    ["origin", 1, 0, 0, "geometry_msgs/msg/Point", ""]
    ["axis", 1, 0, 0, "geometry_msgs/msg/Vector3", ""]
    ["radius", 11, 0, 0, "", ""]
    ["half_angle", 11, 0, 0, "", ""]
    ["lower_tolerance", 11, 0, 0, "", ""]
    ["upper_tolerance", 11, 0, 0, "", ""]
}

/// What to measure. Published on inspection_plan: reliable, transient local, depth 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InspectionPlan {
    /// stamp: when the plan was made
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    pub part_id: String,
    /// true: cut in this same clamping, so a clamping error cannot show
    pub machined_on_this_machine: bool,
    /// m, nominal part frame in workpiece
    pub part_pose: crate::geometry_msgs::Pose,
    pub stylus: Stylus,
    /// joints that the rotary_positions below belong to
    pub rotary_names: Vec<String>,
    pub features: Vec<InspectionFeature>,
    pub operations: Vec<MachiningOperation>,
    pub points: Vec<InspectionPoint>,
}

crate::schema::message! {
    InspectionPlan: "probecell_msgs", "msg", "InspectionPlan",
    "RIHS01_37a9ba598c98f0c1a22dd62ac34c05e6479b20ad787c92203faf062d830bdce4",
    concat!(
        include_str!("../msg/InspectionPlan.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: geometry_msgs/Pose\n",
        include_str!("../standard/geometry_msgs/msg/Pose.msg"),
        "================================================================================\nMSG: geometry_msgs/Point\n",
        include_str!("../standard/geometry_msgs/msg/Point.msg"),
        "================================================================================\nMSG: geometry_msgs/Quaternion\n",
        include_str!("../standard/geometry_msgs/msg/Quaternion.msg"),
        "================================================================================\nMSG: probecell_msgs/Stylus\n",
        include_str!("../msg/Stylus.msg"),
        "================================================================================\nMSG: probecell_msgs/InspectionFeature\n",
        include_str!("../msg/InspectionFeature.msg"),
        "================================================================================\nMSG: geometry_msgs/Vector3\n",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg"),
        "================================================================================\nMSG: probecell_msgs/MachiningOperation\n",
        include_str!("../msg/MachiningOperation.msg"),
        "================================================================================\nMSG: probecell_msgs/InspectionPoint\n",
        include_str!("../msg/InspectionPoint.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["machined_on_this_machine", 15, 0, 0, "", ""]
    ["part_pose", 1, 0, 0, "geometry_msgs/msg/Pose", ""]
    ["stylus", 1, 0, 0, "probecell_msgs/msg/Stylus", ""]
    ["rotary_names", 161, 0, 0, "", ""]
    ["features", 145, 0, 0, "probecell_msgs/msg/InspectionFeature", ""]
    ["operations", 145, 0, 0, "probecell_msgs/msg/MachiningOperation", ""]
    ["points", 145, 0, 0, "probecell_msgs/msg/InspectionPoint", ""]
}

/// A nominal point to touch, in the part frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InspectionPoint {
    /// index into the plan's features
    pub feature: u32,
    /// m, part frame
    pub position: crate::geometry_msgs::Point,
    /// unit vector, part frame, outward
    pub normal: crate::geometry_msgs::Vector3,
    /// rad, of the plan's rotary_names, while probing
    pub rotary_positions: Vec<f64>,
    /// m, from the start of the approach to the nominal contact
    pub approach_distance: f64,
    /// m, back along the normal after the trigger
    pub retract_distance: f64,
    /// m/s
    pub feed: f64,
    /// index of the operation that cut it; -1: not cut on this machine
    pub operation: i32,
    /// m, path the tool had cut when it made the point
    pub cut_length: f64,
    /// m, height along the tool that cut it
    pub tool_height: f64,
    /// m, distance from the clamping
    pub overhang: f64,
}

crate::schema::message! {
    InspectionPoint: "probecell_msgs", "msg", "InspectionPoint",
    "RIHS01_95319b5604fc7623402512766cd059fb8e4f20d672d892b6a4e0ad52c925d95d",
    concat!(
        include_str!("../msg/InspectionPoint.msg"),
        "================================================================================\nMSG: geometry_msgs/Point\n",
        include_str!("../standard/geometry_msgs/msg/Point.msg"),
        "================================================================================\nMSG: geometry_msgs/Vector3\n",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg")
    ),
    ["feature", 7, 0, 0, "", ""]
    ["position", 1, 0, 0, "geometry_msgs/msg/Point", ""]
    ["normal", 1, 0, 0, "geometry_msgs/msg/Vector3", ""]
    ["rotary_positions", 155, 0, 0, "", ""]
    ["approach_distance", 11, 0, 0, "", ""]
    ["retract_distance", 11, 0, 0, "", ""]
    ["feed", 11, 0, 0, "", ""]
    ["operation", 6, 0, 0, "", ""]
    ["cut_length", 11, 0, 0, "", ""]
    ["tool_height", 11, 0, 0, "", ""]
    ["overhang", 11, 0, 0, "", ""]
}

/// Messages that a subscriber did not receive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossReport {
    pub header: crate::std_msgs::Header,
    /// node that noticed the loss
    pub observer: String,
    pub topic: String,
    /// publication number of the first message missing
    pub first_sequence: u64,
    /// number of consecutive messages
    pub count: u64,
    /// they were fetched from the publisher's cache afterwards
    pub recovered: bool,
}

crate::schema::message! {
    LossReport: "probecell_msgs", "msg", "LossReport",
    "RIHS01_8e100597c1f567a1e4d1e4c1307ca2224adfd9ede19b6b102f7764707632c5f5",
    concat!(
        include_str!("../msg/LossReport.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["observer", 17, 0, 0, "", ""]
    ["topic", 17, 0, 0, "", ""]
    ["first_sequence", 9, 0, 0, "", ""]
    ["count", 9, 0, 0, "", ""]
    ["recovered", 15, 0, 0, "", ""]
}

/// What the machine is doing. Published on machine_state: reliable, volatile, depth 10.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MachineState {
    /// stamp: instant the controller was sampled
    pub header: crate::std_msgs::Header,
    pub machine_id: String,
    /// one of MODE_*
    pub mode: u8,
    /// one of EXECUTION_*
    pub execution: u8,
    /// name of the program that is open
    pub program: String,
    /// line of that program
    pub line: u32,
    pub tool_number: u32,
    /// 1.0 = 100 %
    pub feed_override: f64,
    /// rad/s
    pub spindle_speed: f64,
    pub temperature_names: Vec<String>,
    /// degree Celsius, one for each name
    pub temperatures: Vec<f64>,
    /// texts of the active alarms
    pub alarms: Vec<String>,
}

impl MachineState {
    pub const MODE_MANUAL: u8 = 0;
    pub const MODE_MDI: u8 = 1;
    pub const MODE_AUTO: u8 = 2;
    pub const EXECUTION_IDLE: u8 = 0;
    pub const EXECUTION_RUNNING: u8 = 1;
    pub const EXECUTION_HOLD: u8 = 2;
    pub const EXECUTION_ALARM: u8 = 3;
    pub const EXECUTION_ESTOP: u8 = 4;
}

crate::code::codes! {
    /// Values of `MachineState.mode`.
    pub enum MachineStateMode of "MachineState.mode" {
        /// `MODE_MANUAL`.
        Manual = 0,
        /// `MODE_MDI`.
        Mdi = 1,
        /// `MODE_AUTO`.
        Auto = 2,
    }
}

crate::code::codes! {
    /// Values of `MachineState.execution`.
    pub enum MachineStateExecution of "MachineState.execution" {
        /// `EXECUTION_IDLE`.
        Idle = 0,
        /// `EXECUTION_RUNNING`.
        Running = 1,
        /// `EXECUTION_HOLD`.
        Hold = 2,
        /// `EXECUTION_ALARM`.
        Alarm = 3,
        /// `EXECUTION_ESTOP`.
        Estop = 4,
    }
}

crate::schema::message! {
    MachineState: "probecell_msgs", "msg", "MachineState",
    "RIHS01_377a7d9d9a7d802b1dbadf1e307511d543530faf194b0dc6db186715cec8815c",
    concat!(
        include_str!("../msg/MachineState.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["machine_id", 17, 0, 0, "", ""]
    ["mode", 3, 0, 0, "", ""]
    ["execution", 3, 0, 0, "", ""]
    ["program", 17, 0, 0, "", ""]
    ["line", 7, 0, 0, "", ""]
    ["tool_number", 7, 0, 0, "", ""]
    ["feed_override", 11, 0, 0, "", ""]
    ["spindle_speed", 11, 0, 0, "", ""]
    ["temperature_names", 161, 0, 0, "", ""]
    ["temperatures", 155, 0, 0, "", ""]
    ["alarms", 161, 0, 0, "", ""]
}

/// A machining operation, which cut some of the points.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MachiningOperation {
    pub id: String,
    pub tool_number: u32,
    /// m
    pub tool_radius: f64,
    /// m/s
    pub feed: f64,
    /// true: it generates the final surface
    pub finish: bool,
    /// rad, of the plan's rotary_names, while cutting
    pub rotary_positions: Vec<f64>,
}

crate::schema::message! {
    MachiningOperation: "probecell_msgs", "msg", "MachiningOperation",
    "RIHS01_6dee5609a815f7b1dc7c8358725e3a292206055cb95b8bb1332c9c492950db73",
    include_str!("../msg/MachiningOperation.msg"),
    ["id", 17, 0, 0, "", ""]
    ["tool_number", 7, 0, 0, "", ""]
    ["tool_radius", 11, 0, 0, "", ""]
    ["feed", 11, 0, 0, "", ""]
    ["finish", 15, 0, 0, "", ""]
    ["rotary_positions", 155, 0, 0, "", ""]
}

/// The order in which a plan's points are touched, and the moves that lead there.
/// Published on measurement_order: reliable, transient local, depth 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasurementOrder {
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    /// indices into the plan's points
    pub order: Vec<u32>,
    /// s, moves between touches in this order by the motion limits of the cell file
    pub air_time: f64,
    /// s, the same in the order in which the plan lists them
    pub given_air_time: f64,
    /// m, path of the ball centre in the part frame between touches in this order
    pub air_length: f64,
    /// m, the same in the order in which the plan lists them
    pub given_air_length: f64,
    /// proved to be the shortest order
    pub optimal: bool,
    /// joints of the moves below
    pub axis_names: Vec<String>,
    pub moves: Vec<ProbingMove>,
}

crate::schema::message! {
    MeasurementOrder: "probecell_msgs", "msg", "MeasurementOrder",
    "RIHS01_13f406c5fa9c038cf90ae9c93289fb18f601d30511840aa99bc93ae8ba0006dd",
    concat!(
        include_str!("../msg/MeasurementOrder.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: probecell_msgs/ProbingMove\n",
        include_str!("../msg/ProbingMove.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["order", 151, 0, 0, "", ""]
    ["air_time", 11, 0, 0, "", ""]
    ["given_air_time", 11, 0, 0, "", ""]
    ["air_length", 11, 0, 0, "", ""]
    ["given_air_length", 11, 0, 0, "", ""]
    ["optimal", 15, 0, 0, "", ""]
    ["axis_names", 161, 0, 0, "", ""]
    ["moves", 145, 0, 0, "probecell_msgs/msg/ProbingMove", ""]
}

/// The outcome of an OperationRequest, or that it is under way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OperationReport {
    pub header: crate::std_msgs::Header,
    pub request_id: u64,
    /// one of the constants above
    pub outcome: u8,
    /// reason for REFUSED or FAILED
    pub text: String,
}

impl OperationReport {
    pub const DONE: u8 = 0;
    pub const REFUSED: u8 = 1;
    pub const FAILED: u8 = 2;
    /// taken; it will be answered. Repeated once a second
    pub const UNDERWAY: u8 = 3;
}

crate::code::codes! {
    /// Values of `OperationReport.outcome`.
    pub enum OperationReportOutcome of "OperationReport.outcome" {
        /// `DONE`.
        Done = 0,
        /// `REFUSED`.
        Refused = 1,
        /// `FAILED`.
        Failed = 2,
        /// taken; it will be answered. Repeated once a second
        Underway = 3,
    }
}

crate::schema::message! {
    OperationReport: "probecell_msgs", "msg", "OperationReport",
    "RIHS01_5d7ed28f331ba84a33c1fba730d278e8983856fdea380e613e1a032b81258597",
    concat!(
        include_str!("../msg/OperationReport.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["request_id", 9, 0, 0, "", ""]
    ["outcome", 3, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
}

/// What the machine is to do next. It is repeated under the same request_id until it is answered, and taken once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OperationRequest {
    pub header: crate::std_msgs::Header,
    /// counts from the start of cycle (ns since 1970), without gaps
    pub request_id: u64,
    /// one of the constants above
    pub kind: u8,
    /// id of the operation to cut
    pub operation: String,
    pub plan_id: String,
    /// number of the machining pass, from 0
    pub pass_number: u32,
    /// MEASURE: outside the part program; nothing is decided or corrected from it
    pub only_measure: bool,
    /// the run that it belongs to, as in PartStatus
    pub run_id: String,
}

impl OperationRequest {
    pub const CUT: u8 = 0;
    pub const MEASURE: u8 = 1;
    pub const STOP: u8 = 2;
}

crate::code::codes! {
    /// Values of `OperationRequest.kind`.
    pub enum OperationRequestKind of "OperationRequest.kind" {
        /// `CUT`.
        Cut = 0,
        /// `MEASURE`.
        Measure = 1,
        /// `STOP`.
        Stop = 2,
    }
}

crate::schema::message! {
    OperationRequest: "probecell_msgs", "msg", "OperationRequest",
    "RIHS01_551c5b8a314a5b93c7afd4e8abc77b0318fd0101a7bf0a0f5cfbdb96bc1e4a8f",
    concat!(
        include_str!("../msg/OperationRequest.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["request_id", 9, 0, 0, "", ""]
    ["kind", 3, 0, 0, "", ""]
    ["operation", 17, 0, 0, "", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["pass_number", 7, 0, 0, "", ""]
    ["only_measure", 15, 0, 0, "", ""]
    ["run_id", 17, 0, 0, "", ""]
}

/// The keys of the operators whose approvals count, signed by the key of the cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OperatorKeys {
    pub header: crate::std_msgs::Header,
    /// greater than that of every earlier list of the cell
    pub number: u64,
    /// operators; a name may stand here again after a key of it was withdrawn
    pub names: Vec<String>,
    /// ed25519 public key of each, 64 hexadecimal digits
    pub keys: Vec<String>,
    /// each: its approvals are refused
    pub withdrawn: Vec<bool>,
    /// of the cell's key, 64 bytes: see docs/approvals.md
    pub signature: Vec<u8>,
}

crate::schema::message! {
    OperatorKeys: "probecell_msgs", "msg", "OperatorKeys",
    "RIHS01_1d31cbf8f67b8092e2bf10ec95e566c799bf949c6caee014d15175654e90cf9b",
    concat!(
        include_str!("../msg/OperatorKeys.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["number", 9, 0, 0, "", ""]
    ["names", 161, 0, 0, "", ""]
    ["keys", 161, 0, 0, "", ""]
    ["withdrawn", 159, 0, 0, "", ""]
    ["signature", 147, 0, 0, "", ""]
}

/// The answer of the node that serves an OperatorRequest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OperatorReply {
    pub header: crate::std_msgs::Header,
    pub request_id: u64,
    pub accepted: bool,
    /// reason for a refusal, or what was done
    pub text: String,
}

crate::schema::message! {
    OperatorReply: "probecell_msgs", "msg", "OperatorReply",
    "RIHS01_730edf6f9907bbc8d1c3d7e323247769dcbf8d7b0298e2acf640fedd51de0bcd",
    concat!(
        include_str!("../msg/OperatorReply.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["request_id", 9, 0, 0, "", ""]
    ["accepted", 15, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
}

/// A service call as it entered the graph, so that a replay can repeat it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OperatorRequest {
    pub header: crate::std_msgs::Header,
    /// from 0 in a session
    pub request_id: u64,
    /// plan: file of features or plan_id; run: part_id; approval: correction_id
    pub subject: String,
    /// who made the call
    pub operator_name: String,
    /// approval: true to approve, false to reject
    pub approve: bool,
    /// run: measure only this plan, or resume it; empty: make a part
    pub plan_id: String,
    /// plan: requests whose planning ends, in place of a plan; empty: a plan is made
    pub cancels: Vec<u64>,
    /// plan: points to touch in place of the part's, or to touch again; empty: the part's
    pub points: Vec<InspectionPoint>,
    /// run: refused after this instant by the clock of the cell; 0: never
    pub expires: crate::builtin_interfaces::Time,
    /// instant of the act, by the clock of the cell
    pub signed_at: crate::builtin_interfaces::Time,
    /// what the operator was shown: text, or `sha256:` and its digest
    pub shown: String,
    /// ed25519, 64 bytes: see docs/approvals.md. Empty: not signed
    pub signature: Vec<u8>,
}

crate::schema::message! {
    OperatorRequest: "probecell_msgs", "msg", "OperatorRequest",
    "RIHS01_84125452c393b594aa9565f72f41e65f28799d13cb993b3ed1ba4ebc1863cf26",
    concat!(
        include_str!("../msg/OperatorRequest.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: probecell_msgs/InspectionPoint\n",
        include_str!("../msg/InspectionPoint.msg"),
        "================================================================================\nMSG: geometry_msgs/Point\n",
        include_str!("../standard/geometry_msgs/msg/Point.msg"),
        "================================================================================\nMSG: geometry_msgs/Vector3\n",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["request_id", 9, 0, 0, "", ""]
    ["subject", 17, 0, 0, "", ""]
    ["operator_name", 17, 0, 0, "", ""]
    ["approve", 15, 0, 0, "", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["cancels", 153, 0, 0, "", ""]
    ["points", 145, 0, 0, "probecell_msgs/msg/InspectionPoint", ""]
    ["expires", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    ["signed_at", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    ["shown", 17, 0, 0, "", ""]
    ["signature", 147, 0, 0, "", ""]
}

/// An order of a cell: parts of one name, made one after the other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// from 1; a cell gives no number twice
    pub order_id: u64,
    /// name of its parts
    pub part_id: String,
    /// parts ordered
    pub count: u32,
    /// parts of them begun so far
    pub begun: u32,
    /// one of the constants above
    pub state: u8,
    /// run of the part begun last; empty: none, or it did not begin
    pub run_id: String,
    /// who placed it
    pub operator_name: String,
}

impl Order {
    /// its next part waits for its turn
    pub const WAITING: u8 = 0;
    /// a part of it is being made
    pub const UNDERWAY: u8 = 1;
    /// its last part was stopped or lost: an operator resumes or cancels it
    pub const INTERRUPTED: u8 = 2;
}

crate::code::codes! {
    /// Values of `Order.state`.
    pub enum OrderState of "Order.state" {
        /// its next part waits for its turn
        Waiting = 0,
        /// a part of it is being made
        Underway = 1,
        /// its last part was stopped or lost: an operator resumes or cancels it
        Interrupted = 2,
    }
}

crate::schema::message! {
    Order: "probecell_msgs", "msg", "Order",
    "RIHS01_d293363df6cf4b130dad1254d109fa9e7fbad2302829c3f0a0b8cc19705241eb",
    include_str!("../msg/Order.msg"),
    ["order_id", 9, 0, 0, "", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["count", 7, 0, 0, "", ""]
    ["begun", 7, 0, 0, "", ""]
    ["state", 3, 0, 0, "", ""]
    ["run_id", 17, 0, 0, "", ""]
    ["operator_name", 17, 0, 0, "", ""]
}

/// A change of the orders of a cell, as it entered the graph from the service manage_orders, so that a replay can repeat it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OrderRequest {
    pub header: crate::std_msgs::Header,
    /// from 0 in a session
    pub request_id: u64,
    /// one of the constants above
    pub kind: u8,
    /// ADD: its number, which the launcher gives; RESUME: 0 for no order
    pub order_id: u64,
    /// ADD: name of its parts
    pub part_id: String,
    /// ADD: parts ordered, from 1
    pub count: u32,
    /// MOVE: place in the list, from 1
    pub position: u32,
    /// who asks; may be empty
    pub operator_name: String,
    /// refused after this instant by the clock of the cell
    pub expires: crate::builtin_interfaces::Time,
}

impl OrderRequest {
    pub const ADD: u8 = 1;
    /// of a part that is being made: no further one of its order follows
    pub const CANCEL: u8 = 2;
    pub const MOVE: u8 = 3;
    /// releases the orders; with an order_id, the part with which that order was interrupted is made again
    pub const RESUME: u8 = 4;
    /// no further part is begun
    pub const HOLD: u8 = 5;
}

crate::code::codes! {
    /// Values of `OrderRequest.kind`.
    pub enum OrderRequestKind of "OrderRequest.kind" {
        /// `ADD`.
        Add = 1,
        /// of a part that is being made: no further one of its order follows
        Cancel = 2,
        /// `MOVE`.
        Move = 3,
        /// releases the orders; with an order_id, the part with which that order was interrupted is made again
        Resume = 4,
        /// no further part is begun
        Hold = 5,
    }
}

crate::schema::message! {
    OrderRequest: "probecell_msgs", "msg", "OrderRequest",
    "RIHS01_b49955b5ecdff7ce971dd7be88373d83b6b2c3bfc004717b201fc848e577db77",
    concat!(
        include_str!("../msg/OrderRequest.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["request_id", 9, 0, 0, "", ""]
    ["kind", 3, 0, 0, "", ""]
    ["order_id", 9, 0, 0, "", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["count", 7, 0, 0, "", ""]
    ["position", 7, 0, 0, "", ""]
    ["operator_name", 17, 0, 0, "", ""]
    ["expires", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
}

/// The orders of a cell that are not done, in the order in which they are made. On orders as cycle has them, at every change;
/// on kept_orders as the launcher has written them to disk: no order begins before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Orders {
    pub header: crate::std_msgs::Header,
    /// of two states of the orders the later has the larger number
    pub revision: u64,
    /// largest order_id given so far
    pub last_id: u64,
    pub orders: Vec<Order>,
    /// why no further part is begun until an operator releases the orders; empty: they are made
    pub held: String,
}

crate::schema::message! {
    Orders: "probecell_msgs", "msg", "Orders",
    "RIHS01_aac3942e28a48f072829bd4fd896604081d5ded88dd56a606737eb4888b92ba4",
    concat!(
        include_str!("../msg/Orders.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: probecell_msgs/Order\n",
        include_str!("../msg/Order.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["revision", 9, 0, 0, "", ""]
    ["last_id", 9, 0, 0, "", ""]
    ["orders", 145, 0, 0, "probecell_msgs/msg/Order", ""]
    ["held", 17, 0, 0, "", ""]
}

/// Displacement of the part from its planned position, by its datums or by a best fit. Published on part_alignment:
/// reliable, transient local, depth 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PartAlignment {
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    pub part_id: String,
    /// one of the constants above
    pub method: u8,
    /// datums in order of precedence, or features of the best fit
    pub feature_ids: Vec<String>,
    /// sequence of each ProbeEvent used
    pub sequences: Vec<u64>,
    /// false: the part could not be aligned; text says why
    pub valid: bool,
    /// A nominal point p of the part lies at R p + shift, with R the rotation by the vector below.
    /// m, of the part frame's origin
    pub shift: crate::geometry_msgs::Vector3,
    /// rad, rotation vector of the part about the planned origin, planned part frame
    pub rotation: crate::geometry_msgs::Vector3,
    /// m or rad, products: 6 x 6 of shift and rotation, row by row; empty where not valid
    pub covariance: Vec<f64>,
    /// m, residual deviation of a best fit; 0 with datums
    pub rms: f64,
    pub text: String,
}

impl PartAlignment {
    /// ISO 5459, in order of precedence
    pub const DATUMS: u8 = 0;
    /// least squares of the deviations along the normals
    pub const BEST_FIT: u8 = 1;
}

crate::code::codes! {
    /// Values of `PartAlignment.method`.
    pub enum PartAlignmentMethod of "PartAlignment.method" {
        /// ISO 5459, in order of precedence
        Datums = 0,
        /// least squares of the deviations along the normals
        BestFit = 1,
    }
}

crate::schema::message! {
    PartAlignment: "probecell_msgs", "msg", "PartAlignment",
    "RIHS01_499b7931a5015291b89cc4549755c244280c38af7d7d9563a8d17c96e66879e2",
    concat!(
        include_str!("../msg/PartAlignment.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: geometry_msgs/Vector3\n",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["method", 3, 0, 0, "", ""]
    ["feature_ids", 161, 0, 0, "", ""]
    ["sequences", 153, 0, 0, "", ""]
    ["valid", 15, 0, 0, "", ""]
    ["shift", 1, 0, 0, "geometry_msgs/msg/Vector3", ""]
    ["rotation", 1, 0, 0, "geometry_msgs/msg/Vector3", ""]
    ["covariance", 155, 0, 0, "", ""]
    ["rms", 11, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
}

/// The end of one part.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PartReport {
    pub header: crate::std_msgs::Header,
    pub part_id: String,
    /// one of the constants above
    pub verdict: u8,
    /// number of machining passes, recuts included
    pub passes: u32,
    pub text: String,
    /// MEASURED: the plan; else empty
    pub plan_id: String,
    /// identity of the run, unique in the session
    pub run_id: String,
}

impl PartReport {
    pub const QUALIFIED: u8 = 0;
    pub const SCRAP: u8 = 1;
    pub const STOPPED: u8 = 2;
    /// only measured, as requested: nothing was cut or decided
    pub const MEASURED: u8 = 3;
}

crate::code::codes! {
    /// Values of `PartReport.verdict`.
    pub enum PartReportVerdict of "PartReport.verdict" {
        /// `QUALIFIED`.
        Qualified = 0,
        /// `SCRAP`.
        Scrap = 1,
        /// `STOPPED`.
        Stopped = 2,
        /// only measured, as requested: nothing was cut or decided
        Measured = 3,
    }
}

crate::schema::message! {
    PartReport: "probecell_msgs", "msg", "PartReport",
    "RIHS01_e0ecbe9d9c0a294226f87977d9f1d2e5d178628ffa0dcac15e8e80b0417fb499",
    concat!(
        include_str!("../msg/PartReport.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["verdict", 3, 0, 0, "", ""]
    ["passes", 7, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["run_id", 17, 0, 0, "", ""]
}

/// The part that is being made, as cycle has it, at every change and once a second while it is made. On supervised_part the
/// same as machine_state has it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PartStatus {
    pub header: crate::std_msgs::Header,
    /// one of the constants above
    pub stage: u8,
    /// number of the run in this session of the cell, from 1; 0: none so far
    pub run_number: u64,
    /// identity of the run, unique in the session; begins with the name of the part
    pub run_id: String,
    /// name that the operator gave the part
    pub part_id: String,
    /// number of the machining pass, from 0
    pub pass_number: u32,
    /// CUTTING: the operation
    pub operation: String,
    /// the plan measured or decided on; empty while cutting
    pub plan_id: String,
    /// begin of the stage
    pub since: crate::builtin_interfaces::Time,
    /// the part is stopped when the stage lasts longer
    pub deadline: crate::builtin_interfaces::Time,
}

impl PartStatus {
    /// no part is being made
    pub const NONE: u8 = 0;
    pub const CUTTING: u8 = 1;
    pub const MEASURING: u8 = 2;
    /// measured; the decision is awaited
    pub const DECIDING: u8 = 3;
    /// the acknowledgements of corrections are awaited
    pub const CORRECTING: u8 = 4;
    /// the machine has been told to stop; its confirmation is awaited
    pub const STOPPING: u8 = 5;
}

crate::code::codes! {
    /// Values of `PartStatus.stage`.
    pub enum PartStatusStage of "PartStatus.stage" {
        /// no part is being made
        None = 0,
        /// `CUTTING`.
        Cutting = 1,
        /// `MEASURING`.
        Measuring = 2,
        /// measured; the decision is awaited
        Deciding = 3,
        /// the acknowledgements of corrections are awaited
        Correcting = 4,
        /// the machine has been told to stop; its confirmation is awaited
        Stopping = 5,
    }
}

crate::schema::message! {
    PartStatus: "probecell_msgs", "msg", "PartStatus",
    "RIHS01_482c33732ce626ba60f1925c37cc6e5923aec4a260ea0d98e08010e787210e29",
    concat!(
        include_str!("../msg/PartStatus.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["stage", 3, 0, 0, "", ""]
    ["run_number", 9, 0, 0, "", ""]
    ["run_id", 17, 0, 0, "", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["pass_number", 7, 0, 0, "", ""]
    ["operation", 17, 0, 0, "", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["since", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    ["deadline", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
}

/// What follows from the verdicts of one measurement together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PassDecision {
    pub header: crate::std_msgs::Header,
    /// the measurement that was decided on
    pub plan_id: String,
    pub part_id: String,
    /// number of the machining pass, from 0
    pub pass_number: u32,
    /// one of the constants above
    pub decision: u8,
    /// corrections that must be applied before a recut
    pub correction_ids: Vec<String>,
    pub text: String,
}

impl PassDecision {
    /// all qualified: continue with the next pass
    pub const NEXT: u8 = 0;
    /// cut again, or measure again in a pass without operations, once correction_ids are acknowledged
    pub const RECUT: u8 = 1;
    /// stop: somebody must intervene
    pub const STOP: u8 = 2;
    /// the part cannot be saved
    pub const SCRAP: u8 = 3;
    /// a reference measurement refutes what was decided on before; no further part is made
    pub const REVOKED: u8 = 4;
}

crate::code::codes! {
    /// Values of `PassDecision.decision`.
    pub enum PassDecisionCode of "PassDecision.decision" {
        /// all qualified: continue with the next pass
        Next = 0,
        /// cut again, or measure again in a pass without operations, once correction_ids are acknowledged
        Recut = 1,
        /// stop: somebody must intervene
        Stop = 2,
        /// the part cannot be saved
        Scrap = 3,
        /// a reference measurement refutes what was decided on before; no further part is made
        Revoked = 4,
    }
}

crate::schema::message! {
    PassDecision: "probecell_msgs", "msg", "PassDecision",
    "RIHS01_27d89d4378b692f2bf1e7db115a1a7f5f2fb4f86fb5bcd97bcc9f75c6d36df1d",
    concat!(
        include_str!("../msg/PassDecision.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["pass_number", 7, 0, 0, "", ""]
    ["decision", 3, 0, 0, "", ""]
    ["correction_ids", 161, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
}

/// Progress of path planning with the order under way. Published on plan_progress after every step of the computation:
/// reliable, volatile, keep all. Clients that wait for the plan restart their timeout on every message.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanProgress {
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    /// number of touches of the order
    pub touches: u32,
    /// one of the constants above
    pub phase: u8,
    /// ratio, 0 to 1, of the phase that is complete
    pub share: f64,
    /// s, moves between touches in the best order so far; 0 before there is one
    pub air_time: f64,
    /// s, the same in the order in which the plan lists them; 0 before it is known
    pub given_air_time: f64,
    /// m, path of the ball centre in the part frame between touches in the order made; 0 before DONE
    pub air_length: f64,
    /// m, the same in the order in which the plan lists them; 0 before DONE
    pub given_air_length: f64,
}

impl PlanProgress {
    /// computes collision-free paths between touches; no order is known yet
    pub const TRANSITS: u8 = 0;
    /// searches for a shorter order
    pub const SEARCHING: u8 = 1;
    /// the order is published; last message of this job
    pub const DONE: u8 = 2;
    /// the job was cancelled or failed; last message of this job
    pub const GIVEN_UP: u8 = 3;
}

crate::code::codes! {
    /// Values of `PlanProgress.phase`.
    pub enum PlanProgressPhase of "PlanProgress.phase" {
        /// computes collision-free paths between touches; no order is known yet
        Transits = 0,
        /// searches for a shorter order
        Searching = 1,
        /// the order is published; last message of this job
        Done = 2,
        /// the job was cancelled or failed; last message of this job
        GivenUp = 3,
    }
}

crate::schema::message! {
    PlanProgress: "probecell_msgs", "msg", "PlanProgress",
    "RIHS01_552f037057c5cb1ad422fa7f361448fe145ba9d92caa543c9e8409d984132549",
    concat!(
        include_str!("../msg/PlanProgress.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["touches", 7, 0, 0, "", ""]
    ["phase", 3, 0, 0, "", ""]
    ["share", 11, 0, 0, "", ""]
    ["air_time", 11, 0, 0, "", ""]
    ["given_air_time", 11, 0, 0, "", ""]
    ["air_length", 11, 0, 0, "", ""]
    ["given_air_length", 11, 0, 0, "", ""]
}

/// A probing move and its outcome. Published on probe_events: reliable, volatile, keep all.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProbeEvent {
    /// stamp: instant of the latch; frame_id: the part frame
    pub header: crate::std_msgs::Header,
    /// from 0 in a session, no gaps
    pub sequence: u64,
    /// the InspectionPlan measured
    pub plan_id: String,
    /// index into the plan's points
    pub point_index: u32,
    /// one of OUTCOME_*
    pub outcome: u8,
    /// joints of the machine model
    pub axis_names: Vec<String>,
    /// m or rad, controller readings latched at the trigger
    pub axis_positions: Vec<f64>,
    /// m, ball centre in the part frame as the controller computes it
    pub tip: crate::geometry_msgs::Point,
    /// unit vector of the approach, part frame
    pub approach: crate::geometry_msgs::Vector3,
    /// m/s, along the approach
    pub feed: f64,
}

impl ProbeEvent {
    /// the probe triggered where it could
    pub const OUTCOME_TOUCHED: u8 = 0;
    /// the move ended without a trigger
    pub const OUTCOME_NO_CONTACT: u8 = 1;
    /// the probe triggered before the approach point
    pub const OUTCOME_EARLY: u8 = 2;
}

crate::code::codes! {
    /// Values of `ProbeEvent.outcome`.
    pub enum ProbeEventOutcome of "ProbeEvent.outcome" {
        /// the probe triggered where it could
        Touched = 0,
        /// the move ended without a trigger
        NoContact = 1,
        /// the probe triggered before the approach point
        Early = 2,
    }
}

crate::schema::message! {
    ProbeEvent: "probecell_msgs", "msg", "ProbeEvent",
    "RIHS01_1a28af8cda78a10943741962b654ce9018e1e7760c70e3e53ba61ed97423f032",
    concat!(
        include_str!("../msg/ProbeEvent.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        "================================================================================\nMSG: geometry_msgs/Point\n",
        include_str!("../standard/geometry_msgs/msg/Point.msg"),
        "================================================================================\nMSG: geometry_msgs/Vector3\n",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["sequence", 9, 0, 0, "", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["point_index", 7, 0, 0, "", ""]
    ["outcome", 3, 0, 0, "", ""]
    ["axis_names", 161, 0, 0, "", ""]
    ["axis_positions", 155, 0, 0, "", ""]
    ["tip", 1, 0, 0, "geometry_msgs/msg/Point", ""]
    ["approach", 1, 0, 0, "geometry_msgs/msg/Vector3", ""]
    ["feed", 11, 0, 0, "", ""]
}

/// The raw end of a probing move, as the driver read it. Only probe_events subscribes to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProbeTrigger {
    /// stamp: instant of the latch, or of the end of the move without one
    pub header: crate::std_msgs::Header,
    /// session of the driver
    pub session: String,
    /// plan whose measuring program ran
    pub plan_id: String,
    /// index into the plan's points
    pub point_index: u32,
    /// the probe triggered during the move
    pub tripped: bool,
    /// the probe was already tripped when the move began
    pub tripped_before: bool,
    pub axis_names: Vec<String>,
    /// m or rad, latched readings
    pub axis_positions: Vec<f64>,
    /// m/s, programmed
    pub feed: f64,
    /// from 0 in a session of the driver, no gaps; the number of the touch everywhere
    pub sequence: u64,
}

crate::schema::message! {
    ProbeTrigger: "probecell_msgs", "msg", "ProbeTrigger",
    "RIHS01_0b967c8507dabe54841772d908a64e985f24bc28589a0eadf62fb66bbd380bca",
    concat!(
        include_str!("../msg/ProbeTrigger.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["session", 17, 0, 0, "", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["point_index", 7, 0, 0, "", ""]
    ["tripped", 15, 0, 0, "", ""]
    ["tripped_before", 15, 0, 0, "", ""]
    ["axis_names", 161, 0, 0, "", ""]
    ["axis_positions", 155, 0, 0, "", ""]
    ["feed", 11, 0, 0, "", ""]
    ["sequence", 9, 0, 0, "", ""]
}

/// One move of a measuring program, as joint targets.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProbingMove {
    /// one of the constants above
    pub kind: u8,
    /// index into the plan's points
    pub point_index: u32,
    /// m or rad, of the order's axis_names
    pub axis_positions: Vec<f64>,
    /// m/s, 0: rapid
    pub feed: f64,
}

impl ProbingMove {
    /// rapid, clear of part and fixture
    pub const CLEARANCE: u8 = 0;
    /// rapid to the start of the approach
    pub const APPROACH: u8 = 1;
    /// at probing feed until the trigger
    pub const TOUCH: u8 = 2;
    /// back along the normal
    pub const RETRACT: u8 = 3;
}

crate::code::codes! {
    /// Values of `ProbingMove.kind`.
    pub enum ProbingMoveKind of "ProbingMove.kind" {
        /// rapid, clear of part and fixture
        Clearance = 0,
        /// rapid to the start of the approach
        Approach = 1,
        /// at probing feed until the trigger
        Touch = 2,
        /// back along the normal
        Retract = 3,
    }
}

crate::schema::message! {
    ProbingMove: "probecell_msgs", "msg", "ProbingMove",
    "RIHS01_6ebd6abfec91d8948556adc7e72fdc8e2507a208b9b2f8f82ea4498b309e9771",
    include_str!("../msg/ProbingMove.msg"),
    ["kind", 3, 0, 0, "", ""]
    ["point_index", 7, 0, 0, "", ""]
    ["axis_positions", 155, 0, 0, "", ""]
    ["feed", 11, 0, 0, "", ""]
}

/// Whether the cell is recorded, at every change and once a second. Without a recording no operation starts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RecordingStatus {
    pub header: crate::std_msgs::Header,
    /// one of the constants above
    pub state: u8,
    /// folder that is being written
    pub uri: String,
    /// s after its arrival for which it holds; 0: until the next
    pub validity: f64,
}

impl RecordingStatus {
    pub const STOPPED: u8 = 0;
    pub const RECORDING: u8 = 1;
    /// the operator has started the cell without a recorder
    pub const WAIVED: u8 = 2;
}

crate::code::codes! {
    /// Values of `RecordingStatus.state`.
    pub enum RecordingStatusState of "RecordingStatus.state" {
        /// `STOPPED`.
        Stopped = 0,
        /// `RECORDING`.
        Recording = 1,
        /// the operator has started the cell without a recorder
        Waived = 2,
    }
}

crate::schema::message! {
    RecordingStatus: "probecell_msgs", "msg", "RecordingStatus",
    "RIHS01_f450c3ee2011c913a745501c99f9fbfc780adfb5db8d4ceabf1f06f66e7cce70",
    concat!(
        include_str!("../msg/RecordingStatus.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["state", 3, 0, 0, "", ""]
    ["uri", 17, 0, 0, "", ""]
    ["validity", 11, 0, 0, "", ""]
}

/// The points of a plan as measured by an independent instrument. Published on reference: reliable, transient local, depth 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReferenceMeasurement {
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    /// for example the CMM's name
    pub instrument: String,
    /// indices into the plan's points
    pub point_index: Vec<u32>,
    /// m, along the outward normal, at 20 degree Celsius
    pub deviation: Vec<f64>,
    /// m
    pub standard_uncertainty: f64,
}

crate::schema::message! {
    ReferenceMeasurement: "probecell_msgs", "msg", "ReferenceMeasurement",
    "RIHS01_359bf1baf149895b70588f9d32c1a05a95c0d5e3334ab2eaf179f5a63de46f33",
    concat!(
        include_str!("../msg/ReferenceMeasurement.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["instrument", 17, 0, 0, "", ""]
    ["point_index", 151, 0, 0, "", ""]
    ["deviation", 155, 0, 0, "", ""]
    ["standard_uncertainty", 11, 0, 0, "", ""]
}

/// The inputs that a node processed, in which order and when: what a replay needs besides the inputs themselves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepJournal {
    pub header: crate::std_msgs::Header,
    pub node: String,
    /// number of earlier starts of this node in this session
    pub incarnation: u32,
    /// number of the first step listed
    pub first_step: u64,
    /// ns since 1970, the instant of each step
    pub now: Vec<i64>,
    /// index into the node's inputs; 65535: a timer
    pub port: Vec<u16>,
    /// publication number of the input on its topic, or the number of the timer
    pub sequence: Vec<u64>,
}

crate::schema::message! {
    StepJournal: "probecell_msgs", "msg", "StepJournal",
    "RIHS01_be6944072d8389999707e44615fdb528fa6b5f1c22cb0e5795ff41b1cf7259b8",
    concat!(
        include_str!("../msg/StepJournal.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["node", 17, 0, 0, "", ""]
    ["incarnation", 7, 0, 0, "", ""]
    ["first_step", 9, 0, 0, "", ""]
    ["now", 152, 0, 0, "", ""]
    ["port", 149, 0, 0, "", ""]
    ["sequence", 153, 0, 0, "", ""]
}

/// A stylus with its declared (nominal) geometry.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stylus {
    pub id: String,
    /// m, nominal ball centre in probe_mount
    pub ball_center: crate::geometry_msgs::Point,
    /// m, nominal
    pub ball_radius: f64,
}

crate::schema::message! {
    Stylus: "probecell_msgs", "msg", "Stylus",
    "RIHS01_681bbcb277598a20f6ac02fbfb1f346d47ed03ef3fb97123d5c6283f39ae8c31",
    concat!(
        include_str!("../msg/Stylus.msg"),
        "================================================================================\nMSG: geometry_msgs/Point\n",
        include_str!("../standard/geometry_msgs/msg/Point.msg")
    ),
    ["id", 17, 0, 0, "", ""]
    ["ball_center", 1, 0, 0, "geometry_msgs/msg/Point", ""]
    ["ball_radius", 11, 0, 0, "", ""]
}

/// Offsets that the controller holds: tool wear, volumetric table, work offsets. Published on tool_offsets: reliable,
/// transient local, depth 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ToolOffsets {
    /// stamp: of the controller sample in which they changed
    pub header: crate::std_msgs::Header,
    /// session of the driver that read them
    pub session: String,
    pub tool_numbers: Vec<u32>,
    /// m, wear offset of each tool, as the controller holds it (a diameter or a radius)
    pub wear: Vec<f64>,
    /// ISO 230-1 names (EX0C) of the entries of the volumetric table; empty: it has no such table
    pub volumetric_entries: Vec<String>,
    /// m or rad, value in force of each entry: 0 while the table is disabled
    pub volumetric_values: Vec<f64>,
    /// linear joints whose work offset the controller reports
    pub work_offset_axes: Vec<String>,
    /// m, work offset in force of each
    pub work_offsets: Vec<f64>,
}

crate::schema::message! {
    ToolOffsets: "probecell_msgs", "msg", "ToolOffsets",
    "RIHS01_63508265b665f42e115425936f9fe5c76a15e1d6a64d482009e3e549f4b8674a",
    concat!(
        include_str!("../msg/ToolOffsets.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["session", 17, 0, 0, "", ""]
    ["tool_numbers", 151, 0, 0, "", ""]
    ["wear", 155, 0, 0, "", ""]
    ["volumetric_entries", 161, 0, 0, "", ""]
    ["volumetric_values", 155, 0, 0, "", ""]
    ["work_offset_axes", 161, 0, 0, "", ""]
    ["work_offsets", 155, 0, 0, "", ""]
}

/// The deviation of one touch: d = n.(c - p) - r by the nominal chain.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TouchDeviation {
    /// stamp of the event
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    /// of the ProbeEvent
    pub sequence: u64,
    pub point_index: u32,
    /// m, along the outward normal; material in excess is positive
    pub deviation: f64,
    /// m
    pub standard_uncertainty: f64,
}

crate::schema::message! {
    TouchDeviation: "probecell_msgs", "msg", "TouchDeviation",
    "RIHS01_e66251adbe9e71aeb7b06016ac7efa80efd1da22768a7285299c7a3db1c336aa",
    concat!(
        include_str!("../msg/TouchDeviation.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["sequence", 9, 0, 0, "", ""]
    ["point_index", 7, 0, 0, "", ""]
    ["deviation", 11, 0, 0, "", ""]
    ["standard_uncertainty", 11, 0, 0, "", ""]
}

/// The decision on one measured size, on the position of the part, or on the errors of the machine. The first matching row
/// of the decision table applies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    pub header: crate::std_msgs::Header,
    pub plan_id: String,
    pub part_id: String,
    /// or the id of the volumetric table or of the work offset
    pub feature_id: String,
    /// number of the machining pass, from 0
    pub pass_number: u32,
    /// one of the constants above
    pub verdict: u8,
    /// m, measured
    pub size: f64,
    /// m, measured minus drawing size; of the volumetric table the largest displacement of the tip
    pub error: f64,
    /// that the estimated errors cause over the poses measured
    /// m, half width of the tolerance
    pub tolerance: f64,
    /// m, wear offset in force
    pub tool_wear: f64,
    /// decision rule, its risk, and what else is to be known of the verdict
    pub text: String,
}

impl Verdict {
    pub const QUALIFIED: u8 = 0;
    pub const COMPENSABLE: u8 = 1;
    pub const OVERCUT_NOT_COMPENSABLE: u8 = 2;
    pub const TOOL_WORN: u8 = 3;
    pub const NOT_CONVERGED: u8 = 4;
    pub const MEASUREMENT_INVALID: u8 = 5;
    /// conformity is neither proved nor refuted by the decision rule of the cell file
    pub const INDETERMINATE: u8 = 6;
    /// a reference measurement of the same plan refutes the verdict published before
    pub const CONTRADICTED: u8 = 7;
}

crate::code::codes! {
    /// Values of `Verdict.verdict`.
    pub enum VerdictCode of "Verdict.verdict" {
        /// `QUALIFIED`.
        Qualified = 0,
        /// `COMPENSABLE`.
        Compensable = 1,
        /// `OVERCUT_NOT_COMPENSABLE`.
        OvercutNotCompensable = 2,
        /// `TOOL_WORN`.
        ToolWorn = 3,
        /// `NOT_CONVERGED`.
        NotConverged = 4,
        /// `MEASUREMENT_INVALID`.
        MeasurementInvalid = 5,
        /// conformity is neither proved nor refuted by the decision rule of the cell file
        Indeterminate = 6,
        /// a reference measurement of the same plan refutes the verdict published before
        Contradicted = 7,
    }
}

crate::schema::message! {
    Verdict: "probecell_msgs", "msg", "Verdict",
    "RIHS01_044904f64d874d0bb3aeee0cf8bf8d322c32c39884d9948812334a9468365ead",
    concat!(
        include_str!("../msg/Verdict.msg"),
        "================================================================================\nMSG: std_msgs/Header\n",
        include_str!("../standard/std_msgs/msg/Header.msg"),
        "================================================================================\nMSG: builtin_interfaces/Time\n",
        include_str!("../standard/builtin_interfaces/msg/Time.msg")
    ),
    ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
    ["plan_id", 17, 0, 0, "", ""]
    ["part_id", 17, 0, 0, "", ""]
    ["feature_id", 17, 0, 0, "", ""]
    ["pass_number", 7, 0, 0, "", ""]
    ["verdict", 3, 0, 0, "", ""]
    ["size", 11, 0, 0, "", ""]
    ["error", 11, 0, 0, "", ""]
    ["tolerance", 11, 0, 0, "", ""]
    ["tool_wear", 11, 0, 0, "", ""]
    ["text", 17, 0, 0, "", ""]
}

/// Services, and the messages that they are made of.
pub mod srv {
    use serde::{Deserialize, Serialize};

    /// Approve or reject a proposed correction. Without a signature it is refused, unless the cell file allows that.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct ApproveCorrection;

    crate::schema::service! {
        ApproveCorrection(ApproveCorrectionRequest) -> ApproveCorrectionResponse: "probecell_msgs", "srv", "ApproveCorrection",
        "RIHS01_0a7f077683d94d64d3939e9838f0fa7866f8d1f21fe0b86f93dfb72b3e438c09"
    }

    /// Asks [`ApproveCorrection`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ApproveCorrectionRequest {
        pub correction_id: String,
        pub operator_name: String,
        pub approve: bool,
        /// instant of the act, by the clock of the cell (service status)
        pub signed_at: crate::builtin_interfaces::Time,
        /// what the operator was shown: text, or `sha256:` and its digest
        pub shown: String,
        /// ed25519, 64 bytes: see docs/approvals.md. Empty: not signed
        pub signature: Vec<u8>,
    }

    crate::schema::message! {
        ApproveCorrectionRequest: "probecell_msgs", "srv", "ApproveCorrection_Request",
        "RIHS01_278412bcb2741c62878faef7c9f58ad1301d12754eab7a4bfd41d8c8a429e502",
        concat!(
            "# Approve or reject a proposed correction. Without a signature it is refused, unless the cell file allows that.\nstring correction_id\nstring operator_name\nbool approve\nbuiltin_interfaces/Time signed_at   # instant of the act, by the clock of the cell (service status)\nstring shown                 # what the operator was shown: text, or `sha256:` and its digest\nuint8[] signature            # ed25519, 64 bytes: see docs/approvals.md. Empty: not signed\n",
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["correction_id", 17, 0, 0, "", ""]
        ["operator_name", 17, 0, 0, "", ""]
        ["approve", 15, 0, 0, "", ""]
        ["signed_at", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["shown", 17, 0, 0, "", ""]
        ["signature", 147, 0, 0, "", ""]
    }

    /// Answers [`ApproveCorrection`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ApproveCorrectionResponse {
        pub accepted: bool,
        pub text: String,
    }

    crate::schema::message! {
        ApproveCorrectionResponse: "probecell_msgs", "srv", "ApproveCorrection_Response",
        "RIHS01_6138cb83093d090df8962e2f3c7c29859b097273aca5aeab28f9044fd34e2c73",
        "bool accepted\nstring text\n",
        ["accepted", 15, 0, 0, "", ""]
        ["text", 17, 0, 0, "", ""]
    }

    /// List or change the orders of the cell.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct ManageOrders;

    crate::schema::service! {
        ManageOrders(ManageOrdersRequest) -> ManageOrdersResponse: "probecell_msgs", "srv", "ManageOrders",
        "RIHS01_75f902a2f7c41580850c79a8bd90d92bed323b0e2fcfbabdebc3c630bc36608e"
    }

    /// Asks [`ManageOrders`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ManageOrdersRequest {
        /// OrderRequest kind; 0: list them, change nothing
        pub kind: u8,
        /// CANCEL, MOVE, RESUME: the order; RESUME: 0 for no order
        pub order_id: u64,
        /// ADD: name of its parts
        pub part_id: String,
        /// ADD: parts ordered, from 1
        pub count: u32,
        /// MOVE: place in the list, from 1
        pub position: u32,
        /// who asks; may be empty
        pub operator_name: String,
    }

    crate::schema::message! {
        ManageOrdersRequest: "probecell_msgs", "srv", "ManageOrders_Request",
        "RIHS01_1c837ae56bf9827f046c13d8a4fae182ff304ddc941c4d1a78f7f309b1b12e54",
        "# List or change the orders of the cell.\nuint8 kind                   # OrderRequest kind; 0: list them, change nothing\nuint64 order_id              # CANCEL, MOVE, RESUME: the order; RESUME: 0 for no order\nstring part_id               # ADD: name of its parts\nuint32 count                 # ADD: parts ordered, from 1\nuint32 position              # MOVE: place in the list, from 1\nstring operator_name         # who asks; may be empty\n",
        ["kind", 3, 0, 0, "", ""]
        ["order_id", 9, 0, 0, "", ""]
        ["part_id", 17, 0, 0, "", ""]
        ["count", 7, 0, 0, "", ""]
        ["position", 7, 0, 0, "", ""]
        ["operator_name", 17, 0, 0, "", ""]
    }

    /// Answers [`ManageOrders`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ManageOrdersResponse {
        /// the orders are changed, on disk too
        pub accepted: bool,
        /// reason for a refusal
        pub text: String,
        /// ADD: the number of the order
        pub order_id: u64,
        /// the orders after the change
        pub orders: crate::Orders,
    }

    crate::schema::message! {
        ManageOrdersResponse: "probecell_msgs", "srv", "ManageOrders_Response",
        "RIHS01_83c651c7a798406540d7e9f8ff3385395c2e5330fa5d2864b471af7898e5e34d",
        concat!(
            "bool accepted                # the orders are changed, on disk too\nstring text                  # reason for a refusal\nuint64 order_id              # ADD: the number of the order\nprobecell_msgs/Orders orders # the orders after the change\n",
            "================================================================================\nMSG: probecell_msgs/Orders\n",
            include_str!("../msg/Orders.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: probecell_msgs/Order\n",
            include_str!("../msg/Order.msg")
        ),
        ["accepted", 15, 0, 0, "", ""]
        ["text", 17, 0, 0, "", ""]
        ["order_id", 9, 0, 0, "", ""]
        ["orders", 1, 0, 0, "probecell_msgs/msg/Orders", ""]
    }

    /// Plan the measuring order of the cell's part, of additional touches of the part in the machine, or of the rest of a plan.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Plan;

    crate::schema::service! {
        Plan(PlanRequest) -> PlanResponse: "probecell_msgs", "srv", "Plan",
        "RIHS01_f562c32f65f73b981f1cd7a0c1e882f53a29c2b69f7b72da7c7423e31db7500a"
    }

    /// Asks [`Plan`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanRequest {
        /// empty: the cell's own plan; the plan measured last: its remaining points, until something is cut
        pub plan_id: String,
        /// empty: all. Else these, on features of the cell's plan; of the plan measured last: touched again
        pub points: Vec<crate::InspectionPoint>,
    }

    crate::schema::message! {
        PlanRequest: "probecell_msgs", "srv", "Plan_Request",
        "RIHS01_dc3b3ca076163b1f46cd0b9aa648275f6d3a9031a677bea24e1ba75d49bc5312",
        concat!(
            "# Plan the measuring order of the cell's part, of additional touches of the part in the machine, or of the rest of a plan.\nstring plan_id               # empty: the cell's own plan; the plan measured last: its remaining points, until something is cut\nprobecell_msgs/InspectionPoint[] points   # empty: all. Else these, on features of the cell's plan; of the plan measured last: touched again\n",
            "================================================================================\nMSG: probecell_msgs/InspectionPoint\n",
            include_str!("../msg/InspectionPoint.msg"),
            "================================================================================\nMSG: geometry_msgs/Point\n",
            include_str!("../standard/geometry_msgs/msg/Point.msg"),
            "================================================================================\nMSG: geometry_msgs/Vector3\n",
            include_str!("../standard/geometry_msgs/msg/Vector3.msg")
        ),
        ["plan_id", 17, 0, 0, "", ""]
        ["points", 145, 0, 0, "probecell_msgs/msg/InspectionPoint", ""]
    }

    /// Answers [`Plan`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanResponse {
        pub accepted: bool,
        /// reason for a refusal, or what was planned
        pub text: String,
    }

    crate::schema::message! {
        PlanResponse: "probecell_msgs", "srv", "Plan_Response",
        "RIHS01_345e374ce098525a196ea7d4ab2fa69045f1a5f8c5f64dc50874a795e5a27fa5",
        "bool accepted\nstring text                  # reason for a refusal, or what was planned\n",
        ["accepted", 15, 0, 0, "", ""]
        ["text", 17, 0, 0, "", ""]
    }

    /// Make one part; or, with a plan_id, only measure, or resume the measurement with which the last part ended.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Run;

    crate::schema::service! {
        Run(RunRequest) -> RunResponse: "probecell_msgs", "srv", "Run",
        "RIHS01_439b45b8dd5d8abc3d880db1fab806bf4b60318201ca2d74f3d79487e0cd68a2"
    }

    /// Asks [`Run`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunRequest {
        /// may be empty when resuming
        pub part_id: String,
        /// empty: make a part. A plan accepted by the service plan: measure it. The plan measured last: resume the part
        pub plan_id: String,
        /// nothing is started after this instant by the clock of the cell (service status); 0: 8 s after its arrival
        pub expires: crate::builtin_interfaces::Time,
        /// who has it made; may be empty
        pub operator_name: String,
        /// instant of the act, by the clock of the cell (service status)
        pub signed_at: crate::builtin_interfaces::Time,
        /// what the operator was shown: text, or `sha256:` and its digest
        pub shown: String,
        /// ed25519, 64 bytes: see docs/approvals.md. Empty: not signed
        pub signature: Vec<u8>,
    }

    crate::schema::message! {
        RunRequest: "probecell_msgs", "srv", "Run_Request",
        "RIHS01_54db4fbd6bc02f7eb194d2770019e37da998895ace01f030e37ac7dc7884429a",
        concat!(
            "# Make one part; or, with a plan_id, only measure, or resume the measurement with which the last part ended.\nstring part_id               # may be empty when resuming\nstring plan_id               # empty: make a part. A plan accepted by the service plan: measure it. The plan measured last: resume the part\nbuiltin_interfaces/Time expires   # nothing is started after this instant by the clock of the cell (service status); 0: 8 s after its arrival\nstring operator_name         # who has it made; may be empty\nbuiltin_interfaces/Time signed_at   # instant of the act, by the clock of the cell (service status)\nstring shown                 # what the operator was shown: text, or `sha256:` and its digest\nuint8[] signature            # ed25519, 64 bytes: see docs/approvals.md. Empty: not signed\n",
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["part_id", 17, 0, 0, "", ""]
        ["plan_id", 17, 0, 0, "", ""]
        ["expires", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["operator_name", 17, 0, 0, "", ""]
        ["signed_at", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["shown", 17, 0, 0, "", ""]
        ["signature", 147, 0, 0, "", ""]
    }

    /// Answers [`Run`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunResponse {
        pub accepted: bool,
        /// reason for a refusal
        pub text: String,
    }

    crate::schema::message! {
        RunResponse: "probecell_msgs", "srv", "Run_Response",
        "RIHS01_2520c2b2b1143ea7401ccc27775cd90b33c20b9ae2f516e493c564c23ff7c071",
        "bool accepted\nstring text                  # reason for a refusal\n",
        ["accepted", 15, 0, 0, "", ""]
        ["text", 17, 0, 0, "", ""]
    }

    /// Start a recording.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct StartRecording;

    crate::schema::service! {
        StartRecording(StartRecordingRequest) -> StartRecordingResponse: "probecell_msgs", "srv", "StartRecording",
        "RIHS01_81cb079bbca085fc0055a205086dfcd76a0f7e7fa999991b9dea1f60e9d904a2"
    }

    /// Asks [`StartRecording`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct StartRecordingRequest {
        /// name of a folder inside the cell's folder of recordings; empty: the recorder chooses
        pub uri: String,
    }

    crate::schema::message! {
        StartRecordingRequest: "probecell_msgs", "srv", "StartRecording_Request",
        "RIHS01_1c42275d11d33906a00a123b5067093f1c97c33c32fb70ad3533971f1e364a9d",
        "# Start a recording.\nstring uri                   # name of a folder inside the cell's folder of recordings; empty: the recorder chooses\n",
        ["uri", 17, 0, 0, "", ""]
    }

    /// Answers [`StartRecording`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct StartRecordingResponse {
        pub accepted: bool,
        /// folder that is written
        pub uri: String,
        pub text: String,
    }

    crate::schema::message! {
        StartRecordingResponse: "probecell_msgs", "srv", "StartRecording_Response",
        "RIHS01_2af2cbfae8e43d0576321c4a090d258bf65a8c5c6fac9b4a1656849d4ae21ab9",
        "bool accepted\nstring uri                   # folder that is written\nstring text\n",
        ["accepted", 15, 0, 0, "", ""]
        ["uri", 17, 0, 0, "", ""]
        ["text", 17, 0, 0, "", ""]
    }

    /// What the cell is doing.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Status;

    crate::schema::service! {
        Status(StatusRequest) -> StatusResponse: "probecell_msgs", "srv", "Status",
        "RIHS01_8aab5e1cf825917647ee2a2947e89e5f805dbf68d1a0de57cd022279ccdb399d"
    }

    /// Asks [`Status`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct StatusRequest {
        /// Always 0: CDR has no empty structures.
        pub structure_needs_at_least_one_member: u8,
    }

    crate::schema::message! {
        StatusRequest: "probecell_msgs", "srv", "Status_Request",
        "RIHS01_3a8c79be9bf61361ab23b7d8da6940919a59560f3f8c39ddc7c4efb1a6d35a88",
        "# What the cell is doing.\n",
        ["structure_needs_at_least_one_member", 3, 0, 0, "", ""]
    }

    /// Answers [`Status`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct StatusResponse {
        /// stamp: instant of the answer, by the clock of the cell
        pub header: crate::std_msgs::Header,
        /// MachineState.EXECUTION_*
        pub execution: u8,
        /// texts of the active alarms
        pub alarms: Vec<String>,
        /// the machine has reported its state within the last seconds
        pub machine_known: bool,
        /// the part that is being made
        pub part: crate::PartStatus,
        pub recording: crate::RecordingStatus,
        /// processes of the cell
        pub processes: Vec<String>,
        /// each of them runs
        pub running: Vec<bool>,
        /// times that each was started
        pub starts: Vec<u32>,
        /// the last faults, newest last, `node: code: text (AGE ago)`
        pub faults: Vec<String>,
    }

    crate::schema::message! {
        StatusResponse: "probecell_msgs", "srv", "Status_Response",
        "RIHS01_e43e7740bdc6bd6dd02f121e0c8a2db7e02d3da5017da0c8f285fa08f1b5c636",
        concat!(
            "std_msgs/Header header       # stamp: instant of the answer, by the clock of the cell\nuint8 execution              # MachineState.EXECUTION_*\nstring[] alarms              # texts of the active alarms\nbool machine_known           # the machine has reported its state within the last seconds\nprobecell_msgs/PartStatus part   # the part that is being made\nprobecell_msgs/RecordingStatus recording\nstring[] processes           # processes of the cell\nbool[] running               # each of them runs\nuint32[] starts              # times that each was started\nstring[] faults              # the last faults, newest last, `node: code: text (AGE ago)`\n",
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: probecell_msgs/PartStatus\n",
            include_str!("../msg/PartStatus.msg"),
            "================================================================================\nMSG: probecell_msgs/RecordingStatus\n",
            include_str!("../msg/RecordingStatus.msg")
        ),
        ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
        ["execution", 3, 0, 0, "", ""]
        ["alarms", 161, 0, 0, "", ""]
        ["machine_known", 15, 0, 0, "", ""]
        ["part", 1, 0, 0, "probecell_msgs/msg/PartStatus", ""]
        ["recording", 1, 0, 0, "probecell_msgs/msg/RecordingStatus", ""]
        ["processes", 161, 0, 0, "", ""]
        ["running", 159, 0, 0, "", ""]
        ["starts", 151, 0, 0, "", ""]
        ["faults", 161, 0, 0, "", ""]
    }

    /// Stop the machine and the part that is being made.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Stop;

    crate::schema::service! {
        Stop(StopRequest) -> StopResponse: "probecell_msgs", "srv", "Stop",
        "RIHS01_a1864f646148aa9470b235edc1d067f81bcbc2010f357369bfac13d601c120c3"
    }

    /// Asks [`Stop`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct StopRequest {
        /// who stops it
        pub operator_name: String,
        /// instant of the act, by the clock of the cell (service status)
        pub signed_at: crate::builtin_interfaces::Time,
        /// what the operator was shown: text, or `sha256:` and its digest
        pub shown: String,
        /// ed25519, 64 bytes: see docs/approvals.md. Empty: not signed
        pub signature: Vec<u8>,
    }

    crate::schema::message! {
        StopRequest: "probecell_msgs", "srv", "Stop_Request",
        "RIHS01_b9a02d0090af3f5614a55674d98428394b45230f2b7a21fed51294878c5c6fdd",
        concat!(
            "# Stop the machine and the part that is being made.\nstring operator_name         # who stops it\nbuiltin_interfaces/Time signed_at   # instant of the act, by the clock of the cell (service status)\nstring shown                 # what the operator was shown: text, or `sha256:` and its digest\nuint8[] signature            # ed25519, 64 bytes: see docs/approvals.md. Empty: not signed\n",
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["operator_name", 17, 0, 0, "", ""]
        ["signed_at", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["shown", 17, 0, 0, "", ""]
        ["signature", 147, 0, 0, "", ""]
    }

    /// Answers [`Stop`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct StopResponse {
        /// the machine has confirmed that it stands
        pub accepted: bool,
        /// why it has not
        pub text: String,
    }

    crate::schema::message! {
        StopResponse: "probecell_msgs", "srv", "Stop_Response",
        "RIHS01_d0aebe4c9566cf7c36c6ae8b6d00e714f59bb3bd97c94e65eb3cb8f64a2cf229",
        "bool accepted                # the machine has confirmed that it stands\nstring text                  # why it has not\n",
        ["accepted", 15, 0, 0, "", ""]
        ["text", 17, 0, 0, "", ""]
    }

    /// Stop the recording and close its files.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct StopRecording;

    crate::schema::service! {
        StopRecording(StopRecordingRequest) -> StopRecordingResponse: "probecell_msgs", "srv", "StopRecording",
        "RIHS01_06aa999f8d68973947068a8427e25a93ee9cd2ebea03c2a03a2103411064b310"
    }

    /// Asks [`StopRecording`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct StopRecordingRequest {
        /// Always 0: CDR has no empty structures.
        pub structure_needs_at_least_one_member: u8,
    }

    crate::schema::message! {
        StopRecordingRequest: "probecell_msgs", "srv", "StopRecording_Request",
        "RIHS01_bee8862c0e2985b3fb433a9e7927fae66397b2489c65bbd4f56bea526972b840",
        "# Stop the recording and close its files.\n",
        ["structure_needs_at_least_one_member", 3, 0, 0, "", ""]
    }

    /// Answers [`StopRecording`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct StopRecordingResponse {
        pub accepted: bool,
        /// folder that was written
        pub uri: String,
        /// messages written
        pub messages: u64,
        pub text: String,
    }

    crate::schema::message! {
        StopRecordingResponse: "probecell_msgs", "srv", "StopRecording_Response",
        "RIHS01_18a1892d47d4997aeef751edff646829866675137b34b2ac994879365ea9caff",
        "bool accepted\nstring uri                   # folder that was written\nuint64 messages              # messages written\nstring text\n",
        ["accepted", 15, 0, 0, "", ""]
        ["uri", 17, 0, 0, "", ""]
        ["messages", 9, 0, 0, "", ""]
        ["text", 17, 0, 0, "", ""]
    }
}

/// Actions: messages and services that they are made of.
pub mod action {
    use serde::{Deserialize, Serialize};

    use crate::schema::Action;

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanMeasurementFeedback {
        /// after every step of the computation
        pub progress: crate::PlanProgress,
    }

    crate::schema::message! {
        PlanMeasurementFeedback: "probecell_msgs", "action", "PlanMeasurement_Feedback",
        "RIHS01_a646547c34de433b40cb5a2f60dff1528141dedaf6dc67d49671a42d1942d84d",
        concat!(
            "probecell_msgs/PlanProgress progress        # after every step of the computation\n",
            "================================================================================\nMSG: probecell_msgs/PlanProgress\n",
            include_str!("../msg/PlanProgress.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["progress", 1, 0, 0, "probecell_msgs/msg/PlanProgress", ""]
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanMeasurementFeedbackMessage {
        pub goal_id: crate::unique_identifier_msgs::UUID,
        pub feedback: PlanMeasurementFeedback,
    }

    crate::schema::message! {
        PlanMeasurementFeedbackMessage: "probecell_msgs", "action", "PlanMeasurement_FeedbackMessage",
        "RIHS01_f6e4727f2c2490d71666873f6fa797ca164ea7011183ab5e615b0f1c5a219139",
        concat!(
            "unique_identifier_msgs/UUID goal_id\nprobecell_msgs/action/PlanMeasurement_Feedback feedback\n",
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
            "================================================================================\nMSG: probecell_msgs/action/PlanMeasurement_Feedback\n",
            "probecell_msgs/PlanProgress progress        # after every step of the computation\n",
            "================================================================================\nMSG: probecell_msgs/PlanProgress\n",
            include_str!("../msg/PlanProgress.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["goal_id", 1, 0, 0, "unique_identifier_msgs/msg/UUID", ""]
        ["feedback", 1, 0, 0, "probecell_msgs/action/PlanMeasurement_Feedback", ""]
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanMeasurementGoal {
        /// empty: the cell's own plan; the plan measured last: its remaining points, until something is cut
        pub plan_id: String,
        /// empty: all. Else these, on features of the cell's plan; of the plan measured last: touched again
        pub points: Vec<crate::InspectionPoint>,
    }

    crate::schema::message! {
        PlanMeasurementGoal: "probecell_msgs", "action", "PlanMeasurement_Goal",
        "RIHS01_67a465b80a8b63f48aa4e89ddc3c12a592bd687086c596a01002e5191df10804",
        concat!(
            "# The service plan as an action: plan the measuring order of the cell's part, of additional touches of the part in the machine,\n# or of the rest of a plan. A goal is accepted while no other of this action is pursued, and reached when the order is made.\n# To cancel it is to end the search; nothing is planned then.\nstring plan_id               # empty: the cell's own plan; the plan measured last: its remaining points, until something is cut\nprobecell_msgs/InspectionPoint[] points   # empty: all. Else these, on features of the cell's plan; of the plan measured last: touched again\n",
            "================================================================================\nMSG: probecell_msgs/InspectionPoint\n",
            include_str!("../msg/InspectionPoint.msg"),
            "================================================================================\nMSG: geometry_msgs/Point\n",
            include_str!("../standard/geometry_msgs/msg/Point.msg"),
            "================================================================================\nMSG: geometry_msgs/Vector3\n",
            include_str!("../standard/geometry_msgs/msg/Vector3.msg")
        ),
        ["plan_id", 17, 0, 0, "", ""]
        ["points", 145, 0, 0, "probecell_msgs/msg/InspectionPoint", ""]
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanMeasurementResult {
        /// the plan whose order was made; empty: none was
        pub plan_id: String,
        /// number of touches of the order
        pub touches: u32,
        /// s, promised for the moves between touches in this order
        pub air_time: f64,
        /// s, the same in the order in which the plan lists them
        pub given_air_time: f64,
        /// m, path of the ball centre in the part frame between touches in this order
        pub air_length: f64,
        /// m, the same in the order in which the plan lists them
        pub given_air_length: f64,
        /// what was planned, or why not
        pub text: String,
    }

    crate::schema::message! {
        PlanMeasurementResult: "probecell_msgs", "action", "PlanMeasurement_Result",
        "RIHS01_1e1d3db1e4c602eb9d2c87d4a27872e10af22db1762826b9bf021ec7331b4b40",
        "string plan_id               # the plan whose order was made; empty: none was\nuint32 touches               # number of touches of the order\nfloat64 air_time             # s, promised for the moves between touches in this order\nfloat64 given_air_time       # s, the same in the order in which the plan lists them\nfloat64 air_length           # m, path of the ball centre in the part frame between touches in this order\nfloat64 given_air_length     # m, the same in the order in which the plan lists them\nstring text                  # what was planned, or why not\n",
        ["plan_id", 17, 0, 0, "", ""]
        ["touches", 7, 0, 0, "", ""]
        ["air_time", 11, 0, 0, "", ""]
        ["given_air_time", 11, 0, 0, "", ""]
        ["air_length", 11, 0, 0, "", ""]
        ["given_air_length", 11, 0, 0, "", ""]
        ["text", 17, 0, 0, "", ""]
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunPartFeedback {
        /// the part that is being made, at every change and once a second
        pub status: crate::PartStatus,
    }

    crate::schema::message! {
        RunPartFeedback: "probecell_msgs", "action", "RunPart_Feedback",
        "RIHS01_8a354af9291c05444cc0892a8f62eb077dafeb481aec7f7563465510f0fe9217",
        concat!(
            "probecell_msgs/PartStatus status            # the part that is being made, at every change and once a second\n",
            "================================================================================\nMSG: probecell_msgs/PartStatus\n",
            include_str!("../msg/PartStatus.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["status", 1, 0, 0, "probecell_msgs/msg/PartStatus", ""]
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunPartFeedbackMessage {
        pub goal_id: crate::unique_identifier_msgs::UUID,
        pub feedback: RunPartFeedback,
    }

    crate::schema::message! {
        RunPartFeedbackMessage: "probecell_msgs", "action", "RunPart_FeedbackMessage",
        "RIHS01_d60d6342a42198d42ccbc12fd780548bcc208c19002502b1e787781e9d5981a0",
        concat!(
            "unique_identifier_msgs/UUID goal_id\nprobecell_msgs/action/RunPart_Feedback feedback\n",
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
            "================================================================================\nMSG: probecell_msgs/action/RunPart_Feedback\n",
            "probecell_msgs/PartStatus status            # the part that is being made, at every change and once a second\n",
            "================================================================================\nMSG: probecell_msgs/PartStatus\n",
            include_str!("../msg/PartStatus.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["goal_id", 1, 0, 0, "unique_identifier_msgs/msg/UUID", ""]
        ["feedback", 1, 0, 0, "probecell_msgs/action/RunPart_Feedback", ""]
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunPartGoal {
        /// may be empty when resuming
        pub part_id: String,
        /// empty: make a part. A plan accepted by the service plan: measure it. The plan measured last: resume the part
        pub plan_id: String,
        /// nothing is started after this instant by the clock of the cell (service status); 0: 8 s after its arrival
        pub expires: crate::builtin_interfaces::Time,
        /// who has it made; may be empty
        pub operator_name: String,
        /// instant of the act, by the clock of the cell (service status)
        pub signed_at: crate::builtin_interfaces::Time,
        /// what the operator was shown: text, or `sha256:` and its digest
        pub shown: String,
        /// ed25519, 64 bytes: see docs/approvals.md. Empty: not signed
        pub signature: Vec<u8>,
    }

    crate::schema::message! {
        RunPartGoal: "probecell_msgs", "action", "RunPart_Goal",
        "RIHS01_ac9c8c2e2d3c6bcd2199a6a3938fa7b0225c6ae231702465dfa5a84611472461",
        concat!(
            "# The service run as an action: make one part; or, with a plan_id, only measure, or resume the measurement with which the\n# last part ended. The goal is accepted where the service would accept it, and reached when the part is reported. To cancel\n# it is to stop the machine and the part, as the service stop does.\nstring part_id               # may be empty when resuming\nstring plan_id               # empty: make a part. A plan accepted by the service plan: measure it. The plan measured last: resume the part\nbuiltin_interfaces/Time expires   # nothing is started after this instant by the clock of the cell (service status); 0: 8 s after its arrival\nstring operator_name         # who has it made; may be empty\nbuiltin_interfaces/Time signed_at   # instant of the act, by the clock of the cell (service status)\nstring shown                 # what the operator was shown: text, or `sha256:` and its digest\nuint8[] signature            # ed25519, 64 bytes: see docs/approvals.md. Empty: not signed\n",
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["part_id", 17, 0, 0, "", ""]
        ["plan_id", 17, 0, 0, "", ""]
        ["expires", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["operator_name", 17, 0, 0, "", ""]
        ["signed_at", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["shown", 17, 0, 0, "", ""]
        ["signature", 147, 0, 0, "", ""]
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunPartResult {
        /// how the part ended; SUCCEEDED for QUALIFIED, SCRAP and MEASURED, CANCELED or ABORTED for STOPPED
        pub report: crate::PartReport,
        /// how it ended, in words
        pub text: String,
    }

    crate::schema::message! {
        RunPartResult: "probecell_msgs", "action", "RunPart_Result",
        "RIHS01_5c30123a640cbe55a794245860e4c0b1bef871350a3bbc35a808ef7419b93490",
        concat!(
            "probecell_msgs/PartReport report            # how the part ended; SUCCEEDED for QUALIFIED, SCRAP and MEASURED, CANCELED or ABORTED for STOPPED\nstring text                  # how it ended, in words\n",
            "================================================================================\nMSG: probecell_msgs/PartReport\n",
            include_str!("../msg/PartReport.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["report", 1, 0, 0, "probecell_msgs/msg/PartReport", ""]
        ["text", 17, 0, 0, "", ""]
    }

    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct PlanMeasurementGetResult;

    crate::schema::service! {
        PlanMeasurementGetResult(PlanMeasurementGetResultRequest) -> PlanMeasurementGetResultResponse: "probecell_msgs", "action", "PlanMeasurement_GetResult",
        "RIHS01_4090bc726d9e3698961e08133c2ffc7c0d517cbc8ae9f60869488190265803bb"
    }

    /// Asks [`PlanMeasurementGetResult`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanMeasurementGetResultRequest {
        pub goal_id: crate::unique_identifier_msgs::UUID,
    }

    crate::schema::message! {
        PlanMeasurementGetResultRequest: "probecell_msgs", "action", "PlanMeasurement_GetResult_Request",
        "RIHS01_3dbbe325ab0a4d37d639c9d1d9f09af4f6fac1f27412b8ee06fc582dac5bff4a",
        concat!(
            "unique_identifier_msgs/UUID goal_id\n",
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg")
        ),
        ["goal_id", 1, 0, 0, "unique_identifier_msgs/msg/UUID", ""]
    }

    /// Answers [`PlanMeasurementGetResult`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanMeasurementGetResultResponse {
        /// `GoalStatus::STATUS_*`
        pub status: i8,
        pub result: PlanMeasurementResult,
    }

    crate::schema::message! {
        PlanMeasurementGetResultResponse: "probecell_msgs", "action", "PlanMeasurement_GetResult_Response",
        "RIHS01_cd9470d0cb7efa1f6dd0b07f86a91e31e9a07f3cef007a1d12d8d1b781e11e3a",
        concat!(
            "int8 status  # `GoalStatus::STATUS_*`\nprobecell_msgs/action/PlanMeasurement_Result result\n",
            "================================================================================\nMSG: probecell_msgs/action/PlanMeasurement_Result\n",
            "string plan_id               # the plan whose order was made; empty: none was\nuint32 touches               # number of touches of the order\nfloat64 air_time             # s, promised for the moves between touches in this order\nfloat64 given_air_time       # s, the same in the order in which the plan lists them\nfloat64 air_length           # m, path of the ball centre in the part frame between touches in this order\nfloat64 given_air_length     # m, the same in the order in which the plan lists them\nstring text                  # what was planned, or why not\n"
        ),
        ["status", 2, 0, 0, "", ""]
        ["result", 1, 0, 0, "probecell_msgs/action/PlanMeasurement_Result", ""]
    }

    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct PlanMeasurementSendGoal;

    crate::schema::service! {
        PlanMeasurementSendGoal(PlanMeasurementSendGoalRequest) -> PlanMeasurementSendGoalResponse: "probecell_msgs", "action", "PlanMeasurement_SendGoal",
        "RIHS01_a04a6a74087f900b4eaab8cec0b8510245608bf05589d0eadd52adf29b0b9177"
    }

    /// Asks [`PlanMeasurementSendGoal`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanMeasurementSendGoalRequest {
        pub goal_id: crate::unique_identifier_msgs::UUID,
        pub goal: PlanMeasurementGoal,
    }

    crate::schema::message! {
        PlanMeasurementSendGoalRequest: "probecell_msgs", "action", "PlanMeasurement_SendGoal_Request",
        "RIHS01_ab7ab0f0251b309f98ea70747c7f06fb9bfdbed61b03a56a2980557763472236",
        concat!(
            "unique_identifier_msgs/UUID goal_id\nprobecell_msgs/action/PlanMeasurement_Goal goal\n",
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
            "================================================================================\nMSG: probecell_msgs/action/PlanMeasurement_Goal\n",
            "# The service plan as an action: plan the measuring order of the cell's part, of additional touches of the part in the machine,\n# or of the rest of a plan. A goal is accepted while no other of this action is pursued, and reached when the order is made.\n# To cancel it is to end the search; nothing is planned then.\nstring plan_id               # empty: the cell's own plan; the plan measured last: its remaining points, until something is cut\nprobecell_msgs/InspectionPoint[] points   # empty: all. Else these, on features of the cell's plan; of the plan measured last: touched again\n",
            "================================================================================\nMSG: probecell_msgs/InspectionPoint\n",
            include_str!("../msg/InspectionPoint.msg"),
            "================================================================================\nMSG: geometry_msgs/Point\n",
            include_str!("../standard/geometry_msgs/msg/Point.msg"),
            "================================================================================\nMSG: geometry_msgs/Vector3\n",
            include_str!("../standard/geometry_msgs/msg/Vector3.msg")
        ),
        ["goal_id", 1, 0, 0, "unique_identifier_msgs/msg/UUID", ""]
        ["goal", 1, 0, 0, "probecell_msgs/action/PlanMeasurement_Goal", ""]
    }

    /// Answers [`PlanMeasurementSendGoal`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PlanMeasurementSendGoalResponse {
        pub accepted: bool,
        pub stamp: crate::builtin_interfaces::Time,
    }

    crate::schema::message! {
        PlanMeasurementSendGoalResponse: "probecell_msgs", "action", "PlanMeasurement_SendGoal_Response",
        "RIHS01_4453307ffef21571955178a305b67451a2195ea4d1b927cee7b43de3841672fe",
        concat!(
            "bool accepted\nbuiltin_interfaces/Time stamp\n",
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["accepted", 15, 0, 0, "", ""]
        ["stamp", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    }

    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct RunPartGetResult;

    crate::schema::service! {
        RunPartGetResult(RunPartGetResultRequest) -> RunPartGetResultResponse: "probecell_msgs", "action", "RunPart_GetResult",
        "RIHS01_c61612de1dcdeea2d564f19d7f7f74ca3411b0e90255bba23fcd4276199db2ad"
    }

    /// Asks [`RunPartGetResult`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunPartGetResultRequest {
        pub goal_id: crate::unique_identifier_msgs::UUID,
    }

    crate::schema::message! {
        RunPartGetResultRequest: "probecell_msgs", "action", "RunPart_GetResult_Request",
        "RIHS01_ad6bf550c95c841265491a8f81227216490d68bf0659eb8ea813bf9118490ed5",
        concat!(
            "unique_identifier_msgs/UUID goal_id\n",
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg")
        ),
        ["goal_id", 1, 0, 0, "unique_identifier_msgs/msg/UUID", ""]
    }

    /// Answers [`RunPartGetResult`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunPartGetResultResponse {
        /// `GoalStatus::STATUS_*`
        pub status: i8,
        pub result: RunPartResult,
    }

    crate::schema::message! {
        RunPartGetResultResponse: "probecell_msgs", "action", "RunPart_GetResult_Response",
        "RIHS01_9a26a26abe945fdd094529078b0c36a976462dbf1e474dd1bc1e595fb055c8f9",
        concat!(
            "int8 status  # `GoalStatus::STATUS_*`\nprobecell_msgs/action/RunPart_Result result\n",
            "================================================================================\nMSG: probecell_msgs/action/RunPart_Result\n",
            "probecell_msgs/PartReport report            # how the part ended; SUCCEEDED for QUALIFIED, SCRAP and MEASURED, CANCELED or ABORTED for STOPPED\nstring text                  # how it ended, in words\n",
            "================================================================================\nMSG: probecell_msgs/PartReport\n",
            include_str!("../msg/PartReport.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["status", 2, 0, 0, "", ""]
        ["result", 1, 0, 0, "probecell_msgs/action/RunPart_Result", ""]
    }

    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct RunPartSendGoal;

    crate::schema::service! {
        RunPartSendGoal(RunPartSendGoalRequest) -> RunPartSendGoalResponse: "probecell_msgs", "action", "RunPart_SendGoal",
        "RIHS01_1fa6d88dc718adcc294bba86ca6bc1d0cac731cedcce965f2002760b19c74431"
    }

    /// Asks [`RunPartSendGoal`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunPartSendGoalRequest {
        pub goal_id: crate::unique_identifier_msgs::UUID,
        pub goal: RunPartGoal,
    }

    crate::schema::message! {
        RunPartSendGoalRequest: "probecell_msgs", "action", "RunPart_SendGoal_Request",
        "RIHS01_261011b393c672233c34bc2fc119dce258331e35fde6fff39ef59696cda990dc",
        concat!(
            "unique_identifier_msgs/UUID goal_id\nprobecell_msgs/action/RunPart_Goal goal\n",
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
            "================================================================================\nMSG: probecell_msgs/action/RunPart_Goal\n",
            "# The service run as an action: make one part; or, with a plan_id, only measure, or resume the measurement with which the\n# last part ended. The goal is accepted where the service would accept it, and reached when the part is reported. To cancel\n# it is to stop the machine and the part, as the service stop does.\nstring part_id               # may be empty when resuming\nstring plan_id               # empty: make a part. A plan accepted by the service plan: measure it. The plan measured last: resume the part\nbuiltin_interfaces/Time expires   # nothing is started after this instant by the clock of the cell (service status); 0: 8 s after its arrival\nstring operator_name         # who has it made; may be empty\nbuiltin_interfaces/Time signed_at   # instant of the act, by the clock of the cell (service status)\nstring shown                 # what the operator was shown: text, or `sha256:` and its digest\nuint8[] signature            # ed25519, 64 bytes: see docs/approvals.md. Empty: not signed\n",
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["goal_id", 1, 0, 0, "unique_identifier_msgs/msg/UUID", ""]
        ["goal", 1, 0, 0, "probecell_msgs/action/RunPart_Goal", ""]
    }

    /// Answers [`RunPartSendGoal`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct RunPartSendGoalResponse {
        pub accepted: bool,
        pub stamp: crate::builtin_interfaces::Time,
    }

    crate::schema::message! {
        RunPartSendGoalResponse: "probecell_msgs", "action", "RunPart_SendGoal_Response",
        "RIHS01_b155c5c84a0fe25b58c7bbca0d469830e28bf2cadd06af0cc7cfab13160e3f14",
        concat!(
            "bool accepted\nbuiltin_interfaces/Time stamp\n",
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["accepted", 15, 0, 0, "", ""]
        ["stamp", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    }

    /// The service plan as an action: plan the measuring order of the cell's part, of additional touches of the part in the machine,
    /// or of the rest of a plan. A goal is accepted while no other of this action is pursued, and reached when the order is made.
    /// To cancel it is to end the search; nothing is planned then.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct PlanMeasurement;

    impl Action for PlanMeasurement {
        type Goal = PlanMeasurementGoal;
        type Result = PlanMeasurementResult;
        type Feedback = PlanMeasurementFeedback;
        type SendGoal = PlanMeasurementSendGoal;
        type GetResult = PlanMeasurementGetResult;
        type FeedbackMessage = PlanMeasurementFeedbackMessage;

        fn goal(
            request: PlanMeasurementSendGoalRequest,
        ) -> (crate::unique_identifier_msgs::UUID, PlanMeasurementGoal) {
            (request.goal_id, request.goal)
        }

        fn acceptance(
            accepted: bool,
            stamp: crate::builtin_interfaces::Time,
        ) -> PlanMeasurementSendGoalResponse {
            PlanMeasurementSendGoalResponse { accepted, stamp }
        }

        fn goal_id(
            request: &PlanMeasurementGetResultRequest,
        ) -> crate::unique_identifier_msgs::UUID {
            request.goal_id
        }

        fn ending(status: i8, result: PlanMeasurementResult) -> PlanMeasurementGetResultResponse {
            PlanMeasurementGetResultResponse { status, result }
        }

        fn feedback(
            goal_id: crate::unique_identifier_msgs::UUID,
            feedback: PlanMeasurementFeedback,
        ) -> PlanMeasurementFeedbackMessage {
            PlanMeasurementFeedbackMessage { goal_id, feedback }
        }
    }

    /// The service run as an action: make one part; or, with a plan_id, only measure, or resume the measurement with which the
    /// last part ended. The goal is accepted where the service would accept it, and reached when the part is reported. To cancel
    /// it is to stop the machine and the part, as the service stop does.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct RunPart;

    impl Action for RunPart {
        type Goal = RunPartGoal;
        type Result = RunPartResult;
        type Feedback = RunPartFeedback;
        type SendGoal = RunPartSendGoal;
        type GetResult = RunPartGetResult;
        type FeedbackMessage = RunPartFeedbackMessage;

        fn goal(
            request: RunPartSendGoalRequest,
        ) -> (crate::unique_identifier_msgs::UUID, RunPartGoal) {
            (request.goal_id, request.goal)
        }

        fn acceptance(
            accepted: bool,
            stamp: crate::builtin_interfaces::Time,
        ) -> RunPartSendGoalResponse {
            RunPartSendGoalResponse { accepted, stamp }
        }

        fn goal_id(request: &RunPartGetResultRequest) -> crate::unique_identifier_msgs::UUID {
            request.goal_id
        }

        fn ending(status: i8, result: RunPartResult) -> RunPartGetResultResponse {
            RunPartGetResultResponse { status, result }
        }

        fn feedback(
            goal_id: crate::unique_identifier_msgs::UUID,
            feedback: RunPartFeedback,
        ) -> RunPartFeedbackMessage {
            RunPartFeedbackMessage { goal_id, feedback }
        }
    }
}

/// Standard types of the ROS package `action_msgs`.
pub mod action_msgs {
    use serde::{Deserialize, Serialize};

    /// A goal of an action, and when it was accepted.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct GoalInfo {
        pub goal_id: crate::unique_identifier_msgs::UUID,
        pub stamp: crate::builtin_interfaces::Time,
    }

    crate::schema::message! {
        GoalInfo: "action_msgs", "msg", "GoalInfo",
        "RIHS01_6398fe763154554353930716b225947f93b672f0fb2e49fdd01bb7a7e37933e9",
        concat!(
            include_str!("../standard/action_msgs/msg/GoalInfo.msg"),
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["goal_id", 1, 0, 0, "unique_identifier_msgs/msg/UUID", ""]
        ["stamp", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    }

    /// How far a goal is.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct GoalStatus {
        pub goal_info: GoalInfo,
        pub status: i8,
    }

    impl GoalStatus {
        pub const STATUS_UNKNOWN: i8 = 0;
        pub const STATUS_ACCEPTED: i8 = 1;
        pub const STATUS_EXECUTING: i8 = 2;
        pub const STATUS_CANCELING: i8 = 3;
        pub const STATUS_SUCCEEDED: i8 = 4;
        pub const STATUS_CANCELED: i8 = 5;
        pub const STATUS_ABORTED: i8 = 6;
    }

    crate::schema::message! {
        GoalStatus: "action_msgs", "msg", "GoalStatus",
        "RIHS01_32f4cfd717735d17657e1178f24431c1ce996c878c515230f6c5b3476819dbb9",
        concat!(
            include_str!("../standard/action_msgs/msg/GoalStatus.msg"),
            "================================================================================\nMSG: action_msgs/GoalInfo\n",
            include_str!("../standard/action_msgs/msg/GoalInfo.msg"),
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["goal_info", 1, 0, 0, "action_msgs/msg/GoalInfo", ""]
        ["status", 2, 0, 0, "", ""]
    }

    /// The goals that an action server keeps, oldest first.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct GoalStatusArray {
        pub status_list: Vec<GoalStatus>,
    }

    crate::schema::message! {
        GoalStatusArray: "action_msgs", "msg", "GoalStatusArray",
        "RIHS01_6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
        concat!(
            include_str!("../standard/action_msgs/msg/GoalStatusArray.msg"),
            "================================================================================\nMSG: action_msgs/GoalStatus\n",
            include_str!("../standard/action_msgs/msg/GoalStatus.msg"),
            "================================================================================\nMSG: action_msgs/GoalInfo\n",
            include_str!("../standard/action_msgs/msg/GoalInfo.msg"),
            "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
            include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["status_list", 145, 0, 0, "action_msgs/msg/GoalStatus", ""]
    }

    /// Services, and the messages that they are made of.
    pub mod srv {
        use serde::{Deserialize, Serialize};

        /// Cancel goals of an action: one by its identifier; those accepted up to a stamp; all, where both are zero.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct CancelGoal;

        crate::schema::service! {
            CancelGoal(CancelGoalRequest) -> CancelGoalResponse: "action_msgs", "srv", "CancelGoal",
            "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a"
        }

        /// Asks [`CancelGoal`].
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct CancelGoalRequest {
            pub goal_info: crate::action_msgs::GoalInfo,
        }

        crate::schema::message! {
            CancelGoalRequest: "action_msgs", "srv", "CancelGoal_Request",
            "RIHS01_3d3c84653c1f96918086887e1dcb236faec88b81a5b14fd4cf4840065bcdf8af",
            concat!(
                "# Cancel goals of an action: one by its identifier; those accepted up to a stamp; all, where both are zero.\n\naction_msgs/GoalInfo goal_info\n",
                "================================================================================\nMSG: action_msgs/GoalInfo\n",
                include_str!("../standard/action_msgs/msg/GoalInfo.msg"),
                "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
                include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
                "================================================================================\nMSG: builtin_interfaces/Time\n",
                include_str!("../standard/builtin_interfaces/msg/Time.msg")
            ),
            ["goal_info", 1, 0, 0, "action_msgs/msg/GoalInfo", ""]
        }

        /// Answers [`CancelGoal`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct CancelGoalResponse {
            pub return_code: i8,
            pub goals_canceling: Vec<crate::action_msgs::GoalInfo>,
        }

        impl CancelGoalResponse {
            pub const ERROR_NONE: i8 = 0;
            pub const ERROR_REJECTED: i8 = 1;
            pub const ERROR_UNKNOWN_GOAL_ID: i8 = 2;
            pub const ERROR_GOAL_TERMINATED: i8 = 3;
        }

        crate::schema::message! {
            CancelGoalResponse: "action_msgs", "srv", "CancelGoal_Response",
            "RIHS01_35e682cf3f510e83c70a82a4aac888496dedee56773bf9d8e5e0aa81f9e1c960",
            concat!(
                "int8 ERROR_NONE=0\nint8 ERROR_REJECTED=1\nint8 ERROR_UNKNOWN_GOAL_ID=2\nint8 ERROR_GOAL_TERMINATED=3\nint8 return_code\naction_msgs/GoalInfo[] goals_canceling\n",
                "================================================================================\nMSG: action_msgs/GoalInfo\n",
                include_str!("../standard/action_msgs/msg/GoalInfo.msg"),
                "================================================================================\nMSG: unique_identifier_msgs/UUID\n",
                include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
                "================================================================================\nMSG: builtin_interfaces/Time\n",
                include_str!("../standard/builtin_interfaces/msg/Time.msg")
            ),
            ["return_code", 2, 0, 0, "", ""]
            ["goals_canceling", 145, 0, 0, "action_msgs/msg/GoalInfo", ""]
        }
    }
}

/// Standard types of the ROS package `builtin_interfaces`.
pub mod builtin_interfaces {
    use serde::{Deserialize, Serialize};

    /// A span of time.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Duration {
        /// s
        pub sec: i32,
        /// ns, in [0, 1e9), added to sec
        pub nanosec: u32,
    }

    crate::schema::message! {
        Duration: "builtin_interfaces", "msg", "Duration",
        "RIHS01_e8d009f659816f758b75334ee1a9ca5b5c0b859843261f14c7f937349599d93b",
        include_str!("../standard/builtin_interfaces/msg/Duration.msg"),
        ["sec", 6, 0, 0, "", ""]
        ["nanosec", 7, 0, 0, "", ""]
    }

    /// An instant, counted from the epoch of its clock.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Time {
        /// s
        pub sec: i32,
        /// ns, in [0, 1e9), added to sec
        pub nanosec: u32,
    }

    crate::schema::message! {
        Time: "builtin_interfaces", "msg", "Time",
        "RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
        include_str!("../standard/builtin_interfaces/msg/Time.msg"),
        ["sec", 6, 0, 0, "", ""]
        ["nanosec", 7, 0, 0, "", ""]
    }
}

/// Standard types of the ROS package `diagnostic_msgs`.
pub mod diagnostic_msgs {
    use serde::{Deserialize, Serialize};

    /// States of components at one instant.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct DiagnosticArray {
        pub header: crate::std_msgs::Header,
        pub status: Vec<DiagnosticStatus>,
    }

    crate::schema::message! {
        DiagnosticArray: "diagnostic_msgs", "msg", "DiagnosticArray",
        "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
        concat!(
            include_str!("../standard/diagnostic_msgs/msg/DiagnosticArray.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: diagnostic_msgs/DiagnosticStatus\n",
            include_str!("../standard/diagnostic_msgs/msg/DiagnosticStatus.msg"),
            "================================================================================\nMSG: diagnostic_msgs/KeyValue\n",
            include_str!("../standard/diagnostic_msgs/msg/KeyValue.msg")
        ),
        ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
        ["status", 145, 0, 0, "diagnostic_msgs/msg/DiagnosticStatus", ""]
    }

    /// State of one component.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct DiagnosticStatus {
        /// one of the constants above
        pub level: u8,
        pub name: String,
        pub message: String,
        pub hardware_id: String,
        pub values: Vec<KeyValue>,
    }

    impl DiagnosticStatus {
        pub const OK: u8 = 0;
        pub const WARN: u8 = 1;
        pub const ERROR: u8 = 2;
        pub const STALE: u8 = 3;
    }

    crate::schema::message! {
        DiagnosticStatus: "diagnostic_msgs", "msg", "DiagnosticStatus",
        "RIHS01_b0e3e692ea2d54a8af2f4ef1930e81556a2db55216b771f8a7d2724ed47bf0e4",
        concat!(
            include_str!("../standard/diagnostic_msgs/msg/DiagnosticStatus.msg"),
            "================================================================================\nMSG: diagnostic_msgs/KeyValue\n",
            include_str!("../standard/diagnostic_msgs/msg/KeyValue.msg")
        ),
        ["level", 16, 0, 0, "", ""]
        ["name", 17, 0, 0, "", ""]
        ["message", 17, 0, 0, "", ""]
        ["hardware_id", 17, 0, 0, "", ""]
        ["values", 145, 0, 0, "diagnostic_msgs/msg/KeyValue", ""]
    }

    /// A named value, as text.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct KeyValue {
        pub key: String,
        pub value: String,
    }

    crate::schema::message! {
        KeyValue: "diagnostic_msgs", "msg", "KeyValue",
        "RIHS01_d68081eaa540288c5440753baecef0c4e16e81a5f78ad68902ded5100413bb42",
        include_str!("../standard/diagnostic_msgs/msg/KeyValue.msg"),
        ["key", 17, 0, 0, "", ""]
        ["value", 17, 0, 0, "", ""]
    }
}

/// Standard types of the ROS package `geometry_msgs`.
pub mod geometry_msgs {
    use serde::{Deserialize, Serialize};

    /// A position.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Point {
        /// m
        pub x: f64,
        /// m
        pub y: f64,
        /// m
        pub z: f64,
    }

    crate::schema::message! {
        Point: "geometry_msgs", "msg", "Point",
        "RIHS01_6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881",
        include_str!("../standard/geometry_msgs/msg/Point.msg"),
        ["x", 11, 0, 0, "", ""]
        ["y", 11, 0, 0, "", ""]
        ["z", 11, 0, 0, "", ""]
    }

    /// A position and an orientation.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Pose {
        /// m
        pub position: Point,
        /// unit quaternion
        pub orientation: Quaternion,
    }

    crate::schema::message! {
        Pose: "geometry_msgs", "msg", "Pose",
        "RIHS01_d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa",
        concat!(
            include_str!("../standard/geometry_msgs/msg/Pose.msg"),
            "================================================================================\nMSG: geometry_msgs/Point\n",
            include_str!("../standard/geometry_msgs/msg/Point.msg"),
            "================================================================================\nMSG: geometry_msgs/Quaternion\n",
            include_str!("../standard/geometry_msgs/msg/Quaternion.msg")
        ),
        ["position", 1, 0, 0, "geometry_msgs/msg/Point", ""]
        ["orientation", 1, 0, 0, "geometry_msgs/msg/Quaternion", ""]
    }

    /// A Pose with reference coordinate frame and timestamp.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct PoseStamped {
        pub header: crate::std_msgs::Header,
        pub pose: Pose,
    }

    crate::schema::message! {
        PoseStamped: "geometry_msgs", "msg", "PoseStamped",
        "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
        concat!(
            include_str!("../standard/geometry_msgs/msg/PoseStamped.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: geometry_msgs/Pose\n",
            include_str!("../standard/geometry_msgs/msg/Pose.msg"),
            "================================================================================\nMSG: geometry_msgs/Point\n",
            include_str!("../standard/geometry_msgs/msg/Point.msg"),
            "================================================================================\nMSG: geometry_msgs/Quaternion\n",
            include_str!("../standard/geometry_msgs/msg/Quaternion.msg")
        ),
        ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
        ["pose", 1, 0, 0, "geometry_msgs/msg/Pose", ""]
    }

    /// A rotation as a unit quaternion.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Quaternion {
        pub x: f64,
        pub y: f64,
        pub z: f64,
        pub w: f64,
    }

    impl Default for Quaternion {
        fn default() -> Self {
            Self {
                x: 0.0,
                y: 0.0,
                z: 0.0,
                w: 1.0,
            }
        }
    }

    crate::schema::message! {
        Quaternion: "geometry_msgs", "msg", "Quaternion",
        "RIHS01_8a765f66778c8ff7c8ab94afcc590a2ed5325a1d9a076ffff38fbce36f458684",
        include_str!("../standard/geometry_msgs/msg/Quaternion.msg"),
        ["x", 11, 0, 0, "", "0.0"]
        ["y", 11, 0, 0, "", "0.0"]
        ["z", 11, 0, 0, "", "0.0"]
        ["w", 11, 0, 0, "", "1.0"]
    }

    /// A translation and a rotation.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Transform {
        /// m
        pub translation: Vector3,
        /// unit quaternion
        pub rotation: Quaternion,
    }

    crate::schema::message! {
        Transform: "geometry_msgs", "msg", "Transform",
        "RIHS01_beb83fbe698636351461f6f35d1abb20010c43d55374d81bd041f1ba2581fddc",
        concat!(
            include_str!("../standard/geometry_msgs/msg/Transform.msg"),
            "================================================================================\nMSG: geometry_msgs/Vector3\n",
            include_str!("../standard/geometry_msgs/msg/Vector3.msg"),
            "================================================================================\nMSG: geometry_msgs/Quaternion\n",
            include_str!("../standard/geometry_msgs/msg/Quaternion.msg")
        ),
        ["translation", 1, 0, 0, "geometry_msgs/msg/Vector3", ""]
        ["rotation", 1, 0, 0, "geometry_msgs/msg/Quaternion", ""]
    }

    /// The pose of child_frame_id in the frame of the header.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct TransformStamped {
        pub header: crate::std_msgs::Header,
        pub child_frame_id: String,
        /// m and unit quaternion
        pub transform: Transform,
    }

    crate::schema::message! {
        TransformStamped: "geometry_msgs", "msg", "TransformStamped",
        "RIHS01_0a241f87d04668d94099cbb5ba11691d5ad32c2f29682e4eb5653424bd275206",
        concat!(
            include_str!("../standard/geometry_msgs/msg/TransformStamped.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: geometry_msgs/Transform\n",
            include_str!("../standard/geometry_msgs/msg/Transform.msg"),
            "================================================================================\nMSG: geometry_msgs/Vector3\n",
            include_str!("../standard/geometry_msgs/msg/Vector3.msg"),
            "================================================================================\nMSG: geometry_msgs/Quaternion\n",
            include_str!("../standard/geometry_msgs/msg/Quaternion.msg")
        ),
        ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
        ["child_frame_id", 17, 0, 0, "", ""]
        ["transform", 1, 0, 0, "geometry_msgs/msg/Transform", ""]
    }

    /// A free vector, in the unit of the field that holds it.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Vector3 {
        pub x: f64,
        pub y: f64,
        pub z: f64,
    }

    crate::schema::message! {
        Vector3: "geometry_msgs", "msg", "Vector3",
        "RIHS01_cc12fe83e4c02719f1ce8070bfd14aecd40f75a96696a67a2a1f37f7dbb0765d",
        include_str!("../standard/geometry_msgs/msg/Vector3.msg"),
        ["x", 11, 0, 0, "", ""]
        ["y", 11, 0, 0, "", ""]
        ["z", 11, 0, 0, "", ""]
    }
}

/// Standard types of the ROS package `rcl_interfaces`.
pub mod rcl_interfaces {
    use serde::{Deserialize, Serialize};

    /// Values that a parameter of type double may have.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct FloatingPointRange {
        pub from_value: f64,
        pub to_value: f64,
        pub step: f64,
    }

    crate::schema::message! {
        FloatingPointRange: "rcl_interfaces", "msg", "FloatingPointRange",
        "RIHS01_e6af23a23c177fee5f3075c8b1e435162a9b63c863d78c06017460b49684262d",
        include_str!("../standard/rcl_interfaces/msg/FloatingPointRange.msg"),
        ["from_value", 11, 0, 0, "", ""]
        ["to_value", 11, 0, 0, "", ""]
        ["step", 11, 0, 0, "", ""]
    }

    /// Values that a parameter of type integer may have.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct IntegerRange {
        pub from_value: i64,
        pub to_value: i64,
        pub step: u64,
    }

    crate::schema::message! {
        IntegerRange: "rcl_interfaces", "msg", "IntegerRange",
        "RIHS01_f7b7fdc0f65f07702e099218e13288c3963bcb9345bde78b560e6cd19800fc5a",
        include_str!("../standard/rcl_interfaces/msg/IntegerRange.msg"),
        ["from_value", 8, 0, 0, "", ""]
        ["to_value", 8, 0, 0, "", ""]
        ["step", 9, 0, 0, "", ""]
    }

    /// Names of parameters, and the prefixes that they have in common.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ListParametersResult {
        pub names: Vec<String>,
        pub prefixes: Vec<String>,
    }

    crate::schema::message! {
        ListParametersResult: "rcl_interfaces", "msg", "ListParametersResult",
        "RIHS01_237ae3428413dcbcfb452b510c42355f3a2b021dc091afa3e18526d57022f1cd",
        include_str!("../standard/rcl_interfaces/msg/ListParametersResult.msg"),
        ["names", 161, 0, 0, "", ""]
        ["prefixes", 161, 0, 0, "", ""]
    }

    /// One log message of a node, as every ROS 2 node publishes it on /rosout.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Log {
        /// wall clock
        pub stamp: crate::builtin_interfaces::Time,
        /// one of the constants above
        pub level: u8,
        /// logger: namespace and node, with dots
        pub name: String,
        pub msg: String,
        /// source file, empty if unknown
        pub file: String,
        pub function: String,
        pub line: u32,
    }

    impl Log {
        pub const DEBUG: u8 = 10;
        pub const INFO: u8 = 20;
        pub const WARN: u8 = 30;
        pub const ERROR: u8 = 40;
        pub const FATAL: u8 = 50;
    }

    crate::schema::message! {
        Log: "rcl_interfaces", "msg", "Log",
        "RIHS01_e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
        concat!(
            include_str!("../standard/rcl_interfaces/msg/Log.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["stamp", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["level", 3, 0, 0, "", ""]
        ["name", 17, 0, 0, "", ""]
        ["msg", 17, 0, 0, "", ""]
        ["file", 17, 0, 0, "", ""]
        ["function", 17, 0, 0, "", ""]
        ["line", 7, 0, 0, "", ""]
    }

    /// A parameter: a name, in which dots separate levels, and a value.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Parameter {
        pub name: String,
        pub value: ParameterValue,
    }

    crate::schema::message! {
        Parameter: "rcl_interfaces", "msg", "Parameter",
        "RIHS01_ddfe6442cffc462317adb5c92536a7b6dd55858c5c3e1e328165a6b73c2831af",
        concat!(
            include_str!("../standard/rcl_interfaces/msg/Parameter.msg"),
            "================================================================================\nMSG: rcl_interfaces/ParameterValue\n",
            include_str!("../standard/rcl_interfaces/msg/ParameterValue.msg")
        ),
        ["name", 17, 0, 0, "", ""]
        ["value", 1, 0, 0, "rcl_interfaces/msg/ParameterValue", ""]
    }

    /// What may be said of a parameter beside its value.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ParameterDescriptor {
        pub name: String,
        pub r#type: u8,
        pub description: String,
        pub additional_constraints: String,
        pub read_only: bool,
        pub dynamic_typing: bool,
        #[serde(deserialize_with = "crate::bounded::sequence::<_, _, 1>")]
        pub floating_point_range: Vec<FloatingPointRange>,
        #[serde(deserialize_with = "crate::bounded::sequence::<_, _, 1>")]
        pub integer_range: Vec<IntegerRange>,
    }

    crate::schema::message! {
        ParameterDescriptor: "rcl_interfaces", "msg", "ParameterDescriptor",
        "RIHS01_52175dbfda6c51153101d33d2a9da05743f66f02d5ab2ca9ec4709b46b73d704",
        concat!(
            include_str!("../standard/rcl_interfaces/msg/ParameterDescriptor.msg"),
            "================================================================================\nMSG: rcl_interfaces/FloatingPointRange\n",
            include_str!("../standard/rcl_interfaces/msg/FloatingPointRange.msg"),
            "================================================================================\nMSG: rcl_interfaces/IntegerRange\n",
            include_str!("../standard/rcl_interfaces/msg/IntegerRange.msg")
        ),
        ["name", 17, 0, 0, "", ""]
        ["type", 3, 0, 0, "", ""]
        ["description", 17, 0, 0, "", ""]
        ["additional_constraints", 17, 0, 0, "", ""]
        ["read_only", 15, 0, 0, "", "False"]
        ["dynamic_typing", 15, 0, 0, "", "False"]
        ["floating_point_range", 97, 1, 0, "rcl_interfaces/msg/FloatingPointRange", ""]
        ["integer_range", 97, 1, 0, "rcl_interfaces/msg/IntegerRange", ""]
    }

    /// Parameters of one node that were declared, set or removed.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ParameterEvent {
        pub stamp: crate::builtin_interfaces::Time,
        pub node: String,
        pub new_parameters: Vec<Parameter>,
        pub changed_parameters: Vec<Parameter>,
        pub deleted_parameters: Vec<Parameter>,
    }

    crate::schema::message! {
        ParameterEvent: "rcl_interfaces", "msg", "ParameterEvent",
        "RIHS01_043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204",
        concat!(
            include_str!("../standard/rcl_interfaces/msg/ParameterEvent.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: rcl_interfaces/Parameter\n",
            include_str!("../standard/rcl_interfaces/msg/Parameter.msg"),
            "================================================================================\nMSG: rcl_interfaces/ParameterValue\n",
            include_str!("../standard/rcl_interfaces/msg/ParameterValue.msg")
        ),
        ["stamp", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["node", 17, 0, 0, "", ""]
        ["new_parameters", 145, 0, 0, "rcl_interfaces/msg/Parameter", ""]
        ["changed_parameters", 145, 0, 0, "rcl_interfaces/msg/Parameter", ""]
        ["deleted_parameters", 145, 0, 0, "rcl_interfaces/msg/Parameter", ""]
    }

    /// Numbers of the types of parameters.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ParameterType {
        /// Always 0: CDR has no empty structures.
        pub structure_needs_at_least_one_member: u8,
    }

    impl ParameterType {
        pub const PARAMETER_NOT_SET: u8 = 0;
        pub const PARAMETER_BOOL: u8 = 1;
        pub const PARAMETER_INTEGER: u8 = 2;
        pub const PARAMETER_DOUBLE: u8 = 3;
        pub const PARAMETER_STRING: u8 = 4;
        pub const PARAMETER_BYTE_ARRAY: u8 = 5;
        pub const PARAMETER_BOOL_ARRAY: u8 = 6;
        pub const PARAMETER_INTEGER_ARRAY: u8 = 7;
        pub const PARAMETER_DOUBLE_ARRAY: u8 = 8;
        pub const PARAMETER_STRING_ARRAY: u8 = 9;
    }

    crate::schema::message! {
        ParameterType: "rcl_interfaces", "msg", "ParameterType",
        "RIHS01_df29ed057a834862187be24dd187d981790ff3ea6502f4cd27b432cbc42c6d46",
        include_str!("../standard/rcl_interfaces/msg/ParameterType.msg"),
        ["structure_needs_at_least_one_member", 3, 0, 0, "", ""]
    }

    /// A value of a parameter: the field that its type names.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ParameterValue {
        pub r#type: u8,
        pub bool_value: bool,
        pub integer_value: i64,
        pub double_value: f64,
        pub string_value: String,
        pub byte_array_value: Vec<u8>,
        pub bool_array_value: Vec<bool>,
        pub integer_array_value: Vec<i64>,
        pub double_array_value: Vec<f64>,
        pub string_array_value: Vec<String>,
    }

    crate::schema::message! {
        ParameterValue: "rcl_interfaces", "msg", "ParameterValue",
        "RIHS01_115fc089a387e23c7ecd3525c9189c379109119d6ab82e8dfbde0fdf6a7f9b68",
        include_str!("../standard/rcl_interfaces/msg/ParameterValue.msg"),
        ["type", 3, 0, 0, "", ""]
        ["bool_value", 15, 0, 0, "", ""]
        ["integer_value", 8, 0, 0, "", ""]
        ["double_value", 11, 0, 0, "", ""]
        ["string_value", 17, 0, 0, "", ""]
        ["byte_array_value", 160, 0, 0, "", ""]
        ["bool_array_value", 159, 0, 0, "", ""]
        ["integer_array_value", 152, 0, 0, "", ""]
        ["double_array_value", 155, 0, 0, "", ""]
        ["string_array_value", 161, 0, 0, "", ""]
    }

    /// Whether a parameter was set, or why not.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct SetParametersResult {
        pub successful: bool,
        pub reason: String,
    }

    crate::schema::message! {
        SetParametersResult: "rcl_interfaces", "msg", "SetParametersResult",
        "RIHS01_cfcc0fb0371ee5159b403960ef4300f8f9d2f1fd6117c8666b7f9654d528a9b1",
        include_str!("../standard/rcl_interfaces/msg/SetParametersResult.msg"),
        ["successful", 15, 0, 0, "", ""]
        ["reason", 17, 0, 0, "", ""]
    }

    /// Services, and the messages that they are made of.
    pub mod srv {
        use serde::{Deserialize, Serialize};

        /// Describe parameters of a node.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct DescribeParameters;

        crate::schema::service! {
            DescribeParameters(DescribeParametersRequest) -> DescribeParametersResponse: "rcl_interfaces", "srv", "DescribeParameters",
            "RIHS01_845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff"
        }

        /// Asks [`DescribeParameters`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct DescribeParametersRequest {
            pub names: Vec<String>,
        }

        crate::schema::message! {
            DescribeParametersRequest: "rcl_interfaces", "srv", "DescribeParameters_Request",
            "RIHS01_05dd1c2bc87dec2627105c8070d6f9725c781a4f2ab852975bf105462b82b644",
            "# Describe parameters of a node.\n\nstring[] names\n",
            ["names", 161, 0, 0, "", ""]
        }

        /// Answers [`DescribeParameters`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct DescribeParametersResponse {
            pub descriptors: Vec<crate::rcl_interfaces::ParameterDescriptor>,
        }

        crate::schema::message! {
            DescribeParametersResponse: "rcl_interfaces", "srv", "DescribeParameters_Response",
            "RIHS01_ad6747319613c6131589e062e095b469a46cc764f7d0f12a001a49e6cd893995",
            concat!(
                "rcl_interfaces/ParameterDescriptor[] descriptors\n",
                "================================================================================\nMSG: rcl_interfaces/ParameterDescriptor\n",
                include_str!("../standard/rcl_interfaces/msg/ParameterDescriptor.msg"),
                "================================================================================\nMSG: rcl_interfaces/FloatingPointRange\n",
                include_str!("../standard/rcl_interfaces/msg/FloatingPointRange.msg"),
                "================================================================================\nMSG: rcl_interfaces/IntegerRange\n",
                include_str!("../standard/rcl_interfaces/msg/IntegerRange.msg")
            ),
            ["descriptors", 145, 0, 0, "rcl_interfaces/msg/ParameterDescriptor", ""]
        }

        /// Tell the types of parameters of a node.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct GetParameterTypes;

        crate::schema::service! {
            GetParameterTypes(GetParameterTypesRequest) -> GetParameterTypesResponse: "rcl_interfaces", "srv", "GetParameterTypes",
            "RIHS01_da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca"
        }

        /// Asks [`GetParameterTypes`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct GetParameterTypesRequest {
            pub names: Vec<String>,
        }

        crate::schema::message! {
            GetParameterTypesRequest: "rcl_interfaces", "srv", "GetParameterTypes_Request",
            "RIHS01_87d7ec5ef545d4daa289d500025d31fb2437bc8b8365ca367161c4dac4be33fd",
            "# Tell the types of parameters of a node.\n\nstring[] names\n",
            ["names", 161, 0, 0, "", ""]
        }

        /// Answers [`GetParameterTypes`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct GetParameterTypesResponse {
            pub types: Vec<u8>,
        }

        crate::schema::message! {
            GetParameterTypesResponse: "rcl_interfaces", "srv", "GetParameterTypes_Response",
            "RIHS01_ac1335dce67c478e669434f6ac2fbff34fcd529580f272d3006785ba8b54e47f",
            "uint8[] types\n",
            ["types", 147, 0, 0, "", ""]
        }

        /// Read parameters of a node.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct GetParameters;

        crate::schema::service! {
            GetParameters(GetParametersRequest) -> GetParametersResponse: "rcl_interfaces", "srv", "GetParameters",
            "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc"
        }

        /// Asks [`GetParameters`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct GetParametersRequest {
            pub names: Vec<String>,
        }

        crate::schema::message! {
            GetParametersRequest: "rcl_interfaces", "srv", "GetParameters_Request",
            "RIHS01_135a9e1c3d7cebef792f6687d7ddf99949b21a0bd9a320d863a9110a3f5cf4d6",
            "# Read parameters of a node.\n\nstring[] names\n",
            ["names", 161, 0, 0, "", ""]
        }

        /// Answers [`GetParameters`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct GetParametersResponse {
            pub values: Vec<crate::rcl_interfaces::ParameterValue>,
        }

        crate::schema::message! {
            GetParametersResponse: "rcl_interfaces", "srv", "GetParameters_Response",
            "RIHS01_9fa773b46e39cc5d02db6224d8fd520bb9caeeffc2b27c96c1e59431baba9f2a",
            concat!(
                "rcl_interfaces/ParameterValue[] values\n",
                "================================================================================\nMSG: rcl_interfaces/ParameterValue\n",
                include_str!("../standard/rcl_interfaces/msg/ParameterValue.msg")
            ),
            ["values", 145, 0, 0, "rcl_interfaces/msg/ParameterValue", ""]
        }

        /// List the parameters of a node below some prefixes, and to some depth.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct ListParameters;

        crate::schema::service! {
            ListParameters(ListParametersRequest) -> ListParametersResponse: "rcl_interfaces", "srv", "ListParameters",
            "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d"
        }

        /// Asks [`ListParameters`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct ListParametersRequest {
            pub prefixes: Vec<String>,
            pub depth: u64,
        }

        impl ListParametersRequest {
            pub const DEPTH_RECURSIVE: u64 = 0;
        }

        crate::schema::message! {
            ListParametersRequest: "rcl_interfaces", "srv", "ListParameters_Request",
            "RIHS01_a1b0b5d6b967a5b8ac5bc8563c3ea678f349e312a6a4967227c5a96bc5ce38df",
            "# List the parameters of a node below some prefixes, and to some depth.\n\nuint64 DEPTH_RECURSIVE=0\nstring[] prefixes\nuint64 depth\n",
            ["prefixes", 161, 0, 0, "", ""]
            ["depth", 9, 0, 0, "", ""]
        }

        /// Answers [`ListParameters`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct ListParametersResponse {
            pub result: crate::rcl_interfaces::ListParametersResult,
        }

        crate::schema::message! {
            ListParametersResponse: "rcl_interfaces", "srv", "ListParameters_Response",
            "RIHS01_31b937b82de3612426be79f231e386259f97e8dc843e3f2845288b4bfa296bdd",
            concat!(
                "rcl_interfaces/ListParametersResult result\n",
                "================================================================================\nMSG: rcl_interfaces/ListParametersResult\n",
                include_str!("../standard/rcl_interfaces/msg/ListParametersResult.msg")
            ),
            ["result", 1, 0, 0, "rcl_interfaces/msg/ListParametersResult", ""]
        }

        /// Set parameters of a node, one by one.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct SetParameters;

        crate::schema::service! {
            SetParameters(SetParametersRequest) -> SetParametersResponse: "rcl_interfaces", "srv", "SetParameters",
            "RIHS01_56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0"
        }

        /// Asks [`SetParameters`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct SetParametersRequest {
            pub parameters: Vec<crate::rcl_interfaces::Parameter>,
        }

        crate::schema::message! {
            SetParametersRequest: "rcl_interfaces", "srv", "SetParameters_Request",
            "RIHS01_130d46386b7e84ea9ecf60608a4d83cbe5e5cb7c6cc5b712b7a4e3a6c254e932",
            concat!(
                "# Set parameters of a node, one by one.\n\nrcl_interfaces/Parameter[] parameters\n",
                "================================================================================\nMSG: rcl_interfaces/Parameter\n",
                include_str!("../standard/rcl_interfaces/msg/Parameter.msg"),
                "================================================================================\nMSG: rcl_interfaces/ParameterValue\n",
                include_str!("../standard/rcl_interfaces/msg/ParameterValue.msg")
            ),
            ["parameters", 145, 0, 0, "rcl_interfaces/msg/Parameter", ""]
        }

        /// Answers [`SetParameters`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct SetParametersResponse {
            pub results: Vec<crate::rcl_interfaces::SetParametersResult>,
        }

        crate::schema::message! {
            SetParametersResponse: "rcl_interfaces", "srv", "SetParameters_Response",
            "RIHS01_7a0e8140a0b8d98308fa81a5403a766e610af29a239caf54b7553227906fc266",
            concat!(
                "rcl_interfaces/SetParametersResult[] results\n",
                "================================================================================\nMSG: rcl_interfaces/SetParametersResult\n",
                include_str!("../standard/rcl_interfaces/msg/SetParametersResult.msg")
            ),
            ["results", 145, 0, 0, "rcl_interfaces/msg/SetParametersResult", ""]
        }

        /// Set parameters of a node, all or none.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct SetParametersAtomically;

        crate::schema::service! {
            SetParametersAtomically(SetParametersAtomicallyRequest) -> SetParametersAtomicallyResponse: "rcl_interfaces", "srv", "SetParametersAtomically",
            "RIHS01_0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd"
        }

        /// Asks [`SetParametersAtomically`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct SetParametersAtomicallyRequest {
            pub parameters: Vec<crate::rcl_interfaces::Parameter>,
        }

        crate::schema::message! {
            SetParametersAtomicallyRequest: "rcl_interfaces", "srv", "SetParametersAtomically_Request",
            "RIHS01_db0bd950ed5ed867a0e90b225e44dea382d762c0762ff3e0ee842190042a59e5",
            concat!(
                "# Set parameters of a node, all or none.\n\nrcl_interfaces/Parameter[] parameters\n",
                "================================================================================\nMSG: rcl_interfaces/Parameter\n",
                include_str!("../standard/rcl_interfaces/msg/Parameter.msg"),
                "================================================================================\nMSG: rcl_interfaces/ParameterValue\n",
                include_str!("../standard/rcl_interfaces/msg/ParameterValue.msg")
            ),
            ["parameters", 145, 0, 0, "rcl_interfaces/msg/Parameter", ""]
        }

        /// Answers [`SetParametersAtomically`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct SetParametersAtomicallyResponse {
            pub result: crate::rcl_interfaces::SetParametersResult,
        }

        crate::schema::message! {
            SetParametersAtomicallyResponse: "rcl_interfaces", "srv", "SetParametersAtomically_Response",
            "RIHS01_31b1a38c5b0b9d893ee24da45f69638f4561c78461d82d52750f429b534502b8",
            concat!(
                "rcl_interfaces/SetParametersResult result\n",
                "================================================================================\nMSG: rcl_interfaces/SetParametersResult\n",
                include_str!("../standard/rcl_interfaces/msg/SetParametersResult.msg")
            ),
            ["result", 1, 0, 0, "rcl_interfaces/msg/SetParametersResult", ""]
        }
    }
}

/// Standard types of the ROS package `rosgraph_msgs`.
pub mod rosgraph_msgs {
    use serde::{Deserialize, Serialize};

    /// Simulated or replayed time.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Clock {
        pub clock: crate::builtin_interfaces::Time,
    }

    crate::schema::message! {
        Clock: "rosgraph_msgs", "msg", "Clock",
        "RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
        concat!(
            include_str!("../standard/rosgraph_msgs/msg/Clock.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["clock", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
    }
}

/// Standard types of the ROS package `sensor_msgs`.
pub mod sensor_msgs {
    use serde::{Deserialize, Serialize};

    /// An encoded picture.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct CompressedImage {
        pub header: crate::std_msgs::Header,
        pub format: String,
        pub data: Vec<u8>,
    }

    crate::schema::message! {
        CompressedImage: "sensor_msgs", "msg", "CompressedImage",
        "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
        concat!(
            include_str!("../standard/sensor_msgs/msg/CompressedImage.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
        ["format", 17, 0, 0, "", ""]
        ["data", 147, 0, 0, "", ""]
    }

    /// State of a set of joints. Each of the last three arrays is empty or as long as name.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct JointState {
        pub header: crate::std_msgs::Header,
        pub name: Vec<String>,
        /// m or rad
        pub position: Vec<f64>,
        /// m/s or rad/s
        pub velocity: Vec<f64>,
        /// N or N m
        pub effort: Vec<f64>,
    }

    crate::schema::message! {
        JointState: "sensor_msgs", "msg", "JointState",
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
        concat!(
            include_str!("../standard/sensor_msgs/msg/JointState.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
        ["name", 161, 0, 0, "", ""]
        ["position", 155, 0, 0, "", ""]
        ["velocity", 155, 0, 0, "", ""]
        ["effort", 155, 0, 0, "", ""]
    }
}

/// Standard types of the ROS package `service_msgs`.
pub mod service_msgs {
    use serde::{Deserialize, Serialize};

    /// One step of a service call.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ServiceEventInfo {
        pub event_type: u8,
        pub stamp: crate::builtin_interfaces::Time,
        pub client_gid: [u8; 16],
        pub sequence_number: i64,
    }

    impl ServiceEventInfo {
        pub const REQUEST_SENT: u8 = 0;
        pub const REQUEST_RECEIVED: u8 = 1;
        pub const RESPONSE_SENT: u8 = 2;
        pub const RESPONSE_RECEIVED: u8 = 3;
    }

    crate::schema::message! {
        ServiceEventInfo: "service_msgs", "msg", "ServiceEventInfo",
        "RIHS01_41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45",
        concat!(
            include_str!("../standard/service_msgs/msg/ServiceEventInfo.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["event_type", 3, 0, 0, "", ""]
        ["stamp", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["client_gid", 51, 16, 0, "", ""]
        ["sequence_number", 8, 0, 0, "", ""]
    }
}

/// Standard types of the ROS package `std_msgs`.
pub mod std_msgs {
    use serde::{Deserialize, Serialize};

    /// A truth value.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Bool {
        pub data: bool,
    }

    crate::schema::message! {
        Bool: "std_msgs", "msg", "Bool",
        "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
        include_str!("../standard/std_msgs/msg/Bool.msg"),
        ["data", 15, 0, 0, "", ""]
    }

    /// A colour.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct ColorRGBA {
        /// ratio, 0 to 1
        pub r: f32,
        /// ratio, 0 to 1
        pub g: f32,
        /// ratio, 0 to 1
        pub b: f32,
        /// ratio, 0 to 1, 1 is opaque
        pub a: f32,
    }

    crate::schema::message! {
        ColorRGBA: "std_msgs", "msg", "ColorRGBA",
        "RIHS01_77a7a5b9ae477306097665106e0413ba74440245b1f3d0c6d6405fe5c7813fe8",
        include_str!("../standard/std_msgs/msg/ColorRGBA.msg"),
        ["r", 10, 0, 0, "", ""]
        ["g", 10, 0, 0, "", ""]
        ["b", 10, 0, 0, "", ""]
        ["a", 10, 0, 0, "", ""]
    }

    /// When and in which frame.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Header {
        pub stamp: crate::builtin_interfaces::Time,
        pub frame_id: std::string::String,
    }

    crate::schema::message! {
        Header: "std_msgs", "msg", "Header",
        "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
        concat!(
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg")
        ),
        ["stamp", 1, 0, 0, "builtin_interfaces/msg/Time", ""]
        ["frame_id", 17, 0, 0, "", ""]
    }

    /// A text.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct String {
        pub data: std::string::String,
    }

    crate::schema::message! {
        String: "std_msgs", "msg", "String",
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
        include_str!("../standard/std_msgs/msg/String.msg"),
        ["data", 17, 0, 0, "", ""]
    }
}

/// Standard types of the ROS package `tf2_msgs`.
pub mod tf2_msgs {
    use serde::{Deserialize, Serialize};

    /// Transforms between frames.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct TFMessage {
        pub transforms: Vec<crate::geometry_msgs::TransformStamped>,
    }

    crate::schema::message! {
        TFMessage: "tf2_msgs", "msg", "TFMessage",
        "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
        concat!(
            include_str!("../standard/tf2_msgs/msg/TFMessage.msg"),
            "================================================================================\nMSG: geometry_msgs/TransformStamped\n",
            include_str!("../standard/geometry_msgs/msg/TransformStamped.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: geometry_msgs/Transform\n",
            include_str!("../standard/geometry_msgs/msg/Transform.msg"),
            "================================================================================\nMSG: geometry_msgs/Vector3\n",
            include_str!("../standard/geometry_msgs/msg/Vector3.msg"),
            "================================================================================\nMSG: geometry_msgs/Quaternion\n",
            include_str!("../standard/geometry_msgs/msg/Quaternion.msg")
        ),
        ["transforms", 145, 0, 0, "geometry_msgs/msg/TransformStamped", ""]
    }
}

/// Standard types of the ROS package `type_description_interfaces`.
pub mod type_description_interfaces {
    use serde::{Deserialize, Serialize};

    /// A field of a type.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Field {
        pub name: String,
        pub r#type: FieldType,
        pub default_value: String,
    }

    crate::schema::message! {
        Field: "type_description_interfaces", "msg", "Field",
        "RIHS01_c0b01379cd4226281285ccaf6be46653968f855f7c5e41614ff5d7a854efef7c",
        concat!(
            include_str!("../standard/type_description_interfaces/msg/Field.msg"),
            "================================================================================\nMSG: type_description_interfaces/FieldType\n",
            include_str!("../standard/type_description_interfaces/msg/FieldType.msg")
        ),
        ["name", 17, 0, 0, "", ""]
        ["type", 1, 0, 0, "type_description_interfaces/msg/FieldType", ""]
        ["default_value", 17, 0, 0, "", ""]
    }

    /// Type of a field (REP 2016).
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct FieldType {
        pub type_id: u8,
        pub capacity: u64,
        pub string_capacity: u64,
        #[serde(deserialize_with = "crate::bounded::string::<_, 255>")]
        pub nested_type_name: String,
    }

    impl FieldType {
        pub const FIELD_TYPE_NOT_SET: u8 = 0;
        pub const FIELD_TYPE_NESTED_TYPE: u8 = 1;
        pub const FIELD_TYPE_INT8: u8 = 2;
        pub const FIELD_TYPE_UINT8: u8 = 3;
        pub const FIELD_TYPE_INT16: u8 = 4;
        pub const FIELD_TYPE_UINT16: u8 = 5;
        pub const FIELD_TYPE_INT32: u8 = 6;
        pub const FIELD_TYPE_UINT32: u8 = 7;
        pub const FIELD_TYPE_INT64: u8 = 8;
        pub const FIELD_TYPE_UINT64: u8 = 9;
        pub const FIELD_TYPE_FLOAT: u8 = 10;
        pub const FIELD_TYPE_DOUBLE: u8 = 11;
        pub const FIELD_TYPE_LONG_DOUBLE: u8 = 12;
        pub const FIELD_TYPE_CHAR: u8 = 13;
        pub const FIELD_TYPE_WCHAR: u8 = 14;
        pub const FIELD_TYPE_BOOLEAN: u8 = 15;
        pub const FIELD_TYPE_BYTE: u8 = 16;
        pub const FIELD_TYPE_STRING: u8 = 17;
        pub const FIELD_TYPE_WSTRING: u8 = 18;
        pub const FIELD_TYPE_FIXED_STRING: u8 = 19;
        pub const FIELD_TYPE_FIXED_WSTRING: u8 = 20;
        pub const FIELD_TYPE_BOUNDED_STRING: u8 = 21;
        pub const FIELD_TYPE_BOUNDED_WSTRING: u8 = 22;
        pub const FIELD_TYPE_NESTED_TYPE_ARRAY: u8 = 49;
        pub const FIELD_TYPE_INT8_ARRAY: u8 = 50;
        pub const FIELD_TYPE_UINT8_ARRAY: u8 = 51;
        pub const FIELD_TYPE_INT16_ARRAY: u8 = 52;
        pub const FIELD_TYPE_UINT16_ARRAY: u8 = 53;
        pub const FIELD_TYPE_INT32_ARRAY: u8 = 54;
        pub const FIELD_TYPE_UINT32_ARRAY: u8 = 55;
        pub const FIELD_TYPE_INT64_ARRAY: u8 = 56;
        pub const FIELD_TYPE_UINT64_ARRAY: u8 = 57;
        pub const FIELD_TYPE_FLOAT_ARRAY: u8 = 58;
        pub const FIELD_TYPE_DOUBLE_ARRAY: u8 = 59;
        pub const FIELD_TYPE_LONG_DOUBLE_ARRAY: u8 = 60;
        pub const FIELD_TYPE_CHAR_ARRAY: u8 = 61;
        pub const FIELD_TYPE_WCHAR_ARRAY: u8 = 62;
        pub const FIELD_TYPE_BOOLEAN_ARRAY: u8 = 63;
        pub const FIELD_TYPE_BYTE_ARRAY: u8 = 64;
        pub const FIELD_TYPE_STRING_ARRAY: u8 = 65;
        pub const FIELD_TYPE_WSTRING_ARRAY: u8 = 66;
        pub const FIELD_TYPE_FIXED_STRING_ARRAY: u8 = 67;
        pub const FIELD_TYPE_FIXED_WSTRING_ARRAY: u8 = 68;
        pub const FIELD_TYPE_BOUNDED_STRING_ARRAY: u8 = 69;
        pub const FIELD_TYPE_BOUNDED_WSTRING_ARRAY: u8 = 70;
        pub const FIELD_TYPE_NESTED_TYPE_BOUNDED_SEQUENCE: u8 = 97;
        pub const FIELD_TYPE_INT8_BOUNDED_SEQUENCE: u8 = 98;
        pub const FIELD_TYPE_UINT8_BOUNDED_SEQUENCE: u8 = 99;
        pub const FIELD_TYPE_INT16_BOUNDED_SEQUENCE: u8 = 100;
        pub const FIELD_TYPE_UINT16_BOUNDED_SEQUENCE: u8 = 101;
        pub const FIELD_TYPE_INT32_BOUNDED_SEQUENCE: u8 = 102;
        pub const FIELD_TYPE_UINT32_BOUNDED_SEQUENCE: u8 = 103;
        pub const FIELD_TYPE_INT64_BOUNDED_SEQUENCE: u8 = 104;
        pub const FIELD_TYPE_UINT64_BOUNDED_SEQUENCE: u8 = 105;
        pub const FIELD_TYPE_FLOAT_BOUNDED_SEQUENCE: u8 = 106;
        pub const FIELD_TYPE_DOUBLE_BOUNDED_SEQUENCE: u8 = 107;
        pub const FIELD_TYPE_LONG_DOUBLE_BOUNDED_SEQUENCE: u8 = 108;
        pub const FIELD_TYPE_CHAR_BOUNDED_SEQUENCE: u8 = 109;
        pub const FIELD_TYPE_WCHAR_BOUNDED_SEQUENCE: u8 = 110;
        pub const FIELD_TYPE_BOOLEAN_BOUNDED_SEQUENCE: u8 = 111;
        pub const FIELD_TYPE_BYTE_BOUNDED_SEQUENCE: u8 = 112;
        pub const FIELD_TYPE_STRING_BOUNDED_SEQUENCE: u8 = 113;
        pub const FIELD_TYPE_WSTRING_BOUNDED_SEQUENCE: u8 = 114;
        pub const FIELD_TYPE_FIXED_STRING_BOUNDED_SEQUENCE: u8 = 115;
        pub const FIELD_TYPE_FIXED_WSTRING_BOUNDED_SEQUENCE: u8 = 116;
        pub const FIELD_TYPE_BOUNDED_STRING_BOUNDED_SEQUENCE: u8 = 117;
        pub const FIELD_TYPE_BOUNDED_WSTRING_BOUNDED_SEQUENCE: u8 = 118;
        pub const FIELD_TYPE_NESTED_TYPE_UNBOUNDED_SEQUENCE: u8 = 145;
        pub const FIELD_TYPE_INT8_UNBOUNDED_SEQUENCE: u8 = 146;
        pub const FIELD_TYPE_UINT8_UNBOUNDED_SEQUENCE: u8 = 147;
        pub const FIELD_TYPE_INT16_UNBOUNDED_SEQUENCE: u8 = 148;
        pub const FIELD_TYPE_UINT16_UNBOUNDED_SEQUENCE: u8 = 149;
        pub const FIELD_TYPE_INT32_UNBOUNDED_SEQUENCE: u8 = 150;
        pub const FIELD_TYPE_UINT32_UNBOUNDED_SEQUENCE: u8 = 151;
        pub const FIELD_TYPE_INT64_UNBOUNDED_SEQUENCE: u8 = 152;
        pub const FIELD_TYPE_UINT64_UNBOUNDED_SEQUENCE: u8 = 153;
        pub const FIELD_TYPE_FLOAT_UNBOUNDED_SEQUENCE: u8 = 154;
        pub const FIELD_TYPE_DOUBLE_UNBOUNDED_SEQUENCE: u8 = 155;
        pub const FIELD_TYPE_LONG_DOUBLE_UNBOUNDED_SEQUENCE: u8 = 156;
        pub const FIELD_TYPE_CHAR_UNBOUNDED_SEQUENCE: u8 = 157;
        pub const FIELD_TYPE_WCHAR_UNBOUNDED_SEQUENCE: u8 = 158;
        pub const FIELD_TYPE_BOOLEAN_UNBOUNDED_SEQUENCE: u8 = 159;
        pub const FIELD_TYPE_BYTE_UNBOUNDED_SEQUENCE: u8 = 160;
        pub const FIELD_TYPE_STRING_UNBOUNDED_SEQUENCE: u8 = 161;
        pub const FIELD_TYPE_WSTRING_UNBOUNDED_SEQUENCE: u8 = 162;
        pub const FIELD_TYPE_FIXED_STRING_UNBOUNDED_SEQUENCE: u8 = 163;
        pub const FIELD_TYPE_FIXED_WSTRING_UNBOUNDED_SEQUENCE: u8 = 164;
        pub const FIELD_TYPE_BOUNDED_STRING_UNBOUNDED_SEQUENCE: u8 = 165;
        pub const FIELD_TYPE_BOUNDED_WSTRING_UNBOUNDED_SEQUENCE: u8 = 166;
    }

    crate::schema::message! {
        FieldType: "type_description_interfaces", "msg", "FieldType",
        "RIHS01_a70b6dd919645a03a3586f7f821defbc886ea3e531a1d95cc0f380a3973ccaa6",
        include_str!("../standard/type_description_interfaces/msg/FieldType.msg"),
        ["type_id", 3, 0, 0, "", "0"]
        ["capacity", 9, 0, 0, "", ""]
        ["string_capacity", 9, 0, 0, "", ""]
        ["nested_type_name", 21, 0, 255, "", ""]
    }

    /// A type without those that it refers to.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct IndividualTypeDescription {
        #[serde(deserialize_with = "crate::bounded::string::<_, 255>")]
        pub type_name: String,
        pub fields: Vec<Field>,
    }

    crate::schema::message! {
        IndividualTypeDescription: "type_description_interfaces", "msg", "IndividualTypeDescription",
        "RIHS01_55c827d86c3c141bdd318fe6c22e11190e4d3b37c8f4f9751a084aa05ce96560",
        concat!(
            include_str!("../standard/type_description_interfaces/msg/IndividualTypeDescription.msg"),
            "================================================================================\nMSG: type_description_interfaces/Field\n",
            include_str!("../standard/type_description_interfaces/msg/Field.msg"),
            "================================================================================\nMSG: type_description_interfaces/FieldType\n",
            include_str!("../standard/type_description_interfaces/msg/FieldType.msg")
        ),
        ["type_name", 21, 0, 255, "", ""]
        ["fields", 145, 0, 0, "type_description_interfaces/msg/Field", ""]
    }

    /// Anything else that is worth saying.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct KeyValue {
        pub key: String,
        pub value: String,
    }

    crate::schema::message! {
        KeyValue: "type_description_interfaces", "msg", "KeyValue",
        "RIHS01_274fe56bf14f33c7512e34c646a37579ee36779f745f049a9760763e817f0c42",
        include_str!("../standard/type_description_interfaces/msg/KeyValue.msg"),
        ["key", 17, 0, 0, "", ""]
        ["value", 17, 0, 0, "", ""]
    }

    /// A type and all those that it refers to, sorted by name: what its hash is made of.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct TypeDescription {
        pub type_description: IndividualTypeDescription,
        pub referenced_type_descriptions: Vec<IndividualTypeDescription>,
    }

    crate::schema::message! {
        TypeDescription: "type_description_interfaces", "msg", "TypeDescription",
        "RIHS01_739f2508c9fa3a6f330913ff5b9d25fb74159a077da71e1087f51a60c12a080b",
        concat!(
            include_str!("../standard/type_description_interfaces/msg/TypeDescription.msg"),
            "================================================================================\nMSG: type_description_interfaces/IndividualTypeDescription\n",
            include_str!("../standard/type_description_interfaces/msg/IndividualTypeDescription.msg"),
            "================================================================================\nMSG: type_description_interfaces/Field\n",
            include_str!("../standard/type_description_interfaces/msg/Field.msg"),
            "================================================================================\nMSG: type_description_interfaces/FieldType\n",
            include_str!("../standard/type_description_interfaces/msg/FieldType.msg")
        ),
        ["type_description", 1, 0, 0, "type_description_interfaces/msg/IndividualTypeDescription", ""]
        ["referenced_type_descriptions", 145, 0, 0, "type_description_interfaces/msg/IndividualTypeDescription", ""]
    }

    /// The text from which a type was made.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct TypeSource {
        pub type_name: String,
        pub encoding: String,
        pub raw_file_contents: String,
    }

    crate::schema::message! {
        TypeSource: "type_description_interfaces", "msg", "TypeSource",
        "RIHS01_faeaec7596c04ecf5b6e99ad225e4c7cbb997ad5435f793526fb3984d011aae5",
        include_str!("../standard/type_description_interfaces/msg/TypeSource.msg"),
        ["type_name", 17, 0, 0, "", ""]
        ["encoding", 17, 0, 0, "", ""]
        ["raw_file_contents", 17, 0, 0, "", ""]
    }

    /// Services, and the messages that they are made of.
    pub mod srv {
        use serde::{Deserialize, Serialize};

        /// Describe a type that the node uses.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct GetTypeDescription;

        crate::schema::service! {
            GetTypeDescription(GetTypeDescriptionRequest) -> GetTypeDescriptionResponse: "type_description_interfaces", "srv", "GetTypeDescription",
            "RIHS01_69b9c19c1021405984cc60dbbb1edceb147a6538b411d812ba6afabeed962cd5"
        }

        /// Asks [`GetTypeDescription`].
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub struct GetTypeDescriptionRequest {
            pub type_name: String,
            pub type_hash: String,
            pub include_type_sources: bool,
        }

        impl Default for GetTypeDescriptionRequest {
            fn default() -> Self {
                Self {
                    type_name: <String>::default(),
                    type_hash: <String>::default(),
                    include_type_sources: true,
                }
            }
        }

        crate::schema::message! {
            GetTypeDescriptionRequest: "type_description_interfaces", "srv", "GetTypeDescription_Request",
            "RIHS01_470f56ccbcf13d55c78c8b735fb12da03e639e5acded994426c89d94778d9e28",
            "# Describe a type that the node uses.\n\nstring type_name\nstring type_hash\nbool include_type_sources true\n",
            ["type_name", 17, 0, 0, "", ""]
            ["type_hash", 17, 0, 0, "", ""]
            ["include_type_sources", 15, 0, 0, "", "True"]
        }

        /// Answers [`GetTypeDescription`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct GetTypeDescriptionResponse {
            pub successful: bool,
            pub failure_reason: String,
            pub type_description: crate::type_description_interfaces::TypeDescription,
            pub type_sources: Vec<crate::type_description_interfaces::TypeSource>,
            pub extra_information: Vec<crate::type_description_interfaces::KeyValue>,
        }

        crate::schema::message! {
            GetTypeDescriptionResponse: "type_description_interfaces", "srv", "GetTypeDescription_Response",
            "RIHS01_648c49d976240861a482f961c5621ddd0d2135d8cce6f297a76d4f6376d93b75",
            concat!(
                "bool successful\nstring failure_reason\ntype_description_interfaces/TypeDescription type_description\ntype_description_interfaces/TypeSource[] type_sources\ntype_description_interfaces/KeyValue[] extra_information\n",
                "================================================================================\nMSG: type_description_interfaces/TypeDescription\n",
                include_str!("../standard/type_description_interfaces/msg/TypeDescription.msg"),
                "================================================================================\nMSG: type_description_interfaces/IndividualTypeDescription\n",
                include_str!("../standard/type_description_interfaces/msg/IndividualTypeDescription.msg"),
                "================================================================================\nMSG: type_description_interfaces/Field\n",
                include_str!("../standard/type_description_interfaces/msg/Field.msg"),
                "================================================================================\nMSG: type_description_interfaces/FieldType\n",
                include_str!("../standard/type_description_interfaces/msg/FieldType.msg"),
                "================================================================================\nMSG: type_description_interfaces/TypeSource\n",
                include_str!("../standard/type_description_interfaces/msg/TypeSource.msg"),
                "================================================================================\nMSG: type_description_interfaces/KeyValue\n",
                include_str!("../standard/type_description_interfaces/msg/KeyValue.msg")
            ),
            ["successful", 15, 0, 0, "", ""]
            ["failure_reason", 17, 0, 0, "", ""]
            ["type_description", 1, 0, 0, "type_description_interfaces/msg/TypeDescription", ""]
            ["type_sources", 145, 0, 0, "type_description_interfaces/msg/TypeSource", ""]
            ["extra_information", 145, 0, 0, "type_description_interfaces/msg/KeyValue", ""]
        }
    }
}

/// Standard types of the ROS package `unique_identifier_msgs`.
pub mod unique_identifier_msgs {
    use serde::{Deserialize, Serialize};

    /// A universally unique identifier (RFC 9562).
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct UUID {
        pub uuid: [u8; 16],
    }

    crate::schema::message! {
        UUID: "unique_identifier_msgs", "msg", "UUID",
        "RIHS01_1b8e8aca958cbea28fe6ef60bf6c19b683c97a9ef60bb34752067d0f2f7ab437",
        include_str!("../standard/unique_identifier_msgs/msg/UUID.msg"),
        ["uuid", 51, 16, 0, "", ""]
    }
}

/// Standard types of the ROS package `visualization_msgs`.
pub mod visualization_msgs {
    use serde::{Deserialize, Serialize};

    /// A mark to draw.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Marker {
        pub header: crate::std_msgs::Header,
        pub ns: String,
        pub id: i32,
        /// one of ARROW to ARROW_STRIP
        pub r#type: i32,
        /// one of ADD to DELETEALL
        pub action: i32,
        /// m and unit quaternion
        pub pose: crate::geometry_msgs::Pose,
        /// m
        pub scale: crate::geometry_msgs::Vector3,
        pub color: crate::std_msgs::ColorRGBA,
        /// zero: for ever
        pub lifetime: crate::builtin_interfaces::Duration,
        pub frame_locked: bool,
        /// m, in the frame of pose
        pub points: Vec<crate::geometry_msgs::Point>,
        pub colors: Vec<crate::std_msgs::ColorRGBA>,
        pub texture_resource: String,
        pub texture: crate::sensor_msgs::CompressedImage,
        pub uv_coordinates: Vec<UVCoordinate>,
        pub text: String,
        pub mesh_resource: String,
        pub mesh_file: MeshFile,
        pub mesh_use_embedded_materials: bool,
    }

    impl Marker {
        pub const ARROW: i32 = 0;
        pub const CUBE: i32 = 1;
        pub const SPHERE: i32 = 2;
        pub const CYLINDER: i32 = 3;
        pub const LINE_STRIP: i32 = 4;
        pub const LINE_LIST: i32 = 5;
        pub const CUBE_LIST: i32 = 6;
        pub const SPHERE_LIST: i32 = 7;
        pub const POINTS: i32 = 8;
        pub const TEXT_VIEW_FACING: i32 = 9;
        pub const MESH_RESOURCE: i32 = 10;
        pub const TRIANGLE_LIST: i32 = 11;
        pub const ARROW_STRIP: i32 = 12;
        pub const ADD: i32 = 0;
        pub const MODIFY: i32 = 0;
        pub const DELETE: i32 = 2;
        pub const DELETEALL: i32 = 3;
    }

    crate::schema::message! {
        Marker: "visualization_msgs", "msg", "Marker",
        "RIHS01_45b13ccf791f225962bf74e746f9644518855d783a6f42ba0cc14fde2b4f3ce0",
        concat!(
            include_str!("../standard/visualization_msgs/msg/Marker.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: geometry_msgs/Pose\n",
            include_str!("../standard/geometry_msgs/msg/Pose.msg"),
            "================================================================================\nMSG: geometry_msgs/Point\n",
            include_str!("../standard/geometry_msgs/msg/Point.msg"),
            "================================================================================\nMSG: geometry_msgs/Quaternion\n",
            include_str!("../standard/geometry_msgs/msg/Quaternion.msg"),
            "================================================================================\nMSG: geometry_msgs/Vector3\n",
            include_str!("../standard/geometry_msgs/msg/Vector3.msg"),
            "================================================================================\nMSG: std_msgs/ColorRGBA\n",
            include_str!("../standard/std_msgs/msg/ColorRGBA.msg"),
            "================================================================================\nMSG: builtin_interfaces/Duration\n",
            include_str!("../standard/builtin_interfaces/msg/Duration.msg"),
            "================================================================================\nMSG: sensor_msgs/CompressedImage\n",
            include_str!("../standard/sensor_msgs/msg/CompressedImage.msg"),
            "================================================================================\nMSG: visualization_msgs/UVCoordinate\n",
            include_str!("../standard/visualization_msgs/msg/UVCoordinate.msg"),
            "================================================================================\nMSG: visualization_msgs/MeshFile\n",
            include_str!("../standard/visualization_msgs/msg/MeshFile.msg")
        ),
        ["header", 1, 0, 0, "std_msgs/msg/Header", ""]
        ["ns", 17, 0, 0, "", ""]
        ["id", 6, 0, 0, "", ""]
        ["type", 6, 0, 0, "", ""]
        ["action", 6, 0, 0, "", ""]
        ["pose", 1, 0, 0, "geometry_msgs/msg/Pose", ""]
        ["scale", 1, 0, 0, "geometry_msgs/msg/Vector3", ""]
        ["color", 1, 0, 0, "std_msgs/msg/ColorRGBA", ""]
        ["lifetime", 1, 0, 0, "builtin_interfaces/msg/Duration", ""]
        ["frame_locked", 15, 0, 0, "", ""]
        ["points", 145, 0, 0, "geometry_msgs/msg/Point", ""]
        ["colors", 145, 0, 0, "std_msgs/msg/ColorRGBA", ""]
        ["texture_resource", 17, 0, 0, "", ""]
        ["texture", 1, 0, 0, "sensor_msgs/msg/CompressedImage", ""]
        ["uv_coordinates", 145, 0, 0, "visualization_msgs/msg/UVCoordinate", ""]
        ["text", 17, 0, 0, "", ""]
        ["mesh_resource", 17, 0, 0, "", ""]
        ["mesh_file", 1, 0, 0, "visualization_msgs/msg/MeshFile", ""]
        ["mesh_use_embedded_materials", 15, 0, 0, "", ""]
    }

    /// Marks to draw.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct MarkerArray {
        pub markers: Vec<Marker>,
    }

    crate::schema::message! {
        MarkerArray: "visualization_msgs", "msg", "MarkerArray",
        "RIHS01_86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
        concat!(
            include_str!("../standard/visualization_msgs/msg/MarkerArray.msg"),
            "================================================================================\nMSG: visualization_msgs/Marker\n",
            include_str!("../standard/visualization_msgs/msg/Marker.msg"),
            "================================================================================\nMSG: std_msgs/Header\n",
            include_str!("../standard/std_msgs/msg/Header.msg"),
            "================================================================================\nMSG: builtin_interfaces/Time\n",
            include_str!("../standard/builtin_interfaces/msg/Time.msg"),
            "================================================================================\nMSG: geometry_msgs/Pose\n",
            include_str!("../standard/geometry_msgs/msg/Pose.msg"),
            "================================================================================\nMSG: geometry_msgs/Point\n",
            include_str!("../standard/geometry_msgs/msg/Point.msg"),
            "================================================================================\nMSG: geometry_msgs/Quaternion\n",
            include_str!("../standard/geometry_msgs/msg/Quaternion.msg"),
            "================================================================================\nMSG: geometry_msgs/Vector3\n",
            include_str!("../standard/geometry_msgs/msg/Vector3.msg"),
            "================================================================================\nMSG: std_msgs/ColorRGBA\n",
            include_str!("../standard/std_msgs/msg/ColorRGBA.msg"),
            "================================================================================\nMSG: builtin_interfaces/Duration\n",
            include_str!("../standard/builtin_interfaces/msg/Duration.msg"),
            "================================================================================\nMSG: sensor_msgs/CompressedImage\n",
            include_str!("../standard/sensor_msgs/msg/CompressedImage.msg"),
            "================================================================================\nMSG: visualization_msgs/UVCoordinate\n",
            include_str!("../standard/visualization_msgs/msg/UVCoordinate.msg"),
            "================================================================================\nMSG: visualization_msgs/MeshFile\n",
            include_str!("../standard/visualization_msgs/msg/MeshFile.msg")
        ),
        ["markers", 145, 0, 0, "visualization_msgs/msg/Marker", ""]
    }

    /// A mesh, as the content of a file.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct MeshFile {
        pub filename: String,
        pub data: Vec<u8>,
    }

    crate::schema::message! {
        MeshFile: "visualization_msgs", "msg", "MeshFile",
        "RIHS01_7710ece15a148fb7c9b546364cfb215bb06098087bd6394fe5b73a493508f8c4",
        include_str!("../standard/visualization_msgs/msg/MeshFile.msg"),
        ["filename", 17, 0, 0, "", ""]
        ["data", 147, 0, 0, "", ""]
    }

    /// A point of a texture.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct UVCoordinate {
        /// ratio of the width
        pub u: f32,
        /// ratio of the height
        pub v: f32,
    }

    crate::schema::message! {
        UVCoordinate: "visualization_msgs", "msg", "UVCoordinate",
        "RIHS01_f27f7ed21fe360c6066944f856b801a0c0d1e94e815b6886444b42d90b196a26",
        include_str!("../standard/visualization_msgs/msg/UVCoordinate.msg"),
        ["u", 10, 0, 0, "", ""]
        ["v", 10, 0, 0, "", ""]
    }
}

/// Every message type, sorted by name.
pub(crate) static MESSAGES: &[&MessageType] = &[
<crate::action_msgs::GoalInfo as crate::schema::Message>::TYPE,
<crate::action_msgs::GoalStatus as crate::schema::Message>::TYPE,
<crate::action_msgs::GoalStatusArray as crate::schema::Message>::TYPE,
<crate::action_msgs::srv::CancelGoalRequest as crate::schema::Message>::TYPE,
<crate::action_msgs::srv::CancelGoalResponse as crate::schema::Message>::TYPE,
<crate::builtin_interfaces::Duration as crate::schema::Message>::TYPE,
<crate::builtin_interfaces::Time as crate::schema::Message>::TYPE,
<crate::diagnostic_msgs::DiagnosticArray as crate::schema::Message>::TYPE,
<crate::diagnostic_msgs::DiagnosticStatus as crate::schema::Message>::TYPE,
<crate::diagnostic_msgs::KeyValue as crate::schema::Message>::TYPE,
<crate::geometry_msgs::Point as crate::schema::Message>::TYPE,
<crate::geometry_msgs::Pose as crate::schema::Message>::TYPE,
<crate::geometry_msgs::PoseStamped as crate::schema::Message>::TYPE,
<crate::geometry_msgs::Quaternion as crate::schema::Message>::TYPE,
<crate::geometry_msgs::Transform as crate::schema::Message>::TYPE,
<crate::geometry_msgs::TransformStamped as crate::schema::Message>::TYPE,
<crate::geometry_msgs::Vector3 as crate::schema::Message>::TYPE,
<crate::action::PlanMeasurementFeedback as crate::schema::Message>::TYPE,
<crate::action::PlanMeasurementFeedbackMessage as crate::schema::Message>::TYPE,
<crate::action::PlanMeasurementGetResultRequest as crate::schema::Message>::TYPE,
<crate::action::PlanMeasurementGetResultResponse as crate::schema::Message>::TYPE,
<crate::action::PlanMeasurementGoal as crate::schema::Message>::TYPE,
<crate::action::PlanMeasurementResult as crate::schema::Message>::TYPE,
<crate::action::PlanMeasurementSendGoalRequest as crate::schema::Message>::TYPE,
<crate::action::PlanMeasurementSendGoalResponse as crate::schema::Message>::TYPE,
<crate::action::RunPartFeedback as crate::schema::Message>::TYPE,
<crate::action::RunPartFeedbackMessage as crate::schema::Message>::TYPE,
<crate::action::RunPartGetResultRequest as crate::schema::Message>::TYPE,
<crate::action::RunPartGetResultResponse as crate::schema::Message>::TYPE,
<crate::action::RunPartGoal as crate::schema::Message>::TYPE,
<crate::action::RunPartResult as crate::schema::Message>::TYPE,
<crate::action::RunPartSendGoalRequest as crate::schema::Message>::TYPE,
<crate::action::RunPartSendGoalResponse as crate::schema::Message>::TYPE,
<crate::ControllerCommand as crate::schema::Message>::TYPE,
<crate::ControllerReply as crate::schema::Message>::TYPE,
<crate::ControllerStatus as crate::schema::Message>::TYPE,
<crate::Correction as crate::schema::Message>::TYPE,
<crate::CorrectionAcknowledgement as crate::schema::Message>::TYPE,
<crate::Fault as crate::schema::Message>::TYPE,
<crate::FeatureResult as crate::schema::Message>::TYPE,
<crate::GapEffect as crate::schema::Message>::TYPE,
<crate::GapFinding as crate::schema::Message>::TYPE,
<crate::GapReport as crate::schema::Message>::TYPE,
<crate::GateHeartbeat as crate::schema::Message>::TYPE,
<crate::InspectionFeature as crate::schema::Message>::TYPE,
<crate::InspectionPlan as crate::schema::Message>::TYPE,
<crate::InspectionPoint as crate::schema::Message>::TYPE,
<crate::LossReport as crate::schema::Message>::TYPE,
<crate::MachineState as crate::schema::Message>::TYPE,
<crate::MachiningOperation as crate::schema::Message>::TYPE,
<crate::MeasurementOrder as crate::schema::Message>::TYPE,
<crate::OperationReport as crate::schema::Message>::TYPE,
<crate::OperationRequest as crate::schema::Message>::TYPE,
<crate::OperatorKeys as crate::schema::Message>::TYPE,
<crate::OperatorReply as crate::schema::Message>::TYPE,
<crate::OperatorRequest as crate::schema::Message>::TYPE,
<crate::Order as crate::schema::Message>::TYPE,
<crate::OrderRequest as crate::schema::Message>::TYPE,
<crate::Orders as crate::schema::Message>::TYPE,
<crate::PartAlignment as crate::schema::Message>::TYPE,
<crate::PartReport as crate::schema::Message>::TYPE,
<crate::PartStatus as crate::schema::Message>::TYPE,
<crate::PassDecision as crate::schema::Message>::TYPE,
<crate::PlanProgress as crate::schema::Message>::TYPE,
<crate::ProbeEvent as crate::schema::Message>::TYPE,
<crate::ProbeTrigger as crate::schema::Message>::TYPE,
<crate::ProbingMove as crate::schema::Message>::TYPE,
<crate::RecordingStatus as crate::schema::Message>::TYPE,
<crate::ReferenceMeasurement as crate::schema::Message>::TYPE,
<crate::StepJournal as crate::schema::Message>::TYPE,
<crate::Stylus as crate::schema::Message>::TYPE,
<crate::ToolOffsets as crate::schema::Message>::TYPE,
<crate::TouchDeviation as crate::schema::Message>::TYPE,
<crate::Verdict as crate::schema::Message>::TYPE,
<crate::srv::ApproveCorrectionRequest as crate::schema::Message>::TYPE,
<crate::srv::ApproveCorrectionResponse as crate::schema::Message>::TYPE,
<crate::srv::ManageOrdersRequest as crate::schema::Message>::TYPE,
<crate::srv::ManageOrdersResponse as crate::schema::Message>::TYPE,
<crate::srv::PlanRequest as crate::schema::Message>::TYPE,
<crate::srv::PlanResponse as crate::schema::Message>::TYPE,
<crate::srv::RunRequest as crate::schema::Message>::TYPE,
<crate::srv::RunResponse as crate::schema::Message>::TYPE,
<crate::srv::StartRecordingRequest as crate::schema::Message>::TYPE,
<crate::srv::StartRecordingResponse as crate::schema::Message>::TYPE,
<crate::srv::StatusRequest as crate::schema::Message>::TYPE,
<crate::srv::StatusResponse as crate::schema::Message>::TYPE,
<crate::srv::StopRecordingRequest as crate::schema::Message>::TYPE,
<crate::srv::StopRecordingResponse as crate::schema::Message>::TYPE,
<crate::srv::StopRequest as crate::schema::Message>::TYPE,
<crate::srv::StopResponse as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::FloatingPointRange as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::IntegerRange as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::ListParametersResult as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::Log as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::Parameter as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::ParameterDescriptor as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::ParameterEvent as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::ParameterType as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::ParameterValue as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::SetParametersResult as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::DescribeParametersRequest as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::DescribeParametersResponse as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::GetParameterTypesRequest as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::GetParameterTypesResponse as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::GetParametersRequest as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::GetParametersResponse as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::ListParametersRequest as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::ListParametersResponse as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::SetParametersAtomicallyRequest as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::SetParametersAtomicallyResponse as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::SetParametersRequest as crate::schema::Message>::TYPE,
<crate::rcl_interfaces::srv::SetParametersResponse as crate::schema::Message>::TYPE,
<crate::rosgraph_msgs::Clock as crate::schema::Message>::TYPE,
<crate::sensor_msgs::CompressedImage as crate::schema::Message>::TYPE,
<crate::sensor_msgs::JointState as crate::schema::Message>::TYPE,
<crate::service_msgs::ServiceEventInfo as crate::schema::Message>::TYPE,
<crate::std_msgs::Bool as crate::schema::Message>::TYPE,
<crate::std_msgs::ColorRGBA as crate::schema::Message>::TYPE,
<crate::std_msgs::Header as crate::schema::Message>::TYPE,
<crate::std_msgs::String as crate::schema::Message>::TYPE,
<crate::tf2_msgs::TFMessage as crate::schema::Message>::TYPE,
<crate::type_description_interfaces::Field as crate::schema::Message>::TYPE,
<crate::type_description_interfaces::FieldType as crate::schema::Message>::TYPE,
<crate::type_description_interfaces::IndividualTypeDescription as crate::schema::Message>::TYPE,
<crate::type_description_interfaces::KeyValue as crate::schema::Message>::TYPE,
<crate::type_description_interfaces::TypeDescription as crate::schema::Message>::TYPE,
<crate::type_description_interfaces::TypeSource as crate::schema::Message>::TYPE,
<crate::type_description_interfaces::srv::GetTypeDescriptionRequest as crate::schema::Message>::TYPE,
<crate::type_description_interfaces::srv::GetTypeDescriptionResponse as crate::schema::Message>::TYPE,
<crate::unique_identifier_msgs::UUID as crate::schema::Message>::TYPE,
<crate::visualization_msgs::Marker as crate::schema::Message>::TYPE,
<crate::visualization_msgs::MarkerArray as crate::schema::Message>::TYPE,
<crate::visualization_msgs::MeshFile as crate::schema::Message>::TYPE,
<crate::visualization_msgs::UVCoordinate as crate::schema::Message>::TYPE,
];

/// Every service type, sorted by name.
pub(crate) static SERVICES: &[&ServiceType] = &[
    <crate::action_msgs::srv::CancelGoal as crate::schema::Service>::TYPE,
    <crate::action::PlanMeasurementGetResult as crate::schema::Service>::TYPE,
    <crate::action::PlanMeasurementSendGoal as crate::schema::Service>::TYPE,
    <crate::action::RunPartGetResult as crate::schema::Service>::TYPE,
    <crate::action::RunPartSendGoal as crate::schema::Service>::TYPE,
    <crate::srv::ApproveCorrection as crate::schema::Service>::TYPE,
    <crate::srv::ManageOrders as crate::schema::Service>::TYPE,
    <crate::srv::Plan as crate::schema::Service>::TYPE,
    <crate::srv::Run as crate::schema::Service>::TYPE,
    <crate::srv::StartRecording as crate::schema::Service>::TYPE,
    <crate::srv::Status as crate::schema::Service>::TYPE,
    <crate::srv::Stop as crate::schema::Service>::TYPE,
    <crate::srv::StopRecording as crate::schema::Service>::TYPE,
    <crate::rcl_interfaces::srv::DescribeParameters as crate::schema::Service>::TYPE,
    <crate::rcl_interfaces::srv::GetParameterTypes as crate::schema::Service>::TYPE,
    <crate::rcl_interfaces::srv::GetParameters as crate::schema::Service>::TYPE,
    <crate::rcl_interfaces::srv::ListParameters as crate::schema::Service>::TYPE,
    <crate::rcl_interfaces::srv::SetParameters as crate::schema::Service>::TYPE,
    <crate::rcl_interfaces::srv::SetParametersAtomically as crate::schema::Service>::TYPE,
    <crate::type_description_interfaces::srv::GetTypeDescription as crate::schema::Service>::TYPE,
];
