//! A gap report as `probecell diagnose --json` has printed it, or of a recording.

use std::io::Read;
use std::path::Path;

use anyhow::{Context, bail};
use diagnosis::{Options, Report};

use super::diagnose;

/// Longest report, bytes.
const LONGEST: u64 = 64 << 20;

/// The report of a file (`.json`, or `-`) and its text; or the diagnosis of a recording, and its robot description.
pub(super) fn of(source: &Path) -> anyhow::Result<(Report, String, Option<String>)> {
    if source == Path::new("-") || source.extension().is_some_and(|end| end == "json") {
        let (report, text) = read(source)?;
        return Ok((report, text, None));
    }
    let found = diagnose::diagnosed(source, &diagnose::Arguments::default(), &Options::default())?;
    let text = serde_json::to_string_pretty(&found.report)? + "\n";
    Ok((found.report, text, Some(found.session.robot_description)))
}

/// The report of a file, or of standard input (`-`), and its text.
pub(super) fn read(path: &Path) -> anyhow::Result<(Report, String)> {
    let mut text = String::new();
    if path == Path::new("-") {
        std::io::stdin().take(LONGEST).read_to_string(&mut text)?;
    } else {
        text = cell::text_of(path, LONGEST)
            .with_context(|| format!("cannot read the report {}", path.display()))?;
    }
    let report: Report = serde_json::from_str(&text)
        .with_context(|| format!("{} is not a single gap report", path.display()))?;
    if report.schema != diagnosis::report::SCHEMA {
        bail!(
            "{} has the schema {:?}, not {:?}",
            path.display(),
            report.schema,
            diagnosis::report::SCHEMA
        );
    }
    Ok((report, text))
}
