//! `probecell import plan`: features, tolerances and points of other systems.

use std::path::PathBuf;

use anyhow::{Context, bail};
use exchange::import::{Counts, Imported, dmis, qif};
use machine::PART_FRAME_MACHINE;

use super::{Format, Source, text_of, write};

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  \
probecell import plan bracket.qif --format qif --out bracket\n  \
probecell import touches measured.csv --plan bracket --columns point=P,x=X,y=Y,z=Z --units length=mm --out session")]
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
        Format::Csv => bail!("a plan in a table is the table of features of `import touches`"),
    };
    let found = read.with_context(|| arguments.file.display().to_string())?;
    let name = super::name_of(arguments.name.as_deref(), &arguments.file)?;
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
    };
    write(&arguments.out, &imported, None, &source)
}
