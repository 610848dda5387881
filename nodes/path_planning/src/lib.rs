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
//! leads through what the plan tells of the part ([`machine::geometry`]). An order is made in slices, each a step of the
//! node, reported on `plan_progress` ([`Task`], [`Job`]).
//!
//! An operator may request further touches of the part as it is now ([`further`]): they are checked at once, and
//! published when the cycle measures them; a cut in between voids them. A preview of the part's plan is published too, so
//! it is refused while a measurement runs: it would replace the plan that is measured. A measurement that is requested
//! again under its name is resumed with its remaining points ([`resume`]): the plan stands, only an order is published.
//!
//! Lengths in m, angles in rad, times in s; contacts and normals in the part frame, targets as joint positions.

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
mod state;
mod step;
mod table;
mod task;
mod transit;
mod work;

pub use attitudes::{Attitudes, Held};
pub use candidates::{Poses, Seed};
pub use config::{Config, ConfigError, RawConfig};
pub use error::PlanningError;
pub use job::{Job, Purpose};
pub use ports::{Input, Output, PlanningFault};
pub use rules::MotionRules;
pub use state::State;
pub use step::PathPlanningNode;
pub use task::{OrderRequest, Planned, Task};
