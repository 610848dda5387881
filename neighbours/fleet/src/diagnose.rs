//! The diagnosis of recordings, as the command `probecell diagnose` makes it.

use std::path::Path;

use anyhow::{Context, bail};
use bags::{Bag, Measurement};
use diagnosis::{Options, Report, Session, diagnose_together_with_residuals};

use crate::lake::remote::{Remote, is_url};

/// The gap report of a recording, as `probecell diagnose` makes it.
///
/// # Errors
/// The recording cannot be read or diagnosed; its name stands before the reason.
pub fn diagnose_bag(path: &str) -> anyhow::Result<Report> {
    let one = |path: &Path| -> anyhow::Result<Report> {
        let bag = Bag::open(path)?;
        Ok(session_io::diagnosed(&bag, None, None, &Options::default())?.report)
    };
    read(path, one).map_err(|error| error.context(format!("diagnose({path})")))
}

/// The joint gap report of the last measurements of several recordings of one machine; of one recording as [`diagnose_bag`].
///
/// # Errors
/// There is no recording, or one cannot be read, or they cannot be diagnosed together.
pub fn diagnose_together(paths: &[String]) -> anyhow::Result<Report> {
    match paths {
        [] => bail!("there is no recording to diagnose"),
        [one] => diagnose_bag(one),
        several => {
            let last = |path: &Path| -> anyhow::Result<Session> {
                Ok(session_io::measured(path, &Measurement::Last, None)?.session)
            };
            let of = |path: &String| {
                read(path, last).map_err(|error| error.context(format!("joint_fit({path})")))
            };
            let sessions = several.iter().map(of).collect::<anyhow::Result<Vec<_>>>()?;
            let (report, _) =
                diagnose_together_with_residuals(&sessions, &[], &Options::default())?;
            Ok(report)
        }
    }
}

/// What `read` gives of a recording in a file or folder, or in an object of S3, which is fetched.
fn read<T>(path: &str, read: impl Fn(&Path) -> anyhow::Result<T>) -> anyhow::Result<T> {
    if !is_url(path) {
        return read(Path::new(path));
    }
    let content = Remote::new(path)?
        .get(Path::new(""))?
        .context("there is no such object")?;
    let folder = tempfile::tempdir().context("cannot make a folder for the recording")?;
    let file = folder.path().join("session.mcap");
    std::fs::write(&file, content).with_context(|| format!("cannot write {}", file.display()))?;
    read(&file)
}
