//! An imported session as a recording: messages, evaluated features, the file itself, and what became of its rows.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use exchange::import::{Counts, Imported};
use graph::Stamp;
use machine::Chain;
use probecell_msgs::{FeatureResult, PartReport, TouchDeviation};

use crate::embedded::{CELL_FILE, PROVENANCE, ROBOT_FILE};
use crate::evaluation::{Features, evaluate, lines};
use crate::{import, write as bag};

/// Name of the table of what was imported.
const IMPORT: &str = "probecell_import";

/// Files that were imported, and how.
pub struct Source {
    /// What they are, for example `touches`.
    pub kind: &'static str,
    /// The files.
    pub files: Vec<PathBuf>,
    /// Settings that the command named.
    pub settings: Vec<(&'static str, String)>,
    /// The cell file of the session, where there is one.
    pub cell: Option<cell::CellText>,
    /// Source revision of the program that imports.
    pub revision: &'static str,
}

/// What a person is told of a session that was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// What the user should know: a sentence each.
    pub remarks: Vec<String>,
    /// What was read, and a line for each feature that was evaluated.
    pub lines: Vec<String>,
    /// No row was refused.
    pub is_whole: bool,
}

/// What the analysis finds, where the uncertainty of a touch is known.
fn evaluated(
    imported: &Imported,
    settings: Option<&analysis::RawConfig>,
) -> anyhow::Result<(Vec<TouchDeviation>, Features)> {
    let Some(settings) = settings.filter(|_| !imported.events.is_empty()) else {
        return Ok((Vec::new(), Features::new()));
    };
    let chain = Chain::from_urdf(&imported.robot_description)?;
    let events = imported.events.iter();
    let stamped = events.map(|event| (Stamp(event.header.stamp.nanos()), event));
    evaluate(settings.check(chain)?, &imported.plan, stamped.collect())
}

/// How many lines hold no row, and whether one of them is the header.
fn skipped(counts: Counts) -> String {
    let lines = counts.passed_over;
    let noun = if lines == 1 { "line" } else { "lines" };
    let header = match (counts.header, lines) {
        (false, _) => "",
        (true, 1) => " (the header)",
        (true, _) => " (one is the header)",
    };
    format!("{lines} {noun} skipped{header}")
}

/// Writes the session into `folder`, which must not exist, with its features where `settings` evaluate them.
///
/// # Errors
/// A file or the folder cannot be read or written, or the touches cannot be evaluated on the machine.
pub fn write(
    folder: &Path,
    imported: &Imported,
    settings: Option<&analysis::RawConfig>,
    source: &Source,
) -> anyhow::Result<Written> {
    let (touches, features) = evaluated(imported, settings)?;
    let results: Vec<FeatureResult> = features.values().cloned().collect();
    let plan = &imported.plan;
    let last = imported.events.last().map(|event| event.header.clone());
    let report = last.map(|header| PartReport {
        header,
        part_id: plan.part_id.clone(),
        verdict: PartReport::MEASURED,
        text: format!("imported from {}", names(&source.files).join(", ")),
        plan_id: plan.plan_id.clone(),
        run_id: plan.plan_id.clone(),
        ..PartReport::default()
    });
    let session = import::session(imported);
    let more = bag::More {
        touches: &touches,
        results: &results,
        reports: report.as_slice(),
        attachments: attachments(source)?,
        tables: tables(imported, source),
    };
    bag::write_with(folder, "imported", &session, &more)?;
    Ok(Written {
        remarks: remarks(imported, settings.is_some()),
        lines: std::iter::once(summary(folder, imported))
            .chain(lines(&features))
            .collect(),
        is_whole: imported.refused.is_empty(),
    })
}

fn remarks(imported: &Imported, evaluates: bool) -> Vec<String> {
    let notes = imported.remarks.iter().map(|one| format!("note: {one}"));
    let refused = imported.refused.iter().map(|one| format!("refused: {one}"));
    let none = (!imported.events.is_empty() && !evaluates).then(|| {
        "note: no feature is evaluated, since --touch-uncertainty-um is not given".to_owned()
    });
    notes.chain(refused).chain(none).collect()
}

fn summary(folder: &Path, imported: &Imported) -> String {
    let (plan, counts) = (&imported.plan, imported.counts);
    format!(
        "{}: {} rows read, {} refused, {}; {} touches of {} points on {} features",
        folder.display(),
        counts.read,
        counts.refused,
        skipped(counts),
        imported.events.len(),
        plan.points.len(),
        plan.features.len()
    )
}

fn names(files: &[PathBuf]) -> Vec<String> {
    let names = files.iter().filter_map(|file| file.file_name());
    names
        .map(|name| name.to_string_lossy().into_owned())
        .collect()
}

/// The files as they were, and the cell file.
fn attachments(source: &Source) -> anyhow::Result<Vec<(String, &'static str, Vec<u8>)>> {
    let mut all = Vec::new();
    for (name, file) in names(&source.files).into_iter().zip(&source.files) {
        all.push((
            format!("imported/{name}"),
            "application/octet-stream",
            std::fs::read(file)?,
        ));
    }
    if let Some(cell) = &source.cell {
        let text = cell.cell.clone().into_bytes();
        all.push((CELL_FILE.to_owned(), "application/toml", text));
        let robot = cell.robot_description.clone().into_bytes();
        all.push((ROBOT_FILE.to_owned(), "application/xml", robot));
    }
    Ok(all)
}

fn tables(imported: &Imported, source: &Source) -> Vec<(&'static str, BTreeMap<String, String>)> {
    let counts = imported.counts;
    let mut import = BTreeMap::from([
        ("kind".to_owned(), source.kind.to_owned()),
        ("files".to_owned(), names(&source.files).join(", ")),
        ("rows_read".to_owned(), counts.read.to_string()),
        ("rows_refused".to_owned(), counts.refused.to_string()),
        (
            "lines_passed_over".to_owned(),
            counts.passed_over.to_string(),
        ),
    ]);
    for (key, value) in &source.settings {
        import.insert((*key).to_owned(), value.clone());
    }
    let provenance = BTreeMap::from([
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("source_revision".to_owned(), source.revision.to_owned()),
    ]);
    vec![(IMPORT, import), (PROVENANCE, provenance)]
}
