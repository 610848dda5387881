//! Decides which raw triggers are touches.
//!
//! ```text
//!  driver         probe_triggers ──┐  ┌─────────────────────────────┐
//!                                  ├─>│ pair a trigger with its plan│──> probe_events         (numbered by the driver)
//!  path_planning  inspection_plan ─┘  │ ball centre by the chain    │──> probe_events/faults
//!                                     └─────────────────────────────┘
//! ```
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `probe_triggers`, `inspection_plan` | `probe_events` |
//! | | `probe_events/faults`: `no_contact`, `probe_dead`, `probe_stuck`, `trigger_not_usable` |
//!
//! Every trigger of a known plan becomes exactly one event, with the number that the driver gave the trigger: from 0 in its
//! session, without gaps, whatever becomes of this process. A number that is missing is a touch that was lost. A move that ended
//! without a trigger, or that began with the probe already tripped, is an event too, but never one that a size can be
//! made of. Triggers may arrive before their plan does: they wait for it.
//!
//! Positions are the controller's readings at the latch (m, rad); `tip` is the ball centre that they give in the part
//! frame by the nominal kinematic chain, without any correction of pre-travel or ball radius.

mod config;
mod step;

pub use config::{Config, RawConfig};
pub use step::{Input, Output, ProbeEventsFault, ProbeEventsNode, State};
