//! The diagnosis of a recording, as the command `probecell diagnose` makes it.

use std::path::Path;

use bags::Measurement;
use diagnosis::{Options, Report, diagnose};

/// The gap report of the last measurement of a recording.
///
/// # Errors
/// The recording cannot be read or diagnosed; its name stands before the reason.
pub fn diagnose_bag(path: &str) -> anyhow::Result<Report> {
    let one = || -> anyhow::Result<Report> {
        let measured = recorded::measured(Path::new(path), &Measurement::Last, None)?;
        Ok(diagnose(&measured.session, &Options::default())?)
    };
    one().map_err(|error| error.context(format!("diagnose({path})")))
}
