//! `time.clock_offset`: event stamps against axis stamps are shifted.
//!
//! `dt` is the stamp of an event less that of the axes at the same moment. Found in the records themselves, by
//! [`crate::timing::clock_offset`].

use machine::Chain;

use crate::effect::{ActsOn, Effect, Instance, Subject};
use crate::library::Parameter;

/// Its identifier.
pub const ID: &str = "time.clock_offset";

pub(super) struct ClockOffset;

impl Effect for ClockOffset {
    fn id(&self) -> &'static str {
        ID
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "event stamps shifted against axis stamps".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "synchronise the clocks of the probe interface and the control"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![Parameter::new("dt", "s", 0.1)]
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::of(Subject::Record)
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(super::UNDECLARABLE)
    }
}
