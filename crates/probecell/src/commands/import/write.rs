//! An imported session as a recording: messages, evaluated features, the file itself, and what became of its rows.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use exchange::import::{Counts, Imported};
use graph::Stamp;
use machine::Chain;
use probecell_msgs::{FeatureResult, PartReport, TouchDeviation};
use session_io::embedded::PROVENANCE;
use session_io::evaluation::evaluate;
use session_io::write;

use super::super::plan;
use crate::{GOOD, LOSS, output};

/// Name of the table of what was imported.
const IMPORT: &str = "probecell_import";

/// Files that were imported, and how.
pub(in super::super) struct Source {
    /// What they are, for example `touches`.
    pub(in super::super) kind: &'static str,
    /// The files.
    pub(in super::super) files: Vec<PathBuf>,
    /// Settings that the command named.
    pub(in super::super) settings: Vec<(&'static str, String)>,
    /// The cell file of the session, where there is one.
    pub(in super::super) cell: Option<cell::CellText>,
}

/// What the analysis finds, where the uncertainty of a touch is known.
fn evaluated(
    imported: &Imported,
    settings: Option<&analysis::RawConfig>,
) -> anyhow::Result<(Vec<TouchDeviation>, Vec<FeatureResult>)> {
    let Some(settings) = settings.filter(|_| !imported.events.is_empty()) else {
        return Ok((Vec::new(), Vec::new()));
    };
    let chain = Chain::from_urdf(&imported.robot_description)?;
    let events = imported.events.iter();
    let stamped = events.map(|event| (Stamp(event.header.stamp.nanos()), event));
    let (deviations, features) =
        evaluate(settings.check(chain)?, &imported.plan, stamped.collect())?;
    Ok((deviations, features.into_values().collect()))
}

/// Writes the session, prints what was read, and gives the exit status: 3 where rows were refused.
pub(super) fn write(
    folder: &Path,
    imported: &Imported,
    settings: Option<&analysis::RawConfig>,
    source: &Source,
) -> anyhow::Result<u8> {
    let results = write_session(folder, imported, settings, source)?;
    for remark in &imported.remarks {
        output::remark(&format!("note: {remark}"));
    }
    for error in &imported.refused {
        output::remark(&format!("refused: {error}"));
    }
    if !imported.events.is_empty() && settings.is_none() {
        output::remark("note: no feature is evaluated, since --touch-uncertainty-um is not given");
    }
    let (plan, counts) = (&imported.plan, imported.counts);
    output::line(&format!(
        "{}: {} rows read, {} refused, {}; {} touches of {} points on {} features",
        folder.display(),
        counts.read,
        counts.refused,
        skipped(counts),
        imported.events.len(),
        plan.points.len(),
        plan.features.len()
    ));
    let named = results.into_iter().map(|one| (one.feature_id.clone(), one));
    plan::print_features(&named.collect());
    Ok(if imported.refused.is_empty() {
        GOOD
    } else {
        LOSS
    })
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

/// Writes the session; gives the features that were evaluated.
pub(in super::super) fn write_session(
    folder: &Path,
    imported: &Imported,
    settings: Option<&analysis::RawConfig>,
    source: &Source,
) -> anyhow::Result<Vec<FeatureResult>> {
    let (touches, results) = evaluated(imported, settings)?;
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
    let session = session_io::import::session(imported);
    let more = write::More {
        touches: &touches,
        results: &results,
        reports: report.as_slice(),
        attachments: attachments(source)?,
        tables: tables(imported, source),
    };
    write::write_with(folder, "imported", &session, &more)?;
    Ok(results)
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
        all.push((
            session_io::embedded::CELL_FILE.to_owned(),
            "application/toml",
            text,
        ));
        let robot = cell.robot_description.clone().into_bytes();
        all.push((
            session_io::embedded::ROBOT_FILE.to_owned(),
            "application/xml",
            robot,
        ));
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
        (
            "source_revision".to_owned(),
            env!("PROBECELL_REVISION").to_owned(),
        ),
    ]);
    vec![(IMPORT, import), (PROVENANCE, provenance)]
}
