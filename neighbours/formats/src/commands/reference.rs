//! What an outside instrument found of the points of a recording.

use std::path::PathBuf;

use formats::import::{dmis, qif};
use session_io::reference::{Request, add};

use super::Format;

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The file of the instrument.
    file: PathBuf,
    /// Its format.
    #[arg(long, value_enum)]
    format: Format,
    /// Recording whose points were measured.
    #[arg(long, value_name = "BAG")]
    to: PathBuf,
    /// Which of its plans; default: the last one measured.
    #[arg(long)]
    plan: Option<String>,
    /// Name of the instrument.
    #[arg(long)]
    instrument: String,
    /// Standard uncertainty of its deviations.
    #[arg(long, value_name = "UM")]
    uncertainty_um: f64,
    /// Folder of the recording to be written; must not exist.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// Imports.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let request = Request {
        file: &arguments.file,
        to: &arguments.to,
        plan: arguments.plan.as_deref(),
        instrument: &arguments.instrument,
        uncertainty_um: arguments.uncertainty_um,
        out: &arguments.out,
    };
    let (summary, damage) = add(&request, |text| match arguments.format {
        Format::Qif => {
            let (found, left_out) = qif::results(text)?;
            for one in left_out {
                terminal::remark(&format!("note: left out: {one}"));
            }
            Ok(found)
        }
        Format::Dmis => Ok(dmis::results(text)?),
    })?;
    terminal::line(&summary);
    Ok(terminal::damage(&damage))
}
