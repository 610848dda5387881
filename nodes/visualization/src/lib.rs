//! Publishes the cell as tf frames and markers for generic viewers: RViz, Foxglove, Lichtblick, Rerun.
//!
//! ```text
//!  machine_state  joint_states ───────┐  ┌────────────────────────────────┐
//!  path_planning  inspection_plan ────┤  │ frames of all links by the      │──> tf, tf_static
//!                 measurement_order ──┼─>│ nominal kinematics; the part's  │
//!  analysis       touch_deviations ───┤  │ points, touches, deviations     │──> touch_markers
//!  compensation   verdicts ───────────┘  └────────────────────────────────┘
//! ```
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `joint_states`, `inspection_plan` | `tf`, `tf_static` (tf2_msgs/TFMessage) |
//! | `inspection_plan`, `measurement_order`, `touch_deviations`, `verdicts` | `touch_markers` (visualization_msgs/MarkerArray) |
//! | | `visualization/faults`: `joints_not_usable` |
//!
//! *Frames* are the links of the robot description, as `robot_state_publisher` gives them, at 20 Hz at most; `part` is the
//! nominal frame of the part below `workpiece`, `stylus` the nominal centre of the ball below `probe_mount`. They are the cell's
//! own. On `/tf` and `/tf_static`, which all cells of a bus share, the launcher repeats them with a prefix, by default the name of
//! the cell and a slash (`turn_mill/part`).
//!
//! *Markers* stand in the frame `part`. Namespace `points`: the plan; `order`: the path between them; `touches`: points
//! touched; `deviations`: a line along the normal, as long as the deviation times `magnification`; `features`: name and verdict
//! of each feature; `characteristics`: verdicts on what is made of several. Green is a deviation within its expanded uncertainty (k = 2), orange material in excess, blue material
//! missing. The whole set is published again with a plan, and at most a hundred points per second while touches come, so that
//! a viewer that joins late sees all of it.
//!
//! The links of a machine that do not move are frames from the start:
//!
//! ```
//! use graph::{Node, Outbox, START, Stamp};
//! use machine::models::XFYZBA;
//! use visualization::{Input, Output, RawConfig, VisualizationNode};
//!
//! let config = RawConfig::default().check(XFYZBA)?;
//! let mut state = VisualizationNode::start(&config);
//! let mut out = Outbox::default();
//! VisualizationNode::step(&config, &mut state, Stamp(0), Input::Timer(START), &mut out);
//! let [Output::Fixed(frames)] = out.messages() else { panic!("frames that do not move") };
//! assert!(frames.transforms.iter().all(|frame| !frame.child_frame_id.contains('/')));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod config;
mod markers;
mod ports;
mod state;
mod step;
mod transforms;

pub use config::{Config, RawConfig};
pub use ports::{Input, Output, VisualizationFault};
pub use state::State;

graph::node! {
    /// The node.
    pub struct VisualizationNode { ports: ports, config: Config, state: State, step: step::step }
}
