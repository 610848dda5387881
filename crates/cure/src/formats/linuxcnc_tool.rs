//! LinuxCNC's tool table: length and diameter of the probe.
//!
//! LinuxCNC's user manual, "Tool table": a line for each tool, `T` its number, `Z` its length offset, `D` its diameter, behind `;` its
//! remark. The ball hangs below the spindle's nose, whose z points away from it (`probe_mount` of the contract): a ball that is farther
//! along z than declared by dz belongs to a probe that is shorter by dz. A ball that is larger by dr has a diameter larger by 2 dr.

use std::ops::Range;

use crate::CureError;
use crate::head::{Change, commented};
use crate::job::{File, Format, Job};
use crate::settings::replaced;

/// The tool table with another probe.
pub(crate) const TOOL: Format = Format {
    name: "linuxcnc-tool",
    about: "LinuxCNC's tool table with length and diameter of the probe, of a machine in mm; --current TABLE, --tool N",
    holds: &["probe.stylus_length", "probe.ball_radius"],
    write,
};

fn write(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.current("the tool table with which the machine was measured")?;
    let (begin, line) = probe(file, job.request.tool)?;
    let (mut edits, mut changes) = (Vec::new(), Vec::new());
    for cause in &job.causes {
        let (letter, parameter, factor) = match cause.kind() {
            "probe.stylus_length" => ('Z', "dz", -1e3),
            _ => ('D', "dr", 2e3),
        };
        let (bytes, before) = word(file, line, letter)?;
        let by = |size: f64| before + factor * size;
        let after = by(cause.value(parameter));
        edits.push((
            begin + bytes.start..begin + bytes.end,
            format!("{letter}{after:+.6}"),
        ));
        changes.push(Change {
            what: format!(
                "{letter} of {}",
                line.split_whitespace().next().unwrap_or_default()
            ),
            before: Some(before),
            after,
            interval: Some(cause.interval(parameter).map(by)),
        });
    }
    let undo = format!("load {} again", file.name);
    let head = job.head(&job.causes, &changes, &undo);
    Ok(commented(";", &head) + &replaced(&file.text, edits))
}

/// The line of the probe: that of the number, or the only one whose remark says so; and the byte where it begins.
fn probe(file: &File, number: Option<u32>) -> Result<(usize, &str), CureError> {
    let mut at = 0;
    let mut found = Vec::new();
    for line in file.text.split_inclusive('\n') {
        let (data, remark) = line.split_once(';').unwrap_or((line, ""));
        let own = data
            .split_whitespace()
            .find_map(|word| word.strip_prefix('T')?.parse::<u32>().ok());
        let is_it = number.map_or_else(
            || remark.to_lowercase().contains("probe"),
            |number| own == Some(number),
        );
        if own.is_some() && is_it {
            found.push((at, data));
        }
        at += line.len();
    }
    match found.as_slice() {
        [one] => Ok(*one),
        _ => Err(file.wrong(format!(
            "{} lines are of the probe: say which by --tool N",
            found.len()
        ))),
    }
}

/// A number behind a letter, with the bytes of both in the line.
fn word(file: &File, line: &str, letter: char) -> Result<(Range<usize>, f64), CureError> {
    let mut words = line.split_whitespace();
    let found =
        words.find_map(|word| Some((word, word.strip_prefix(letter)?.parse::<f64>().ok()?)));
    let place = found.and_then(|(word, value)| Some((line.find(word)?, word.len(), value)));
    let (place, length, value) = place.ok_or_else(|| {
        file.wrong(format!(
            "the line of the probe has no {letter} with a number"
        ))
    })?;
    Ok((place..place + length, value))
}
