//! `probecell import plan`: features, tolerances and points of other systems.

use std::path::PathBuf;

use anyhow::bail;
use session_io::import::text_of;

use super::super::external::{self, choice, option};
use super::Format;

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

/// Has the program for formats import it.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    if arguments.format == Format::Csv {
        text_of(&arguments.file)?;
        bail!("a plan in a table is the table of features of `import touches`");
    }
    let mut options = vec![
        choice("format", &arguments.format),
        option("out", &arguments.out),
    ];
    options.extend(arguments.name.as_ref().map(|name| option("name", name)));
    external::read_by_formats(&["import", "plan"], options, &arguments.file)
}
