//! A machine, its probe and its part behind the driver's topics: the source that needs no machine.
//!
//! | hears | says |
//! |---|---|
//! | `controller_commands` | `controller_status`, `controller_replies` |
//! | `inspection_plan`, `measurement_order` | `probe_triggers`, `reference` |
//!
//! What it knows and the cell does not: the true stylus, the true sizes, how a tool really cuts (source systems A.3, A.4
//! and A.6), how its axes err, what a feature is like point by point. Contact is found by solving for the point of the move at which the true ball touches the true surface,
//! along the real kinematic chain, wherever a plan touches it: between the points at which a surface is known it is interpolated.
//! Its controller holds wear offsets and a volumetric table, tells them, and takes new ones; by the table it leads the axes,
//! while the positions that it tells are those of the programme. A new run begins with those of the cell file.
//! All randomness comes from a seed; time is what `step` is given.

mod config;
mod motion;
mod plant;
mod probe;
mod state;
mod step;
mod tool;
mod truth;

pub use config::{Config, ConfigError, Injected, RawConfig};
pub use state::State;
pub use step::{Input, Output, SimulatorNode};
pub use tool::{RawRunout, Runout};
pub use truth::{RawError, RawMachine, RawSlip, Truth, TruthError};
