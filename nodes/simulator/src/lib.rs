//! A simulated machine with its probe and its part behind the topics of a driver: the source that needs no hardware.
//!
//! ```text
//!  controller_commands ──> controller: program, offsets, volumetric table ──> controller_status, controller_replies
//!                              │ motion
//!  inspection_plan ───────> plant: true axes, true probe, true part ────────> probe_triggers
//!  measurement_order           │ the finished part on the CMM ──────────────> reference
//! ```
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `controller_commands`, `gate_heartbeat` | `controller_status`, `controller_replies` |
//! | `inspection_plan`, `measurement_order` | `probe_triggers`, `reference` |
//!
//! It knows what the cell must find out: the true stylus, the true sizes, how a tool really cuts
//! (`docs/source_systems.md`, A.3, A.4 and A.6), the errors of the axes (ISO 230-1), and features whose surface is given
//! point by point. Contact is the point of the move at which the true ball touches the true surface along the true
//! kinematic chain; between the given points of a surface it is interpolated. The controller holds wear offsets, work
//! offsets and a volumetric table, reports them and accepts new ones; with the table it corrects the axes, while it reports
//! positions of the programme. Every run begins with the offsets of the cell file. All randomness comes from a seed, and
//! time is an argument of `step`. A cut of another run than before begins with a new bar; a program ends when the gate is silent.

mod config;
mod controller;
mod cutting;
mod joint;
mod motion;
mod plant;
mod points;
mod ports;
mod probe;
mod raw;
mod state;
mod step;
mod tool;
mod truth;

pub use config::{Config, ConfigError};
pub use points::Cut;
pub use ports::{Input, Output};
pub use raw::{Injected, RawConfig};
pub use state::State;
pub use step::SimulatorNode;
pub use tool::{RawRunout, Runout};
pub use truth::{RawError, RawMachine, RawSlip, Truth, TruthError};
