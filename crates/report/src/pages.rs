//! The pages that are filed: of a diagnosis, and of a session in which parts were made. They decide nothing: verdicts,
//! sizes and intervals are those of the diagnosis and of the recorded messages.

mod conclusion;
mod diagnosis;
mod drives;
mod moves;
mod numbers;
mod part;
mod part_view;
mod provenance;
mod shift;
mod touches;

pub use self::diagnosis::{add_diagnosis, diagnosis_page};
pub use part::{PartSession, ShortDiagnosis, SizeRecord, part_page, size_records, table_entries};
pub use shift::{part_session, run_of, shift_page, shift_parts};
