//! `probecell import`: files of other systems as sessions that `info`, `report`, `diagnose` and `adopt` take like any other.
//!
//! Tables and recordings are read by the crate `exchange`, and a session is written by `session_io`; QIF and DMIS are read by the
//! program `probecell-formats`, to which `plan` and `reference` hand over.

mod contacts;
mod controller_state;
mod motion;
mod plan;
mod readings;
mod reference;
mod touches;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use exchange::import::Imported;
use exchange::table::Layout;
use exchange::units::Units;
use session_io::import::name_of;
use session_io::imported::{self, Source};

use crate::{GOOD, LOSS, REVISION, output};

/// What is imported.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// A table of touches, a row for each.
    Touches(touches::Arguments),
    /// Touches of a ROS 2 recording: poses or joint states, and a contact signal.
    Contacts(contacts::Arguments),
    /// Joint states of a moving robot, with its description.
    Motion(motion::Arguments),
    /// Features, tolerances and points of a QIF or DMIS file, as the plan of a session without touches.
    Plan(plan::Arguments),
    /// Results of an independent instrument for the points of a recording: a QIF or DMIS result, or a table.
    Reference(reference::Arguments),
    /// A positioning test (ISO 230-2), a circular test (ISO 230-4) or an R-test.
    Readings(readings::Arguments),
}

/// A format of other metrology systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Format {
    /// QIF 3 (ISO 23952).
    Qif,
    /// DMIS (ISO 22093).
    Dmis,
    /// A table, with --columns and --units.
    Csv,
}

/// Imports.
pub(crate) fn run(command: &Command) -> anyhow::Result<u8> {
    match command {
        Command::Touches(arguments) => touches::run(arguments),
        Command::Contacts(arguments) => contacts::run(arguments),
        Command::Motion(arguments) => motion::run(arguments),
        Command::Plan(arguments) => plan::run(arguments),
        Command::Reference(arguments) => reference::run(arguments),
        Command::Readings(arguments) => readings::run(arguments),
    }
}

/// Writes the session, prints what was read, and gives the exit status: 3 where rows were refused.
fn write(
    folder: &Path,
    imported: &Imported,
    settings: Option<&analysis::RawConfig>,
    source: &Source,
) -> anyhow::Result<u8> {
    let written = imported::write(folder, imported, settings, source)?;
    for remark in &written.remarks {
        output::remark(remark);
    }
    for line in &written.lines {
        output::line(line);
    }
    Ok(if written.is_whole { GOOD } else { LOSS })
}

/// How a table is written, and its units.
#[derive(clap::Args)]
pub(super) struct TableArguments {
    /// Units of the file, for example length=mm,deviation=um,angle=deg,time=s: no unit is guessed.
    #[arg(long, default_value = "", hide_default_value = true)]
    units: String,
    /// Column delimiter: one character, `tab`, or `blanks` for any number of blanks and tabs.
    #[arg(long, default_value = ",")]
    delimiter: String,
    /// Numbers have a decimal comma.
    #[arg(long)]
    decimal_comma: bool,
    /// The file has no line with names of columns; columns are #1, #2 and so on.
    #[arg(long)]
    no_header: bool,
    /// Lines of the table in the file, FIRST-LAST or FIRST-; a title above and sums below are left out.
    #[arg(
        long,
        value_name = "LINES",
        default_value = "1-",
        hide_default_value = true
    )]
    lines: String,
}

impl TableArguments {
    fn layout(&self) -> anyhow::Result<Layout> {
        let delimiter = match (self.delimiter.as_str(), self.delimiter.chars().count()) {
            ("tab", _) => '\t',
            ("blanks", _) => ' ',
            (text, 1) => text.chars().next().unwrap_or(','),
            _ => bail!("--delimiter must be one character, tab or blanks"),
        };
        ensure!(
            !(self.decimal_comma && delimiter == ','),
            "--decimal-comma needs another --delimiter than a comma"
        );
        let (first, last) = self
            .lines
            .split_once('-')
            .unwrap_or((&self.lines, &self.lines));
        let number = |text: &str| text.trim().parse::<u64>().ok();
        let lines = match (number(first), number(last)) {
            (Some(first), None) if last.trim().is_empty() => (first, u64::MAX),
            (Some(first), Some(last)) => (first, last),
            _ => (0, 0),
        };
        ensure!(
            1 <= lines.0 && lines.0 <= lines.1,
            "--lines must be FIRST-LAST or FIRST-, from 1"
        );
        Ok(Layout {
            lines,
            delimiter,
            decimal_comma: self.decimal_comma,
            header: !self.no_header,
        })
    }

    fn units(&self) -> anyhow::Result<Units> {
        Units::parse(&self.units).context("--units")
    }
}

/// Where the session goes, and with what uncertainty its sizes are evaluated.
#[derive(clap::Args)]
pub(super) struct OutArguments {
    /// Folder of the recording to be written; must not exist.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Name of the plan and of the part; default: that of the file.
    #[arg(long)]
    name: Option<String>,
    /// Standard uncertainty of one touch; with it features are evaluated, with U and conformity.
    #[arg(long, value_name = "UM")]
    touch_uncertainty_um: Option<f64>,
    /// Standard uncertainty that all touches share, per radius or distance (calibration of the stylus, temperature).
    #[arg(
        long,
        value_name = "UM",
        default_value_t = 0.0,
        requires = "touch_uncertainty_um"
    )]
    common_uncertainty_um: f64,
    /// Coverage factor of U.
    #[arg(long, default_value_t = 2.0, requires = "touch_uncertainty_um")]
    coverage_factor: f64,
}

impl OutArguments {
    /// Name of plan and part of a file.
    fn name(&self, file: &Path) -> anyhow::Result<String> {
        name_of(self.name.as_deref(), file)
    }

    fn settings(&self) -> Option<analysis::RawConfig> {
        self.touch_uncertainty_um.map(|touch| analysis::RawConfig {
            touch_standard_uncertainty_um: touch,
            common_standard_uncertainty_um: self.common_uncertainty_um,
            coverage_factor: self.coverage_factor,
            ..analysis::RawConfig::default()
        })
    }
}
