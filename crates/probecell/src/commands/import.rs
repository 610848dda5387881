//! `probecell import`: files of other systems as sessions that `info`, `report`, `diagnose` and `adopt` take like any other.
//!
//! Formats are read by the crate `exchange`; here a session is written, with the features evaluated where the uncertainty of
//! a touch is known. Each file is attached to the recording as it was.

mod contacts;
mod plan;
mod readings;
mod reference;
mod touches;
mod write;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use exchange::table::Layout;
use exchange::units::Units;

use write::write;
pub(super) use write::{Source, write_session};

/// A larger file is no table of touches, bytes.
const LARGEST: u64 = 1 << 30;

/// What is imported.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// A table of touches, a row for each.
    Touches(touches::Arguments),
    /// Touches of a ROS 2 recording: poses or joint states, and a contact signal.
    Contacts(contacts::Arguments),
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
        Command::Plan(arguments) => plan::run(arguments),
        Command::Reference(arguments) => reference::run(arguments),
        Command::Readings(arguments) => readings::run(arguments),
    }
}

/// How a table is written, and its units.
#[derive(clap::Args)]
pub(super) struct TableArguments {
    /// Units of the file, for example length=mm,deviation=um,angle=deg,time=s: no unit is guessed.
    #[arg(long, default_value = "", hide_default_value = true)]
    units: String,
    /// Column delimiter: one character, or `tab`.
    #[arg(long, default_value = ",")]
    delimiter: String,
    /// Numbers have a decimal comma.
    #[arg(long)]
    decimal_comma: bool,
    /// The file has no line with names of columns; columns are #1, #2 and so on.
    #[arg(long)]
    no_header: bool,
}

impl TableArguments {
    fn layout(&self) -> anyhow::Result<Layout> {
        let delimiter = match (self.delimiter.as_str(), self.delimiter.chars().count()) {
            ("tab", _) => '\t',
            (text, 1) => text.chars().next().unwrap_or(','),
            _ => bail!("--delimiter must be one character, or tab"),
        };
        ensure!(
            !(self.decimal_comma && delimiter == ','),
            "--decimal-comma needs another --delimiter than a comma"
        );
        Ok(Layout {
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

/// The name given, else that of a file.
fn name_of(given: Option<&str>, file: &Path) -> anyhow::Result<String> {
    let of_file = || {
        file.file_stem()
            .map(|stem| stem.to_string_lossy().into_owned())
    };
    let name = given
        .map(str::to_owned)
        .or_else(of_file)
        .unwrap_or_default();
    ensure!(
        !name.is_empty() && !name.chars().any(probecell_msgs::is_unprintable),
        "--name must be a printable name"
    );
    Ok(name)
}

/// The text of a file.
fn text_of(file: &Path) -> anyhow::Result<String> {
    let unread = || format!("{} cannot be read", file.display());
    let known = std::fs::metadata(file).with_context(unread)?;
    ensure!(known.is_file(), "{} is not a regular file", file.display());
    ensure!(
        known.len() <= LARGEST,
        "{} is larger than 1 GiB",
        file.display()
    );
    let bytes = std::fs::read(file).with_context(unread)?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let line = error.as_bytes()[..at].split(|&byte| byte == b'\n').count();
        anyhow::anyhow!(
            "{}: line {line} is not UTF-8 text (iconv -f latin1 -t utf8 converts it from Latin-1)",
            file.display()
        )
    })
}
