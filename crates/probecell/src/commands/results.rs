//! `probecell results`: what a controller printed or wrote.
//!
//! A file that is not what it should be is refused as a whole, with line and column: half a measurement is none.

use std::{
    fs::File,
    io::Read,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail, ensure};
use bags::{Bag, Session};
use cell::Cell;
use controllers::{
    axes::{Axis, Letter},
    linuxcnc::log::{Entry, Fate, read_log},
    results::{self, Frame, Inspected, Printed, SurfaceFile},
    text::{Lines, ParseError},
};
use graph::Stamp;
use machine::Chain;
use probecell_msgs::{InspectionPlan, ProbeEvent};
use serde::Serialize;
use serde_json::{Value, json};

use super::{plan, program};
use crate::{GOOD, LOSS, report};

/// A larger file is no report of a controller, bytes.
const LARGEST: u64 = 256 << 20;

/// Units of a position whose axes are known.
const SI: &str = "m, rad";

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Files that the controller wrote: one, or those of a scan that broke off and of what followed. A point touched in a
    /// later file replaces that in an earlier one.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// What the files are.
    #[arg(long, default_value = "auto")]
    format: Format,
    /// Cell file or bag with the plan that was measured: sizes are computed from the touches.
    #[arg(long, value_name = "PLAN_OR_BAG")]
    plan: Option<PathBuf>,
    /// Letter of an axis, where it is not the axis' name; as in `probecell program`.
    #[arg(long = "axis", value_name = "NAME=LETTER")]
    axes: Vec<String>,
    /// Allowance that was left on the sizes of a cell's part.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    allowance_mm: f64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Formats of results.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Format {
    /// As its first line says.
    Auto,
    /// Lines printed by DPRNT of a FANUC program of this cell.
    Dprnt,
    /// Printout of inspection cycles: sizes, positions, marks.
    Inspection,
    /// Surface-result file, START to END.
    Surface,
    /// Log or saved parameters of a SINUMERIK: touches, R parameters, result fields.
    SinumerikLog,
    /// Log of a LinuxCNC program of this cell.
    LinuxcncLog,
}

/// A touch: m and rad, or mm and degrees where the file does not tell its axes.
#[derive(Debug, Serialize)]
struct Touch {
    outcome: &'static str,
    number: u32,
    point_index: u32,
    /// `None`: in the order of the program's axes.
    axes: Option<Vec<Letter>>,
    units: &'static str,
    position: Vec<f64>,
    #[serde(skip)]
    machine: bool,
}

/// What a file holds, whatever its format.
struct Found {
    /// As it stands there.
    content: Value,
    touches: Vec<Touch>,
    lines: Vec<String>,
    complete: bool,
}

/// Reads and prints.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let mut all = Vec::new();
    for path in &arguments.files {
        all.push(file(path, arguments.format)?);
    }
    let complete = all.last().is_some_and(|(_, found)| found.complete);
    let sizes = match &arguments.plan {
        Some(source) => Some(sizes(arguments, source, &all)?),
        None => None,
    };
    if !complete {
        report::remark("warning: the program has not come to its end");
    }
    if arguments.json {
        let files = arguments.files.iter().zip(&all);
        let files = files.map(|(path, (format, found))| {
            json!({
                "file": path,
                "format": format,
                "complete": found.complete,
                "content": found.content,
            })
        });
        let mut whole =
            json!({ "schema": "probecell/results/1", "files": files.collect::<Value>() });
        if let Some((deviations, features)) = &sizes {
            whole["deviations"] = serde_json::to_value(deviations)?;
            whole["features"] = serde_json::to_value(features)?;
        }
        report::json(&whole)?;
    } else {
        for line in all.iter().flat_map(|(_, found)| &found.lines) {
            report::line(line);
        }
        if let Some((_, features)) = &sizes {
            plan::print_features(features);
        }
    }
    Ok(if complete { GOOD } else { LOSS })
}

