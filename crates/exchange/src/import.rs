//! What comes in: tables and recordings of other systems as the messages of a session.

pub mod columns;
pub mod contacts;
pub mod features;
pub mod frame;
pub mod motion;
pub mod readings;
pub mod reference;
pub mod table_reference;
pub mod touches;

use probecell_msgs::{InspectionPlan, MachineState, ProbeEvent, ReferenceMeasurement};

use crate::ImportError;
use crate::table::Row;

/// Messages of a session that was imported, and what became of each row.
#[derive(Clone, Debug, Default)]
pub struct Imported {
    /// URDF of the machine.
    pub robot_description: String,
    /// What was measured.
    pub plan: InspectionPlan,
    /// Touches in the order of their numbers.
    pub events: Vec<ProbeEvent>,
    /// Temperatures over time, where the file has them.
    pub machine_states: Vec<MachineState>,
    /// What an outside instrument found.
    pub references: Vec<ReferenceMeasurement>,
    /// What became of the rows.
    pub counts: Counts,
    /// Rows that were refused.
    pub refused: Vec<ImportError>,
    /// What the user should know, a sentence each.
    pub remarks: Vec<String>,
}

/// A time (s) that a row has in a column: not negative, and before 2106, where the seconds of a stamp end.
fn instant(time: f64, row: &Row, index: usize) -> Result<f64, ImportError> {
    if (0.0..f64::from(u32::MAX)).contains(&time) {
        return Ok(time);
    }
    Err(row.wrong(
        index,
        "expected a time that is not negative, and before 2106",
    ))
}

/// What became of the rows of a file; read and refused are all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rows taken.
    pub read: u64,
    /// Rows refused.
    pub refused: u64,
    /// Blank lines, comments and the header.
    pub passed_over: u64,
    /// One of those is the header.
    pub header: bool,
}
