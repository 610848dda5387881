//! Test harness: whole cells on virtual time, without a bus.

pub mod bag;
pub mod gaps;
pub mod sample;
pub mod series;
pub mod session;
pub mod trace;

use std::path::PathBuf;

use cell::{Cell, CellText};
use graph::{
    Executor, Instance, Published, Stamp,
    replay::{Factory, Recording},
    topics,
};
use probecell_msgs::{Message, OperatorRequest, PartReport, RecordingStatus, from_cdr, to_cdr};

/// When every virtual session begins: 2026-01-01 00:00 UTC.
pub const BEGIN: Stamp = Stamp(1_767_225_600_000_000_000);

/// Longest virtual time that a part may take, s; long enough for a machine that was left alone to end what it was doing.
pub const PART_LIMIT: f64 = 600.0;

/// Folder of the cell files.
pub fn launch_scripts() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../launch-scripts"))
}

/// A cell file of the project, after `edit` has changed its text. The search for an order is short and nobody asks for
/// the gap: sessions are run many times here, and none of these tests is about the length of the way.
pub fn cell(file: &str, edit: impl Fn(&str) -> String) -> Cell {
    let path = launch_scripts().join(file);
    let original = Cell::read(&path).unwrap_or_else(|error| panic!("{error}"));
    let edit = |text: &str| {
        let short = text.replacen("[path_planning]\n", "[path_planning]\nkicks = 50\n", 1);
        edit(&format!("{short}\n[gap]\nat_end_of_plan = false\n"))
    };
    let text = CellText {
        cell: edit(&original.text().cell),
        ..original.text().clone()
    };
    let cell = Cell::from_text(text).unwrap_or_else(|error| panic!("{error}"));
    cell.simulated()
}

/// An executor of the cell at the beginning of a session.
pub fn executor(cell: &Cell) -> Executor {
    let nodes = cell.nodes(false).unwrap_or_else(|error| panic!("{error}"));
    begin(nodes)
}

/// The nodes at the beginning of a session whose log is kept by the executor, not by a recorder.
pub fn begin(nodes: Vec<Box<dyn Instance>>) -> Executor {
    let mut executor = Executor::new(nodes, BEGIN).unwrap_or_else(|error| panic!("{error}"));
    let waived = RecordingStatus {
        state: RecordingStatus::WAIVED,
        ..RecordingStatus::default()
    };
    executor.inject(BEGIN, topics::RECORDING_STATUS.name, to_cdr(&waived));
    executor
}

/// Asks for a part one second after the beginning.
pub fn ask_for_a_part(executor: &mut Executor, part: &str) {
    let request = OperatorRequest {
        subject: part.to_owned(),
        operator_name: "test".to_owned(),
        ..OperatorRequest::default()
    };
    executor.inject(
        BEGIN.after_s(1.0),
        topics::RUN_REQUESTS.name,
        to_cdr(&request),
    );
}

/// Makes one part; gives its report and everything that was published.
pub fn make_part(cell: &Cell, part: &str) -> (PartReport, Vec<Published>) {
    let mut executor = executor(cell);
    ask_for_a_part(&mut executor, part);
    let reported =
        executor.run_until_published(topics::PART_REPORTS.name, BEGIN.after_s(PART_LIMIT));
    assert!(
        reported,
        "no part report within {PART_LIMIT} s of virtual time"
    );
    // What the report itself causes still belongs to the session.
    executor.run_until(executor.now());
    let log = executor.take_log();
    let mut reports = messages::<PartReport>(&log, topics::PART_REPORTS.name);
    (reports.remove(0), log)
}

/// What the log of a run would be as a recording of the same session.
pub fn recording(log: &[Published]) -> Recording {
    let mut recording = Recording::default();
    for published in log {
        recording.push(
            &published.topic,
            published.sequence,
            published.at,
            &published.payload,
        );
    }
    recording
}

/// What makes the nodes of that name again, for a replay.
pub fn factories(cell: &Cell, nodes: &[&'static str]) -> Vec<Factory> {
    let make = |&name: &&'static str| -> Factory {
        let cell = cell.clone();
        Box::new(move || instance(&cell, name))
    };
    nodes.iter().map(make).collect()
}

/// One node of the cell at its start.
pub fn instance(cell: &Cell, name: &str) -> Box<dyn Instance> {
    cell.instance(name, false)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// The messages on one topic.
pub fn messages<M: Message>(log: &[Published], topic: &str) -> Vec<M> {
    log.iter()
        .filter(|published| published.topic == topic)
        .map(|published| {
            from_cdr(&published.payload).unwrap_or_else(|error| panic!("{topic}: {error}"))
        })
        .collect()
}
