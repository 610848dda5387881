//! What `machine_state` subscribes to, publishes, and can find wrong.

use graph::topics;
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction, CorrectionAcknowledgement,
    Fault, GateHeartbeat, MachineState, MeasurementOrder, OperationReport, OperationRequest,
    OperatorKeys, OperatorReply, OperatorRequest, PartReport, PartStatus, PlanProgress,
    RecordingStatus, ToolOffsets, diagnostic_msgs::DiagnosticArray, sensor_msgs::JointState,
    std_msgs,
};

graph::ports! {
    "machine_state"
    inputs {
        /// A raw sample of the controller.
        Status(ControllerStatus) = topics::CONTROLLER_STATUS,
        /// The outcome of a command.
        Reply(ControllerReply) = topics::CONTROLLER_REPLIES,
        /// What the machine is to do next.
        Request(OperationRequest) = topics::OPERATION_REQUESTS,
        /// The order in which a plan is measured.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// A correction, proposed or approved.
        Correction(Correction) = topics::CORRECTIONS,
        /// The end of a part; corrections proposed for it become void.
        Part(PartReport) = topics::PART_REPORTS,
        /// The part that is being made, as `cycle` has it.
        PartStatus(PartStatus) = topics::PART_STATUS,
        /// An operator stops the machine.
        Stop(OperatorRequest) = topics::STOP_REQUESTS,
        /// Whether the cell is recorded.
        Recording(RecordingStatus) = topics::RECORDING_STATUS,
        /// Progress of path planning.
        Progress(PlanProgress) = topics::PLAN_PROGRESS,
        /// The operators' keys in force.
        Keys(OperatorKeys) = topics::OPERATOR_KEYS,
        /// Signals of controllers beside the machine.
        Signals(DiagnosticArray) = topics::SIGNALS,
    }
    outputs {
        /// The machine model.
        RobotDescription(std_msgs::String) = topics::ROBOT_DESCRIPTION,
        /// Readings of the axes.
        JointStates(JointState) = topics::JOINT_STATES,
        /// Commanded positions of the axes.
        JointCommands(JointState) = topics::JOINT_COMMANDS,
        /// What the machine is doing.
        State(MachineState) = topics::MACHINE_STATE,
        /// Wear offsets that the controller holds.
        ToolOffsets(ToolOffsets) = topics::TOOL_OFFSETS,
        /// A command to the driver.
        Command(ControllerCommand) = topics::CONTROLLER_COMMANDS,
        /// The outcome of a request.
        Report(OperationReport) = topics::OPERATION_REPORTS,
        /// The outcome of a correction.
        Acknowledgement(CorrectionAcknowledgement) = topics::CORRECTION_ACKNOWLEDGEMENTS,
        /// The heartbeat for the driver.
        Heartbeat(GateHeartbeat) = topics::GATE_HEARTBEAT,
        /// The part that is being made, as it is known here.
        Supervised(PartStatus) = topics::SUPERVISED_PART,
        /// The answer to an operator who has stopped the machine.
        Stopped(OperatorReply) = topics::STOP_REPLIES,
    }
    faults MachineFault on topics::MACHINE_STATE_FAULTS {
        /// The controller has sent no sample for too long, or the driver has lost it.
        ControllerLost = ERROR "controller_lost",
        /// The driver runs in another session than before.
        ControllerRestarted = ERROR Fault::CONTROLLER_RESTARTED,
        /// Two drivers publish samples of the controller.
        SeveralDrivers = ERROR "several_drivers",
        /// The machine is in emergency stop.
        Estop = ERROR "estop",
        /// The controller shows an alarm, or the driver a fault without a code of its own.
        ControllerAlarm = ERROR "controller_alarm",
        /// The probe tripped in a move that is not a probing move.
        UnplannedTouch = ERROR "unplanned_touch",
        /// A sample has an axis position that is missing, or a value of an axis that is not a finite number.
        StatusNotFinite = ERROR "status_not_finite",
        /// The machine was executing a program when the gate started: nobody has supervised it.
        UnsupervisedMotion = ERROR "unsupervised_motion",
        /// `cycle` no longer reports the part that is being made.
        CycleLost = ERROR "cycle_lost",
        /// A clamping or the presence of the part is not known any more.
        InterlockLost = ERROR "interlock_lost",
        /// A clamping was opened, or the part was taken away, while it is made.
        InterlockOpen = ERROR "interlock_open",
        /// Another signal has not been read for too long.
        SignalLost = WARNING "signal_lost",
        /// A signal is beyond its limits.
        SignalOutOfRange = WARNING "signal_out_of_range",
        /// Driver: the gate has fallen silent, or it is another process than before.
        GateLost = ERROR "gate_lost",
        /// Driver: the probe was tripped before a move began.
        ProbeStuck = ERROR "probe_stuck",
        /// Driver: the machine was switched off.
        MachineOff = ERROR "machine_off",
        /// Driver: the program was stopped at the machine.
        Stopped = ERROR "stopped",
    }
}
