//! SINUMERIK 840D: measuring and decision programs out, logs in.
//!
//! | module | content |
//! |---|---|
//! | [`program`] | measuring program of an inspection plan |
//! | [`decision`] | programs that decide after a measured size |
//! | [`results`] | logs and saved parameters |
//!
//! Lengths are mm in the programs. `neighbours/controller_oracle` executes them in tests.

pub mod decision;
pub mod program;
pub mod results;

use crate::{
    dialect::{Characteristic, Dialect, DialectError, Job, Limits, ProgramWriter},
    results::ResultsFormat,
};

/// SINUMERIK 840D.
#[derive(Clone, Copy, Debug)]
pub struct Sinumerik;

impl Dialect for Sinumerik {
    fn name(&self) -> &'static str {
        "sinumerik"
    }

    fn description(&self) -> &'static str {
        "SINUMERIK 840D; results by WRITE"
    }

    fn writer(&self) -> Option<&dyn ProgramWriter> {
        Some(self)
    }

    fn formats(&self) -> &'static [&'static dyn ResultsFormat] {
        &[&results::SinumerikLog]
    }
}

impl ProgramWriter for Sinumerik {
    /// `WRITE` takes 200 characters: the positions of six axes. Labels are not numbered, so touches are not limited.
    fn limits(&self) -> Limits {
        Limits {
            touches: usize::MAX,
            axes: 6,
        }
    }

    fn write(&self, job: &Job<'_>) -> Result<String, DialectError> {
        let text = program::measuring_program(job.plan, job.order, job.axes, job.travel_feed)?;
        Ok(text)
    }

    fn decision_program(&self, characteristic: &Characteristic) -> Result<String, DialectError> {
        Ok(decision::main_program(characteristic)?)
    }
}
