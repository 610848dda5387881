//! Decides which raw triggers are touches, and numbers them.
//!
//! | hears | says |
//! |---|---|
//! | `probe_triggers`, `inspection_plan` | `probe_events` |
//! | | `probe_events/faults`: `no_contact`, `probe_dead`, `probe_stuck`, `trigger_not_usable` |
//!
//! Every trigger of a known plan becomes exactly one event; events are numbered from 0 without gaps. A move that ended
//! without a trigger, or that began with the probe already tripped, is an event too, but never one that a size can be
//! made of. Triggers may come before their plan does: they wait for it.

mod config;
mod step;

pub use config::Config;
pub use step::{Input, Output, ProbeEventsNode, State};
