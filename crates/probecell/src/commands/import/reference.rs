//! `probecell import reference`: what an outside instrument found of the points of a recording.

use std::path::PathBuf;

use exchange::import::table_reference;
use session_io::reference::{Request, add};

use super::super::external::{self, choice, option};
use super::{Format, TableArguments};
use crate::output;

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
probecell import reference cmm.qif --format qif --to my_session --instrument CMM7 --uncertainty-um 1.2 --out with_cmm\n  \
probecell import reference cmm.csv --format csv --columns point=P,deviation=Dev --units deviation=um \\\n      \
--to my_session --instrument CMM7 --uncertainty-um 1.2 --out with_cmm && probecell report with_cmm")]
pub(crate) struct Arguments {
    /// The file of the instrument.
    file: PathBuf,
    /// Its format.
    #[arg(long, value_enum)]
    format: Format,
    /// With --format csv: columns by role, ROLE=COLUMN,...: point or nominal_x, nominal_y, nominal_z; deviation or x, y, z.
    #[arg(long, default_value = "", hide_default_value = true)]
    columns: String,
    #[command(flatten)]
    table: TableArguments,
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

/// Imports a table; other formats are read by the program for formats.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    if arguments.format != Format::Csv {
        let mut options = vec![
            choice("format", &arguments.format),
            option("to", &arguments.to),
            option("instrument", &arguments.instrument),
            option("uncertainty-um", arguments.uncertainty_um.to_string()),
            option("out", &arguments.out),
        ];
        options.extend(arguments.plan.as_ref().map(|plan| option("plan", plan)));
        return external::read_by_formats(&["import", "reference"], options, &arguments.file);
    }
    let request = Request {
        file: &arguments.file,
        to: &arguments.to,
        plan: arguments.plan.as_deref(),
        instrument: &arguments.instrument,
        uncertainty_um: arguments.uncertainty_um,
        out: &arguments.out,
    };
    let columns = &arguments.columns;
    let (summary, damage) = add(&request, |text| {
        let (layout, units) = (arguments.table.layout()?, arguments.table.units()?);
        Ok(table_reference::read(text, columns, layout, &units)?)
    })?;
    output::line(&summary);
    Ok(output::damage(&damage))
}
