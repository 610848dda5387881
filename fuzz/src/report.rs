//! Any text as a gap report of another run: printed, and read for what remedies and cell files take from it.

use cell::{Cell, CellText};
use diagnosis::{Options, Report, diagnose};

/// Reads the text, and adopts what it has found.
pub fn target(data: &[u8]) {
    let Ok(report) = serde_json::from_slice::<Report>(data) else {
        return;
    };
    assert!(!report.to_string().is_empty());
    let text = CellText {
        name: "cell.toml".to_owned(),
        cell: include_str!("../../launch-scripts/turn_mill.toml").to_owned(),
        robot_description: include_str!("../../launch-scripts/turn_mill.urdf").to_owned(),
        ..CellText::default()
    };
    let cell = Cell::from_text(text).expect("the turn-mill");
    let picks: Vec<String> = report
        .effects
        .iter()
        .map(|one| one.effect.clone())
        .collect();
    if let Ok(adopted) = cell::adopt(&cell, &report, &picks, false) {
        assert!(!adopted.text.is_empty());
    }
    if let Ok(lines) = cure::lines(&report, &picks) {
        assert!(!cure::table(&report, &lines).is_empty());
    }
}

/// The report of a sample.
pub fn seeds() -> Vec<Vec<u8>> {
    let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../bags/samples/punch.mcap");
    let read = session_io::measured(sample.as_ref(), &bags::Measurement::Last, None);
    let session = read.expect("a sample").session;
    let report = diagnose(&session, &Options::default()).expect("a report");
    vec![serde_json::to_vec(&report).expect("a report as JSON")]
}
