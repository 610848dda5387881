//! Records that an engineer files: one HTML page for a diagnosis, one for a session in which parts were made.
//!
//! Pages are made of the `report` crate's blocks and stand alone. Every text from outside is escaped there. The same
//! input gives the same bytes. Decides nothing: verdicts, sizes and intervals are those of the diagnosis.

mod conclusion;
mod diagnosed;
mod drives;
mod grounds;
mod numbers;
mod part;
mod part_view;
mod touches;

pub use diagnosed::{add_diagnosis, diagnosis_page};
pub use part::{PartSession, ShortDiagnosis, part_page, table_entries};