/// Points that were touched according to a file.
pub(crate) fn touched(path: &Path) -> anyhow::Result<Vec<u32>> {
    let (_, found) = file(path, Format::Auto)?;
    let touches = found.touches.iter().filter(|one| one.outcome == "touch");
    Ok(touches.map(|one| one.point_index).collect())
}

/// Reads one file.
fn file(path: &Path, format: Format) -> anyhow::Result<(Format, Found)> {
    let text = text_of(path)?;
    let named =
        |error: ParseError| anyhow::Error::new(error).context(format!("{}", path.display()));
    let format = match format {
        Format::Auto => recognise(&text).map_err(named)?,
        known => known,
    };
    Ok((format, read(format, &text).map_err(named)?))
}

/// The file with plain ends of lines, and without the control codes of a serial line (DC1 to DC4).
fn text_of(path: &Path) -> anyhow::Result<String> {
    let unread = || format!("{} cannot be read", path.display());
    let mut bytes = Vec::new();
    let kind = std::fs::metadata(path).with_context(unread)?;
    ensure!(kind.is_file(), "{} is not a regular file", path.display());
    let file = File::open(path).with_context(unread)?;
    file.take(LARGEST + 1)
        .read_to_end(&mut bytes)
        .with_context(unread)?;
    ensure!(
        bytes.len() as u64 <= LARGEST,
        "{} is larger than {} MiB: it is no report of a controller",
        path.display(),
        LARGEST >> 20
    );
    // DPRNT ends a block by a carriage return, with or without a line feed on either side.
    let mut plain = Vec::with_capacity(bytes.len());
    let mut ended = 0;
    for byte in bytes {
        match byte {
            0x11..=0x14 => {}
            b'\r' | b'\n' if ended != 0 && ended != byte => ended = 0,
            b'\r' | b'\n' => {
                ended = byte;
                plain.push(b'\n');
            }
            other => {
                ended = 0;
                plain.push(other);
            }
        }
    }
    let mut lines = Lines::default();
    lines
        .push(&plain)
        .and_then(|()| lines.push(b"\n"))
        .with_context(|| format!("{}", path.display()))?;
    String::from_utf8(plain).with_context(unread)
}

/// The format by the first line that holds something.
fn recognise(text: &str) -> Result<Format, ParseError> {
    let wrong = |line, found: String| ParseError {
        line,
        column: 1,
        expected: "a printed touch, an inspection printout, a surface-result file or a log"
            .to_owned(),
        found,
    };
    let Some((line, content)) = (1..)
        .zip(text.lines())
        .find(|(_, one)| !one.trim().is_empty())
    else {
        return Err(wrong(1, "the end of the file".to_owned()));
    };
    let content = content.trim();
    let first = content.split_whitespace().next().unwrap_or_default();
    match first {
        "AXES" => Ok(Format::Dprnt),
        "COMPONENT" | "SIZE" | "POSN" => Ok(Format::Inspection),
        "START" => Ok(Format::Surface),
        "begin" | "next" => Ok(Format::LinuxcncLog),
        _ if content.contains('=') || content.starts_with("%_N_") || content.starts_with(';') => {
            Ok(Format::SinumerikLog)
        }
        "TOUCH" | "MISS" => Ok(Format::Dprnt),
        _ => Err(wrong(line, format!("{content:?}"))),
    }
}

fn read(format: Format, text: &str) -> Result<Found, ParseError> {
    Ok(match format {
        Format::Dprnt | Format::Auto => printed(results::printed_touches(text)?),
        Format::Inspection => inspected(&results::inspection_printout(text)?),
        Format::Surface => surface(&results::surface_results(text)?),
        Format::SinumerikLog => sinumerik(results::sinumerik_log(text)?),
        Format::LinuxcncLog => linuxcnc(read_log(text)?),
    })
}

fn of_touches(touches: Vec<Touch>, complete: bool) -> Found {
    Found {
        content: json!({ "touches": touches }),
        lines: touches.iter().map(Touch::line).collect(),
        touches,
        complete,
    }
}

