//! `probecell report`: the record of the parts that a session made: one page to be filed, or the report of a shift with a page for each part.

use std::{
    fs,
    path::{Path, PathBuf},
};

use ::report::{Page, PartSession, part_session, run_of, shift_parts};
use anyhow::{Context, bail};
use probecell_msgs::PartReport;
use session_io::{record, sizes};

use super::selection::Selection;
use crate::output;

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Bag: a folder or an .mcap file.
    bag: PathBuf,
    /// Write a printable HTML page instead of plain text; of several parts the report of the shift, and the page of each in a folder
    /// beside it.
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    html: Option<PathBuf>,
    /// The sizes with their verdicts, decision rules and references as one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    selection: Selection,
}

/// Writes the page, or prints its text.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let (whole, damage) = record::read(&arguments.bag)?;
    let session = selected(&arguments.bag, whole, &arguments.selection)?;
    if arguments.json {
        output::json(&sizes::json(&session))?;
        return Ok(output::damage(&damage));
    }
    let parts = shift_parts(&session);
    let page = match parts.as_slice() {
        [part] if arguments.selection.is_given() => record::of_part(&session, part)?,
        _ => {
            let file = arguments.html.as_deref().filter(|_| parts.len() > 1);
            let folder = file.map(|file| write_parts(&session, &parts, file));
            let folder = folder.transpose()?;
            let link = |index| Some(format!("{}/{}", folder.as_ref()?, of_index(index)));
            record::page(&arguments.bag, &session, &link, &mut output::remark)?
        }
    };
    match &arguments.html {
        Some(file) => write(file, &page)?,
        None => output::line(page.text().trim_end()),
    }
    Ok(output::damage(&damage))
}

/// What the recording holds of the parts that are wanted.
fn selected(
    bag: &Path,
    session: PartSession,
    selection: &Selection,
) -> anyhow::Result<PartSession> {
    if !selection.is_given() {
        return Ok(session);
    }
    let named = |one: &&PartReport, name: &str| one.part_id == name || run_of(one) == name;
    let at = |one: &&PartReport| one.header.stamp.nanos();
    let wanted = selection.of(shift_parts(&session), named, at);
    if wanted.is_empty() {
        let bag = bag.display();
        bail!("{bag} contains no such part: `probecell report {bag}` lists those it contains");
    }
    let own = part_session(&session, &wanted);
    Ok(PartSession {
        losses: session.losses,
        damage: session.damage,
        ..own
    })
}

fn write(file: &Path, page: &Page) -> anyhow::Result<()> {
    fs::write(file, page.html()).with_context(|| format!("cannot write {}", file.display()))
}

/// The page of each part in the folder `FILE_parts`, whose name is returned.
fn write_parts(
    session: &PartSession,
    parts: &[&PartReport],
    file: &Path,
) -> anyhow::Result<String> {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    // As it stands it is an address, too.
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-._".contains(letter);
    let stem = stem.replace(|letter: char| !is_plain(letter), "_");
    let name = format!("{stem}_parts");
    let folder = file.with_file_name(&name);
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for (index, part) in parts.iter().enumerate() {
        write(
            &folder.join(of_index(index)),
            &record::of_part(session, part)?,
        )?;
    }
    Ok(name)
}

/// Name of the page of a part, by its place among those of the shift.
fn of_index(index: usize) -> String {
    format!("{:03}.html", index + 1)
}

/// The page of a recording, or of one of its parts, by its place among them.
pub(super) fn html(bag: &Path, part: Option<usize>) -> anyhow::Result<String> {
    let (session, _) = record::read(bag)?;
    let parts = shift_parts(&session);
    let page = if let Some(part) = part.and_then(|index| parts.get(index)) {
        record::of_part(&session, part)?
    } else {
        let link = |index| Some(format!("?part={index}"));
        record::page(bag, &session, &link, &mut output::remark)?
    };
    Ok(page.html())
}

#[cfg(test)]
mod tests;
