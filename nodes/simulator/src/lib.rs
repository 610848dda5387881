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
//!
//! A machine of one axis starts, and reports where it stands:
//!
//! ```
//! use graph::{Node, Outbox, START, Stamp};
//! use machine::Chain;
//! use probecell_msgs::{InspectionPlan, Stylus};
//! use simulator::{Input, Output, RawConfig, SimulatorNode};
//!
//! let robot = r#"<robot name="one_axis">
//!   <link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
//!   <joint name="W" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
//!   <joint name="Z" type="prismatic"><parent link="foundation"/><child link="probe_mount"/>
//!     <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="0" velocity="1"/></joint>
//! </robot>"#;
//! let raw: RawConfig = toml::from_str(
//!     r#"
//!     seed = 1
//!     home = { Z = { position_mm = 100.0 } }
//!     probe = { center_error_um = [0.0, 0.0, 0.0], radius_error_um = 0.0, touch_sd_um = 1.0 }
//!     plant = { spring_back = 0.0, cut_sd_um = 0.0 }
//!     tools = [{ number = 2, error_um = 15.0 }]
//!     sizes = [{ id = "D", features = ["D"], nominal_mm = 20.0, stock_mm = 21.0 }]
//!     operations = [{ id = "turn", tool_number = 2, sizes = ["D"], duration_s = 2.0, spindle_rpm = 60.0 }]
//!     "#,
//! )?;
//! let plan = InspectionPlan {
//!     stylus: Stylus { ball_radius: 2e-3, ..Stylus::default() },
//!     ..InspectionPlan::default()
//! };
//! let config = raw.check(Chain::from_urdf(robot)?, &plan)?;
//! let mut state = SimulatorNode::start(&config);
//! let mut out = Outbox::default();
//! for timer in [START, 1] {
//!     SimulatorNode::step(&config, &mut state, Stamp(0), Input::Timer(timer), &mut out);
//! }
//! let sample = out.messages().iter().find_map(|output| match output {
//!     Output::Status(sample) => Some(sample),
//!     _ => None,
//! });
//! assert_eq!(sample.map(|sample| sample.axis_positions.clone()), Some(vec![0.1])); // m
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
mod replies;
mod state;
mod step;
mod stopping;
mod tool;
mod truth;

pub use config::{Config, ConfigError};
pub use points::Cut;
pub use ports::{Input, Output};
pub use raw::{Injected, RawConfig};
pub use state::State;
pub use tool::{RawRunout, Runout};
pub use truth::{RawError, RawMachine, RawSlip, Truth, TruthError};

graph::node! {
    /// The node.
    pub struct SimulatorNode { ports: ports, config: Config, state: State, step: step::step, start: State::new }
}
