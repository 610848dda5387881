//! `probecell cure`: what a report found becomes what the machine loads.
//!
//! Nothing is sent to a machine, and no file is written over another.

use std::fs::{self, File as Opened};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::builder::PossibleValuesParser;
use cure::{FORMATS, File, Format, Request};
use diagnosis::{Options, Report};

use super::diagnose;
use crate::{GOOD, output};

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Report of `probecell diagnose --json` (`-` for standard input), or a recording, which is diagnosed.
    source: PathBuf,
    /// What to write; without it each cause is listed with what mends it.
    #[arg(long = "as", value_name = "FORMAT", value_parser = PossibleValuesParser::new(FORMATS.iter().map(|one| one.name)))]
    format: Option<String>,
    /// File to write; must not exist. Without it, or with `-`, standard output.
    #[arg(long, value_name = "FILE", requires = "format")]
    out: Option<PathBuf>,
    /// Of effects that the session could not distinguish, take this one; may be repeated.
    #[arg(long = "member", value_name = "NAME")]
    members: Vec<String>,
    /// Write this cause and no other; may be repeated.
    #[arg(long, value_name = "NAME", requires = "format")]
    only: Vec<String>,
    /// The axis, for a format that holds one.
    #[arg(long, requires = "format")]
    axis: Option<String>,
    /// Number of places of a table; default: as many as the causes need.
    #[arg(long, requires = "format")]
    points: Option<usize>,
    /// Where a table begins, mm or degrees; default: where the axis was measured.
    #[arg(long, requires = "format", allow_hyphen_values = true)]
    from: Option<f64>,
    /// Where a table ends, mm or degrees; default: where the axis was measured.
    #[arg(long, requires = "format", allow_hyphen_values = true)]
    to: Option<f64>,
    /// Robot description against which the machine was measured; default: that of the recording.
    #[arg(long, value_name = "FILE", requires = "format")]
    urdf: Option<PathBuf>,
    /// Settings of the machine as they were when it was measured: INI, printer.cfg, or what `$$`, M503 or config.g say.
    #[arg(long, value_name = "FILE", requires = "format")]
    current: Option<PathBuf>,
}

/// Lists, or writes.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let (report, digest, recorded) = read(&arguments.source)?;
    let Some(format) = &arguments.format else {
        let lines = cure::lines(&report, &arguments.members)?;
        output::line(&cure::table(&report, &lines));
        return Ok(GOOD);
    };
    let mut formats = FORMATS.iter().copied();
    let format: &'static Format = formats
        .find(|one| one.name == format)
        .context("no format")?;
    let urdf = arguments
        .urdf
        .as_deref()
        .map(file)
        .transpose()?
        .or(recorded);
    let current = arguments.current.as_deref().map(file).transpose()?;
    let text = cure::write(&Request {
        report: &report,
        digest: &digest,
        format,
        members: &arguments.members,
        only: &arguments.only,
        axis: arguments.axis.as_deref(),
        points: arguments.points,
        travel: [arguments.from, arguments.to],
        urdf: urdf.as_ref(),
        current: current.as_ref(),
    })?;
    match arguments
        .out
        .as_deref()
        .filter(|out| *out != Path::new("-"))
    {
        None => output::bytes(text.as_bytes()),
        Some(out) => {
            let made = Opened::create_new(out);
            let cannot = || {
                format!(
                    "cannot write {}: name a file that does not exist",
                    out.display()
                )
            };
            made.and_then(|mut file| file.write_all(text.as_bytes()))
                .with_context(cannot)?;
            output::line(&format!("wrote {}: {}", out.display(), format.about));
        }
    }
    Ok(GOOD)
}

/// A report with the digest of its text, or the diagnosis of a recording with its robot description.
fn read(source: &Path) -> anyhow::Result<(Report, String, Option<File>)> {
    let is_report = source == Path::new("-") || source.extension().is_some_and(|end| end == "json");
    if !is_report {
        let session = diagnose::read(source, &diagnose::Arguments::default())?;
        let report = diagnosis::diagnose(&session, &Options::default())?;
        let name = format!("the robot description of {}", source.display());
        let text = serde_json::to_string_pretty(&report)? + "\n";
        let urdf = File {
            name,
            text: session.robot_description,
        };
        return Ok((report, cure::digest(text.as_bytes()), Some(urdf)));
    }
    let mut text = String::new();
    if source == Path::new("-") {
        std::io::stdin().read_to_string(&mut text)?;
    } else {
        text = fs::read_to_string(source)
            .with_context(|| format!("cannot read the report {}", source.display()))?;
    }
    let not = || format!("{} is not a single gap report", source.display());
    let mut value: serde_json::Value = serde_json::from_str(&text).with_context(not)?;
    // Of no use here, and a limit that is open is null in it.
    if let Some(next) = value.get_mut("next_measurement") {
        *next = serde_json::Value::Array(Vec::new());
    }
    let report: Report = serde_json::from_value(value).with_context(not)?;
    if report.schema != diagnosis::report::SCHEMA {
        bail!(
            "{} has the schema {:?}, not {:?}",
            source.display(),
            report.schema,
            diagnosis::report::SCHEMA
        );
    }
    Ok((report, cure::digest(text.as_bytes()), None))
}

fn file(path: &Path) -> anyhow::Result<File> {
    let text =
        fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(File {
        name: path.display().to_string(),
        text,
    })
}
