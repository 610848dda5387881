//! Decides what state the machine is in, and which commands and corrections may reach it.
//!
//! ```text
//!  controller_status ──> status ──> joint_states, joint_commands, machine_state, tool_offsets, faults
//!
//!  operation_requests ─> operation ──────────────┐
//!                                                ├─> controller_commands ──> driver ──> controller_replies
//!  corrections ──> gate ──(bound, source, ───────┘                                          │
//!                   │      approval, session)                       operation_reports <─────┤
//!                   └─refused──> correction_acknowledgements <──read back───────────────────┘
//! ```
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `controller_status`, `controller_replies` | `robot_description`, `joint_states`, `joint_commands`, `machine_state`, `tool_offsets` |
//! | `operation_requests`, `plan_progress`, `measurement_order` | `controller_commands`, `operation_reports` |
//! | `corrections`, `part_reports`, `part_status` | `correction_acknowledgements`, `supervised_part` |
//! | `stop_requests`, `recording_status`, `operator_keys`, `signals` | `stop_replies`, `gate_heartbeat` |
//! | | `machine_state/faults`: `controller_lost`, `controller_restarted`, `several_drivers`, `estop`, `controller_alarm`, `unplanned_touch`, `status_not_finite`, `probe_stuck`, `machine_off`, `stopped`, `unsupervised_motion`, `cycle_lost`, `gate_lost`, `interlock_lost`, `interlock_open`, `signal_lost`, `signal_out_of_range` |
//!
//! Invariants: nothing else publishes `controller_commands`; a correction is written at most once; a command names the
//! session of the driver that runs now; no correction rests on a part that ended other than qualified, and none is written for
//! a part that is not being made. Nothing begins while a declared clamping is not known to be closed, or the part to be present. The first command to a session is STOP. A request is taken once; without a recording none is. A driver that does
//! not answer a correction in time has failed it, and an operation has failed when the controller stays idle without a
//! report. A volumetric table is written as a whole, and applied only when every entry is read back.
//!
//! A driver starts while no request is pending: its machine is stopped.
//!
//! ```
//! use graph::{Node, Outbox, START, Stamp};
//! use machine_state::{Input, MachineStateNode, Output, RawConfig};
//! use probecell_msgs::{ControllerCommand, ControllerStatus};
//!
//! let config = RawConfig::default().check("<robot/>".to_owned(), "mill", false)?;
//! let mut state = MachineStateNode::start(&config);
//! let mut out = Outbox::default();
//! let sample = ControllerStatus {
//!     session: "run 1".to_owned(),
//!     axis_names: vec!["X".to_owned()],
//!     axis_positions: vec![0.25],
//!     ..ControllerStatus::default()
//! };
//! for input in [Input::Timer(START), Input::Status(sample)] {
//!     MachineStateNode::step(&config, &mut state, Stamp(1_000_000_000), input, &mut out);
//! }
//! let commands = out.messages().iter().filter_map(|output| match output {
//!     Output::Command(command) => Some((command.session.as_str(), command.kind)),
//!     _ => None,
//! });
//! assert_eq!(commands.collect::<Vec<_>>(), [("run 1", ControllerCommand::STOP)]);
//! # Ok::<(), machine_state::ConfigError>(())
//! ```

mod active_faults;
mod command;
mod config;
mod drivers;
mod gate;
mod operation;
mod part;
mod ports;
pub mod quantity;
mod refusal;
mod report;
mod signals;
mod state;
mod status;
mod step;
mod stop;
mod table;
mod writing;

pub use config::{Config, ConfigError, RawConfig, Role, Signal};
pub use ports::{Input, MachineFault, Output};
pub use signals::VALUE;
pub use state::State;

graph::node! {
    /// The node.
    pub struct MachineStateNode { ports: ports, config: Config, state: State, step: step::step }
}
