//! `data.quantisation`: coarse resolution of the latched positions.
//!
//! `step` is that of the grid on which they lie. Found in the records themselves, by [`crate::timing::resolution`].

use machine::Chain;

use crate::effect::{ActsOn, Effect, Instance, Subject};
use crate::library::Parameter;

/// Its identifier.
pub const ID: &str = "data.quantisation";

pub(super) struct Quantisation;

impl Effect for Quantisation {
    fn id(&self) -> &'static str {
        ID
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "coarse resolution of the latched positions".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "raise the resolution at which the control latches and reports positions"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![Parameter::new("step", "m", 1e-5)]
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::of(Subject::Record)
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(super::UNDECLARABLE)
    }
}
