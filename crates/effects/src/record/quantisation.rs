//! `data.quantisation`: coarse resolution of the latched positions.
//!
//! `step` is that of the grid on which they lie. Found in the records themselves.

use crate::effect::{ActsOn, Definition, Effect, Subject};

/// Its identifier.
pub const ID: &str = "data.quantisation";

pub(super) struct Quantisation;

impl Effect for Quantisation {
    fn definition(&self) -> Definition {
        Definition {
            id: ID,
            name: "coarse resolution of the latched positions",
            remedy: "raise the resolution at which the control latches and reports positions",
            parameters: &[("step", "m", 1e-5)],
            acts_on: ActsOn::of(Subject::Record),
        }
    }
}
