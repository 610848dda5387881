//! Decides what the controller is doing, and what it may be told.
//!
//! Inward: raw [`ControllerStatus`](probecell_msgs::ControllerStatus) samples become the contract's `joint_states`,
//! `joint_commands`, `machine_state` and `robot_description`. Outward: it is the one gate to the machine. A request to
//! move is passed when the machine is ready; a correction only with bound, source measurement, approval and session.
//!
//! | hears | says |
//! |---|---|
//! | `controller_status`, `controller_replies` | `robot_description`, `joint_states`, `joint_commands`, `machine_state`, `tool_offsets` |
//! | `operation_requests`, `plan_progress`, `measurement_order` | `controller_commands`, `operation_reports` |
//! | `corrections`, `part_reports` | `correction_acknowledgements` |
//! | | `machine_state/faults`: `controller_lost`, `controller_restarted`, `estop`, `controller_alarm`, `unplanned_touch`, `status_not_finite` |
//!
//! Invariants: nothing else publishes `controller_commands`; a correction is written at most once; a command names the
//! session of the driver that runs now; nothing is corrected from a part that has ended in another way than qualified. A
//! driver that does not answer a correction in time has failed it, and so has one that says nothing of an operation while
//! its controller is idle. A volumetric table is written whole, and applied
//! only when every entry is read back.

mod config;
mod gate;
mod state;
mod step;
mod table;
mod writing;

pub use config::{Config, ConfigError, RawConfig};
pub use state::State;
pub use step::{Input, MachineStateNode, Output};
