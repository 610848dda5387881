//! Sizes, touches and offsets of a recording in the formats of other systems.

use std::path::PathBuf;

use bags::Bag;
use clap::ValueEnum;
use connector::mtconnect;
use formats::export::{aqdef, dmis, qif};
use session_io::export::record;

/// A format that goes out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// QIF 3.0 Results (ISO 23952).
    Qif,
    /// AQDEF.
    Dfq,
    /// DMIS 5.2 output (ISO 22093).
    Dmis,
    /// MTConnect 2.7 Streams.
    Mtconnect,
    /// MTConnect 2.7 Devices.
    MtconnectDevices,
}

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Bag: a folder or an .mcap file.
    bag: PathBuf,
    /// Format.
    #[arg(long, value_enum)]
    format: Format,
    /// File to write; without it the document goes to standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Writes the document.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let bag = Bag::open(&arguments.bag)?;
    let damage = bag.verify();
    let record = record(&bag, &arguments.bag)?;
    let text = match arguments.format {
        Format::Qif => qif::write(&record),
        Format::Dfq => aqdef::write(&record),
        Format::Dmis => dmis::write(&record),
        Format::Mtconnect => mtconnect::streams(&record, false),
        Format::MtconnectDevices => mtconnect::devices(&record),
    };
    terminal::document(&text, arguments.out.as_deref())?;
    Ok(terminal::damage(&damage))
}
