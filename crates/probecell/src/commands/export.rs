//! `probecell export`: sizes, touches and offsets of a recording in the formats of other systems.

use std::path::PathBuf;

use bags::Bag;
use clap::ValueEnum;
use exchange::export::table;
use session_io::export::record;

use super::external::{self, choice, option};
use crate::output;

/// A format that goes out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// QIF 3.0 Results (ISO 23952): sizes with combined uncertainty and status, features, touches.
    Qif,
    /// AQDEF (.dfq): characteristics and their values.
    Dfq,
    /// DMIS 5.2 output (ISO 22093): features nominal and measured, tolerances, touches.
    Dmis,
    /// CSV table of sizes.
    Csv,
    /// CSV table of touches, which `import touches` reads back.
    CsvTouches,
    /// MTConnect 2.7 Streams: feature measurements, tool and work offsets.
    Mtconnect,
    /// MTConnect 2.7 Devices: the model that belongs to them.
    MtconnectDevices,
}

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
probecell export recordings/turn_mill_1 --format qif --out punch.qif\n  \
probecell export my_session --format dfq > punch.dfq\n\n\
What each format carries, and what is lost in it: docs/exchange.md.")]
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

/// Writes a table; other documents are written by the program for formats.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let write = match arguments.format {
        Format::Csv => table::sizes,
        Format::CsvTouches => table::touches,
        _ => {
            let mut options = vec![choice("format", &arguments.format)];
            options.extend(arguments.out.as_ref().map(|out| option("out", out)));
            return external::read_by_formats(&["export"], options, &arguments.bag);
        }
    };
    let bag = Bag::open(&arguments.bag)?;
    let damage = bag.verify();
    let record = record(&bag, &arguments.bag)?;
    terminal::document(&write(&record), arguments.out.as_deref())?;
    Ok(output::damage(&damage))
}
