//! `probecell cure`: what a report found becomes what the machine loads.
//!
//! Nothing is sent to a machine, and no file is written over another.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::builder::{PossibleValue, PossibleValuesParser};
use cure::{FORMATS, File, Format, Request};
use session_io::import::text_of;

use super::gap_report;
use crate::{FAILED, GOOD, output};

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Report of `probecell diagnose --json` (`-` for standard input), or a recording, which is diagnosed.
    source: PathBuf,
    /// What to write; without it each cause is listed with what mends it.
    #[arg(long = "as", value_name = "FORMAT", value_parser = formats())]
    format: Option<String>,
    /// File to write; must not exist. Without it, or with `-`, standard output.
    #[arg(long, value_name = "FILE", requires = "format")]
    out: Option<PathBuf>,
    /// Report or recording of the machine after it has loaded what was written from SOURCE: what became of each cause; exit status
    /// 1 unless all are gone.
    #[arg(long, value_name = "SOURCE", conflicts_with = "format")]
    after: Option<PathBuf>,
    /// Of effects that the session could not distinguish, take this one; may be repeated.
    #[arg(long = "member", value_name = "NAME")]
    members: Vec<String>,
    /// Write this cause and no other; may be repeated.
    #[arg(long, value_name = "NAME", requires = "format")]
    only: Vec<String>,
    /// The axis, for a format that holds one.
    #[arg(long, requires = "format")]
    axis: Option<String>,
    /// Number of the probe in a tool table; default: the tool whose remark says `probe`.
    #[arg(long, value_name = "N", requires = "format")]
    tool: Option<u32>,
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

fn formats() -> PossibleValuesParser {
    let formats = FORMATS.iter();
    PossibleValuesParser::new(formats.map(|one| PossibleValue::new(one.name).help(one.about)))
}

/// Lists, or writes.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let (report, text, recorded) = gap_report::of(&arguments.source)?;
    if let Some(after) = &arguments.after {
        let (after, _, _) = gap_report::of(after)?;
        let (text, all_gone) = cure::after_table(&report, &arguments.members, &after)?;
        output::line(&text);
        return Ok(if all_gone { GOOD } else { FAILED });
    }
    let digest = cure::digest(text.as_bytes());
    let Some(format) = &arguments.format else {
        let lines = cure::lines(&report, &arguments.members)?;
        output::line(&cure::table(&report, &lines));
        return Ok(GOOD);
    };
    let mut formats = FORMATS.iter().copied();
    let format: &'static Format = formats
        .find(|one| one.name == format)
        .context("no format")?;
    let given = arguments.urdf.as_deref().map(file).transpose()?;
    let urdf = given.or(recorded.map(|text| File {
        name: format!("the robot description of {}", arguments.source.display()),
        text,
    }));
    let current = arguments.current.as_deref().map(file).transpose()?;
    let text = cure::write(&Request {
        report: &report,
        digest: &digest,
        format,
        members: &arguments.members,
        only: &arguments.only,
        axis: arguments.axis.as_deref(),
        tool: arguments.tool,
        points: arguments.points,
        travel: [arguments.from, arguments.to],
        urdf: urdf.as_ref(),
        current: current.as_ref(),
    })?;
    let out = arguments.out.as_deref();
    if terminal::new_document(&text, out)? {
        output::line(&format!(
            "wrote {}",
            out.unwrap_or(Path::new("-")).display()
        ));
    }
    Ok(GOOD)
}

fn file(path: &Path) -> anyhow::Result<File> {
    let text = text_of(path)?;
    Ok(File {
        name: path.display().to_string(),
        text,
    })
}
