//! Decides where the part is touched, and in which order.
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `plan_requests` | `plan_progress`, `plan_replies` |
//! | `operation_requests` (measurements) | `plan_progress`, `inspection_plan`, `measurement_order` |
//! | `probe_events`, `joint_states`, `operation_reports` | `path_planning/faults`: `plan_impossible`, `plan_unknown` |
//!
//! ```text
//!  part (cell file)          candidates               transits                    order
//!  features, touches  ->  axis positions of   ->  collision-free moves   ->  shortest open path
//!  poses, datums          approach, touch,        from retract to            (crate planning),
//!                         retract, per pose       approach, timed            poses chosen with it
//!                                                 (machine::motion)
//! ```
//!
//! The part comes from the cell file ([`part`]): nominal features, where to touch them, which operation cut them. For a
//! measurement of a pass the nominal sizes are the drawing's plus the allowance that the pass leaves. The order is the
//! shortest open path in time over the moves between touches ([`MotionRules::plan`]), never longer than the order in which
//! the cell file lists the points; where a point may be touched at several poses, or an arm may hold the probe in several
//! ways, one is chosen with the order. Features
//! marked as a datum come first (ISO 5459), and every target is within the travel of its axis. No transit between touches
//! leads through what the plan describes of the part ([`machine::geometry`]). An order is made in slices, each a step of the
//! node, reported on `plan_progress` ([`Task`], [`Job`]).
//!
//! An operator may request further touches of the part as it is now ([`further`]): they are checked at once, and
//! published when the cycle measures them; a cut in between voids them. A preview of the part's plan is published too, so
//! it is refused while a measurement runs: it would replace the plan that is measured. A measurement that is requested
//! again under its name is resumed with its remaining points ([`resume`]): the plan stands, only an order is published.
//!
//! Lengths in m, angles in rad, times in s; contacts and normals in the part frame, targets as joint positions.
//!
//! A shaft touched at four heights, listed in no good order. A preview is requested, and made in slices:
//!
//! ```
//! use graph::{Node, Outbox, Stamp};
//! use machine::Chain;
//! use path_planning::{Input, Output, PathPlanningNode, RawConfig, part::RawPart};
//! use probecell_msgs::OperatorRequest;
//!
//! let robot = r#"<robot name="xyzc"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
//! <link name="a"/><link name="b"/>
//! <joint name="C" type="revolute"><parent link="foundation"/><child link="workpiece"/><axis xyz="0 0 1"/>
//! <limit lower="-7" upper="7" effort="0" velocity="1"/></joint>
//! <joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
//! <limit lower="-0.1" upper="0.1" effort="0" velocity="0.1"/></joint>
//! <joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
//! <limit lower="-0.1" upper="0.1" effort="0" velocity="0.1"/></joint>
//! <joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
//! <limit lower="-0.1" upper="0.1" effort="0" velocity="0.1"/></joint></robot>"#;
//! let part: RawPart = toml::from_str(
//!     r#"
//!     id = "shaft"
//!     indexing_axis = "C"
//!     facing = [1.0, 0.0, 0.0]
//!     approach_mm = 1.0
//!     retract_mm = 1.0
//!     feed_mm_per_min = 300.0
//!     stylus = { id = "s", ball_center_mm = [0.0, 0.0, 0.0], ball_radius_mm = 2.0 }
//!     [[features]]
//!     id = "D"
//!     kind = "cylinder"
//!     axis = [0.0, 0.0, 1.0]
//!     radius_mm = 10.0
//!     tolerance_um = [-10.0, 10.0]
//!     touch_angles_deg = [0.0]
//!     touch_heights_mm = [40.0, 0.0, 30.0, 10.0]
//!     "#,
//! )?;
//! let config = RawConfig::default().check(Chain::from_urdf(robot)?, &part, vec![0.0])?;
//! let mut state = PathPlanningNode::start(&config);
//! let mut out = Outbox::default();
//! PathPlanningNode::step(&config, &mut state, Stamp(0), Input::Plan(OperatorRequest::default()), &mut out);
//! let order = loop {
//!     if let Some(order) = out.messages().iter().find_map(|output| match output {
//!         Output::Order(order) => Some(order.order.clone()),
//!         _ => None,
//!     }) {
//!         break order;
//!     }
//!     let (at, timer) = *out.timers().last().expect("the next slice");
//!     PathPlanningNode::step(&config, &mut state, at, Input::Timer(timer), &mut out);
//! };
//! assert!([[0, 2, 3, 1], [1, 3, 2, 0]].contains(&order[..].try_into()?), "{order:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod attitudes;
mod candidates;
mod config;
mod error;
pub mod further;
mod job;
mod moves;
pub mod part;
mod planner;
mod ports;
mod requests;
pub mod resume;
mod rules;
mod solver;
mod state;
mod step;
mod table;
mod task;
mod transit;
mod work;

pub use config::{Config, ConfigError, RawConfig};
pub use error::PlanningError;
pub use job::{Job, Purpose};
pub use ports::{Input, Output, PlanningFault};
pub use requests::PREVIEW;
pub use rules::{Attitudes, Held, MotionRules};
pub use solver::{Poses, Seed};
pub use state::State;
pub use task::{OrderRequest, Planned, Task};

graph::node! {
    /// The node.
    pub struct PathPlanningNode { ports: ports, config: Config, state: State, step: step::step }
}
