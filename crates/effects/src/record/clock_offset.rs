//! `time.clock_offset`: event stamps against axis stamps are shifted.
//!
//! `dt` is the stamp of an event less that of the axes at the same moment. Found in the records themselves.

use crate::effect::{ActsOn, Definition, Effect, Subject};

/// Its identifier.
pub const ID: &str = "time.clock_offset";

pub(super) struct ClockOffset;

impl Effect for ClockOffset {
    fn definition(&self) -> Definition {
        Definition {
            id: ID,
            name: "event stamps shifted against axis stamps",
            remedy: "synchronise the clocks of the probe interface and the control",
            parameters: &[("dt", "s", 0.1)],
            acts_on: ActsOn::of(Subject::Record),
        }
    }
}
