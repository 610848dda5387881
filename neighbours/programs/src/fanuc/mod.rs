//! FANUC custom macro B: measuring and decision programs out, `DPRNT` lines in.
//!
//! | module | content |
//! |---|---|
//! | [`program`] | measuring program of an inspection plan |
//! | [`decision`] | macros that decide after a measured size |
//! | [`results`] | lines that the measuring program prints |
//!
//! Lengths are mm in the programs. `neighbours/controller_oracle` executes them in tests.

pub mod decision;
pub mod program;
pub mod results;

use crate::{
    dialect::{Characteristic, Dialect, DialectError, Job, Limits, ProgramWriter},
    results::ResultsFormat,
};

/// FANUC custom macro B.
#[derive(Clone, Copy, Debug)]
pub struct Fanuc;

impl Dialect for Fanuc {
    fn name(&self) -> &'static str {
        "fanuc"
    }

    fn description(&self) -> &'static str {
        "FANUC custom macro B; results by DPRNT"
    }

    fn writer(&self) -> Option<&dyn ProgramWriter> {
        Some(self)
    }

    fn formats(&self) -> &'static [&'static dyn ResultsFormat] {
        &[&results::Dprnt]
    }
}

impl ProgramWriter for Fanuc {
    /// Sequence numbers go to 99999, and each touch takes two; axes have numbers of one digit in the variables used.
    fn limits(&self) -> Limits {
        Limits {
            touches: 49_999,
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
