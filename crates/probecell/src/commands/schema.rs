//! `probecell schema`: JSON Schemas (draft 2020-12) of what commands print with `--json`; `docs/json.md` says what stays stable.

use clap::builder::PossibleValuesParser;

use crate::{GOOD, output};

/// Name and text of each schema.
const SCHEMAS: &[(&str, &str)] = &[
    ("doctor", include_str!("../../schemas/doctor.json")),
    ("gap-report", include_str!("../../schemas/gap-report.json")),
    (
        "identifiability",
        include_str!("../../schemas/identifiability.json"),
    ),
    ("info", include_str!("../../schemas/info.json")),
    (
        "part-record",
        include_str!("../../schemas/part-record.json"),
    ),
    ("plan", include_str!("../../schemas/plan.json")),
    ("replay", include_str!("../../schemas/replay.json")),
    ("results", include_str!("../../schemas/results.json")),
    ("scenarios", include_str!("../../schemas/scenarios.json")),
];

/// The names there are.
pub(crate) fn names() -> PossibleValuesParser {
    PossibleValuesParser::new(SCHEMAS.iter().map(|(name, _)| *name))
}

/// Prints a schema, or a line for each.
pub(crate) fn run(name: Option<&str>) -> u8 {
    for (known, text) in SCHEMAS {
        if name == Some(known) {
            output::bytes(text.as_bytes());
        } else if name.is_none() {
            let document: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
            let title = document["description"].as_str().unwrap_or_default();
            output::line(&format!("{known:<16} {title}"));
        }
    }
    GOOD
}
