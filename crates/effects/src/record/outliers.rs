//! `data.outliers`: isolated outliers (a chip, a knock).
//!
//! `index` is the sequence of the event, `value` what it deviates by. Found before anything is
//! explained.

use crate::effect::{ActsOn, Definition, Effect, Subject};

/// Its identifier.
pub const ID: &str = "data.outliers";

pub(super) struct Outliers;

impl Effect for Outliers {
    fn definition(&self) -> Definition {
        Definition {
            id: ID,
            name: "isolated outliers",
            remedy: "clean part and probe, and measure the named points again",
            parameters: &[("index", "1", 1e6), ("value", "m", 1e-3)],
            acts_on: ActsOn::of(Subject::Record),
        }
    }
}
