//! `probecell report`: the record of the parts that a session made, one page to be filed.

use std::path::{Path, PathBuf};

use anyhow::Context;
use session_io::{record, sizes};

use crate::output;

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Bag: a folder or an .mcap file.
    bag: PathBuf,
    /// Write a self-contained, printable HTML page instead of plain text.
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    html: Option<PathBuf>,
    /// The sizes with their verdicts, decision rules and references as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Writes the page, or prints its text.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let (session, damage) = record::read(&arguments.bag)?;
    if arguments.json {
        output::json(&sizes::json(&session))?;
        return Ok(output::damage(&damage));
    }
    let page = record::page(&arguments.bag, &session, &mut output::remark)?;
    match &arguments.html {
        Some(file) => std::fs::write(file, page.html())
            .with_context(|| format!("cannot write {}", file.display()))?,
        None => output::line(page.text().trim_end()),
    }
    Ok(output::damage(&damage))
}

/// The page of a recording.
pub(super) fn html(bag: &Path) -> anyhow::Result<String> {
    let (session, _) = record::read(bag)?;
    Ok(record::page(bag, &session, &mut output::remark)?.html())
}

#[cfg(test)]
mod tests;