impl Touch {
    fn line(&self) -> String {
        let letter = |index: usize| self.axes.as_ref().and_then(|axes| axes.get(index)).copied();
        let shown = |(index, value): (usize, &f64)| match letter(index) {
            Some(letter) => format!("{letter} {:.4}", letter.to_controller(*value)),
            None => format!("{value:.7}"),
        };
        let values: Vec<_> = self.position.iter().enumerate().map(shown).collect();
        format!(
            "{:<6}{:>4}  point {:>4}  {}",
            self.outcome,
            self.number,
            self.point_index,
            values.join("  ")
        )
    }
}

fn outcome(touched: bool) -> &'static str {
    if touched { "touch" } else { "miss" }
}

fn printed(printed: Printed) -> Found {
    let axes = printed.axes;
    let touches = printed.touches.into_iter().map(|one| Touch {
        outcome: outcome(one.touched),
        number: one.number,
        point_index: one.point_index,
        position: axes
            .iter()
            .zip(&one.position)
            .map(|(letter, value)| letter.from_controller(*value))
            .collect(),
        axes: Some(axes.clone()),
        units: SI,
        machine: true,
    });
    of_touches(touches.collect(), true)
}

fn sinumerik(log: results::Log) -> Found {
    let touches = log.touches.into_iter().map(|one| Touch {
        outcome: outcome(one.touched),
        number: one.number,
        point_index: one.point_index,
        axes: Some(one.position.iter().map(|(letter, _)| *letter).collect()),
        units: SI,
        position: one
            .position
            .iter()
            .map(|(letter, value)| letter.from_controller(*value))
            .collect(),
        machine: one.frame == Frame::Machine,
    });
    let mut found = of_touches(touches.collect(), true);
    found.content["values"] = log
        .values
        .iter()
        .map(|(name, value)| json!({ "name": name, "value": value }))
        .collect();
    let values = log.values.iter();
    found
        .lines
        .extend(values.map(|(name, value)| format!("{name} = {value}")));
    found
}

/// A log of LinuxCNC tells positions in mm and degrees in the order of the program's axes, whose letters it does not tell.
fn linuxcnc(entries: Vec<Entry>) -> Found {
    let complete = matches!(entries.last(), Some(Entry::End));
    let mut touches = Vec::new();
    for entry in entries {
        if let Entry::Probed {
            number,
            point_index,
            fate,
            position,
        } = entry
        {
            touches.push(Touch {
                outcome: match fate {
                    Fate::Touch => "touch",
                    Fate::Miss => "miss",
                    Fate::Stuck => "stuck",
                },
                number,
                point_index,
                axes: None,
                units: "mm, degrees",
                position,
                machine: true,
            });
        }
    }
    of_touches(touches, complete)
}

fn inspected(results: &[Inspected]) -> Found {
    let line = |one: &Inspected| {
        let mark = one
            .out_of_tolerance
            .map_or(String::new(), |by| format!("  out of tolerance by {by:.4}"));
        format!(
            "component {} feature {}  {} {:.4} mm, actual {:.4} mm, deviation {:+.4} mm{mark}",
            one.component, one.feature, one.quantity, one.nominal, one.actual, one.deviation
        )
    };
    Found {
        content: json!({ "inspected": results }),
        touches: Vec::new(),
        lines: results.iter().map(line).collect(),
        complete: true,
    }
}

fn surface(file: &SurfaceFile) -> Found {
    let header = file.header.iter();
    let mut lines: Vec<_> = header
        .map(|(word, rest)| format!("{word} {rest}"))
        .collect();
    lines.extend(file.points.iter().map(|point| {
        let deviation = point.deviation.map_or("no deviation".to_owned(), |value| {
            format!("deviation {value:+.4} mm")
        });
        format!("point {}: {deviation}", point.number)
    }));
    Found {
        content: json!({ "header": file.header, "points": file.points }),
        touches: Vec::new(),
        lines,
        complete: true,
    }
}

type Sizes = (Vec<probecell_msgs::TouchDeviation>, plan::Features);

