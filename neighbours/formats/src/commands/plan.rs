//! Features, tolerances and points of other systems.

use std::path::PathBuf;

use anyhow::Context;
use exchange::import::{Counts, Imported};
use formats::import::{dmis, qif};
use machine::PART_FRAME_MACHINE;
use session_io::import::{name_of, text_of};
use session_io::imported::{self, Source};
use terminal::GOOD;

use super::Format;

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The file.
    file: PathBuf,
    /// Its format.
    #[arg(long, value_enum)]
    format: Format,
    /// Name of the plan and of the part; default: that of the file.
    #[arg(long)]
    name: Option<String>,
    /// Folder of the recording to be written; must not exist.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// Imports.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let text = text_of(&arguments.file)?;
    let read = match arguments.format {
        Format::Qif => qif::plan(&text),
        Format::Dmis => dmis::plan(&text),
    };
    let found = read.with_context(|| arguments.file.display().to_string())?;
    let name = name_of(arguments.name.as_deref(), &arguments.file)?;
    let imported = Imported {
        robot_description: PART_FRAME_MACHINE.to_owned(),
        plan: found.plan(&name),
        counts: Counts {
            read: found.features.len() as u64,
            refused: found.left_out.len() as u64,
            ..Counts::default()
        },
        remarks: found
            .left_out
            .iter()
            .map(|one| format!("left out: {one}"))
            .collect(),
        ..Imported::default()
    };
    let source = Source {
        kind: "plan",
        files: vec![arguments.file.clone()],
        settings: Vec::new(),
        cell: None,
        revision: env!("PROBECELL_REVISION"),
    };
    let written = imported::write(&arguments.out, &imported, None, &source)?;
    written.remarks.iter().for_each(|one| terminal::remark(one));
    written.lines.iter().for_each(|one| terminal::line(one));
    Ok(GOOD)
}
