//! Whole cells without a bus: the harness of the tests beside it.

use std::path::PathBuf;

use cell::{Cell, CellText};
use graph::{Executor, Published, Stamp, topics};
use probecell_msgs::{Message, OperatorRequest, PartReport, from_cdr, to_cdr};

/// When every virtual session begins: 2026-01-01 00:00 UTC.
pub const BEGIN: Stamp = Stamp(1_767_225_600_000_000_000);

/// Longest virtual time that a part may take, s.
const PART_LIMIT: f64 = 600.0;

/// Folder of the cell files.
pub fn launch_scripts() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../launch-scripts"))
}

/// A cell file of the project, after `edit` has changed its text.
pub fn cell(file: &str, edit: impl Fn(&str) -> String) -> Cell {
    let path = launch_scripts().join(file);
    let original = Cell::read(&path).unwrap_or_else(|error| panic!("{error}"));
    let text = CellText { cell: edit(&original.text().cell), ..original.text().clone() };
    Cell::from_text(text).unwrap_or_else(|error| panic!("{error}"))
}

/// An executor of the cell at the beginning of a session.
pub fn executor(cell: &Cell) -> Executor {
    let nodes = cell.nodes(false).unwrap_or_else(|error| panic!("{error}"));
    Executor::new(nodes, BEGIN).unwrap_or_else(|error| panic!("{error}"))
}

/// Asks for a part one second after the beginning.
pub fn ask_for_a_part(executor: &mut Executor, part: &str) {
    let request = OperatorRequest { subject: part.to_owned(), operator: "test".to_owned(), ..OperatorRequest::default() };
    executor.inject(BEGIN.after_s(1.0), topics::RUN_REQUESTS.name, to_cdr(&request));
}

/// Makes one part; gives its report and everything that was published.
pub fn make_part(cell: &Cell, part: &str) -> (PartReport, Vec<Published>) {
    let mut executor = executor(cell);
    ask_for_a_part(&mut executor, part);
    let reported = executor.run_until_published(topics::PART_REPORTS.name, BEGIN.after_s(PART_LIMIT));
    assert!(reported, "no part report within {PART_LIMIT} s of virtual time");
    // What the report itself causes still belongs to the session.
    executor.run_until(executor.now());
    let log = executor.take_log();
    let mut reports = messages::<PartReport>(&log, topics::PART_REPORTS.name);
    (reports.remove(0), log)
}

/// The messages on one topic.
pub fn messages<M: Message>(log: &[Published], topic: &str) -> Vec<M> {
    log.iter()
        .filter(|published| published.topic == topic)
        .map(|published| from_cdr(&published.payload).unwrap_or_else(|error| panic!("{topic}: {error}")))
        .collect()
}