/// Deviations and sizes from the touches and the plan, as the cell's own analysis computes them.
fn sizes(arguments: &Arguments, source: &Path, files: &[(Format, Found)]) -> anyhow::Result<Sizes> {
    let mut touches: Vec<&Touch> = Vec::new();
    for (_, found) in files {
        let again = |old: &&Touch| {
            let same = |new: &Touch| new.point_index == old.point_index;
            found.touches.iter().all(|new| !same(new))
        };
        touches.retain(again);
        touches.extend(&found.touches);
    }
    ensure!(
        !touches.is_empty(),
        "there is no touch to compare with the plan"
    );
    ensure!(
        touches.iter().all(|touch| touch.machine),
        "the touches are in work coordinates, which say nothing of the machine's axes"
    );
    let (plan, chain, axes) = planned(arguments, source)?;
    let mut events = Vec::new();
    for (sequence, touch) in (0..).zip(touches) {
        if touch.point_index as usize >= plan.points.len() {
            bail!(
                "touch {} is of point {}, but the plan has {} points",
                touch.number,
                touch.point_index,
                plan.points.len()
            );
        }
        let (axis_names, axis_positions) = positions(touch, &axes)?;
        chain
            .positions(&axis_names, &axis_positions)
            .with_context(|| format!("touch {}", touch.number))?;
        events.push(ProbeEvent {
            sequence,
            plan_id: plan.plan_id.clone(),
            point_index: touch.point_index,
            outcome: match touch.outcome {
                "touch" => ProbeEvent::OUTCOME_TOUCHED,
                "miss" => ProbeEvent::OUTCOME_NO_CONTACT,
                _ => ProbeEvent::OUTCOME_EARLY,
            },
            axis_names,
            axis_positions,
            ..ProbeEvent::default()
        });
    }
    let stamped = (0..).map(Stamp).zip(&events);
    plan::analyse(chain, &plan, stamped.collect())
}

/// Names and positions (m, rad) of the axes of a touch.
fn positions(touch: &Touch, axes: &[Axis]) -> anyhow::Result<(Vec<String>, Vec<f64>)> {
    let mut names = Vec::new();
    let mut values = Vec::new();
    if let Some(letters) = &touch.axes {
        for (letter, value) in letters.iter().zip(&touch.position) {
            let axis = axes.iter().find(|axis| axis.letter == *letter);
            let axis = axis.with_context(|| {
                format!("touch {}: the machine has no axis {letter}", touch.number)
            })?;
            names.push(axis.name.clone());
            values.push(*value);
        }
    } else {
        ensure!(
            touch.position.len() == axes.len(),
            "touch {} has {} positions for {} axes",
            touch.number,
            touch.position.len(),
            axes.len()
        );
        for (axis, value) in axes.iter().zip(&touch.position) {
            names.push(axis.name.clone());
            values.push(axis.letter.from_controller(*value));
        }
    }
    Ok((names, values))
}

/// The plan that was measured, its machine, and the axes as the controller calls them.
fn planned(
    arguments: &Arguments,
    source: &Path,
) -> anyhow::Result<(InspectionPlan, Chain, Vec<Axis>)> {
    if plan::is_cell(source) {
        let cell = Cell::read(source)?;
        let chain = Chain::from_urdf(&cell.text().robot_description)?;
        let axes = match cell.linuxcnc.clone() {
            Some(raw) => raw.check()?.axes,
            None => program::axes(&chain, &arguments.axes)?,
        };
        ensure!(
            arguments.allowance_mm.is_finite(),
            "--allowance-mm must be a finite number"
        );
        let plan = super::plan::part_of(&cell, arguments.allowance_mm * 1e-3)?;
        return Ok((plan, chain, axes));
    }
    let session = Session::read(&Bag::open(source)?)?;
    let chain = Chain::from_urdf(&session.robot_description)?;
    let axes = program::axes(&chain, &arguments.axes)?;
    let plan = session
        .plan
        .with_context(|| format!("{} has no inspection plan", source.display()))?;
    Ok((plan, chain, axes))
}
