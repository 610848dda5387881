//! Decides where the part is touched, and in which order.
//!
//! | hears | says |
//! |---|---|
//! | `plan_requests` | `plan_progress`, `plan_replies` |
//! | `operation_requests` (measurements) | `plan_progress`, `inspection_plan`, `measurement_order` |
//! | `probe_events`, `joint_states`, `operation_reports` | `path_planning/faults`: `plan_impossible`, `plan_unknown` |
//!
//! The part comes from the cell file ([`part`]): nominal features, where to touch them, which operation cut them. For a
//! measurement of a pass the nominal sizes are the drawing's plus the allowance that the pass leaves. The order is the
//! shortest open path over the moves between touches ([`route`]), never longer than the order in which the cell file
//! lists the points; where a point may be touched at several poses, one is chosen with the order. Features marked as a
//! datum come first, and every target is within the travel of its axis. No way between touches leads through what the
//! plan tells of the part (`ways`, `clear`). An order is made in stretches, each a step of its own, told on
//! `plan_progress` ([`Task`], [`Underway`]).
//! An operator may ask for further touches of the part as it is now ([`further`]): they are checked when they are asked
//! for, and published when the cycle measures them; what is cut in between voids them. A preview of the part's plan is
//! published too, so it is refused while a measurement runs: it would take the place of the plan that is measured. A measurement that is asked for
//! again under its name goes on with what is left of it ([`again`]): the plan stands, only an order is published.

pub mod again;
mod clear;
mod config;
pub mod further;
pub mod part;
pub mod route;
mod stations;
mod step;
mod task;
mod underway;
mod ways;

pub use config::{Config, ConfigError, RawConfig};
pub use stations::Poses;
pub use step::{Input, Output, PathPlanningNode, State};
pub use task::{Planned, Task, Wanted};
pub use underway::{Purpose, Underway};
