//! `data.outliers`: isolated false touches (a chip, a knock).
//!
//! `index` is the sequence of the event, `value` what it deviates by. Found before anything is explained, by
//! `inference::outliers`.

use machine::Chain;

use crate::effect::{ActsOn, Effect, Instance, Subject};
use crate::library::Parameter;

/// Its identifier.
pub const ID: &str = "data.outliers";

pub(super) struct Outliers;

impl Effect for Outliers {
    fn id(&self) -> &'static str {
        ID
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "isolated false touches".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "clean part and probe, and measure the named points again"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![
            Parameter::new("index", "1", 1e6),
            Parameter::new("value", "m", 1e-3),
        ]
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::of(Subject::Record)
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(super::UNDECLARABLE)
    }
}
