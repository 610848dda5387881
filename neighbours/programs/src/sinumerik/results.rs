//! Reads logs of SINUMERIK programs: touches with measured values, R parameters, fields of results.
//!
//! A line is `TOUCH n p` or `MISS n p` and the position of each axis as `$AA_MM[X]=…` (machine), `$AA_MW[X]=…` (work) or,
//! after a miss, `$AA_IM[X]=…`, as [`super::program`] writes it; or one or more assignments `NAME=value`, as a
//! control saves its parameters. What frames a saved file (`%_N_…`, `;…`, `CHANDATA(1)`, `M17`, `M30`) is passed over.

use controllers::{
    axes::Letter,
    text::{ParseError, Words},
};
use serde::Serialize;
use serde_json::json;

pub use crate::results::Frame;
use crate::results::{Outcome, Results, ResultsFormat, Touch, lines};

/// A log, or saved parameters.
pub(super) struct SinumerikLog;

impl ResultsFormat for SinumerikLog {
    fn name(&self) -> &'static str {
        "sinumerik-log"
    }

    fn description(&self) -> &'static str {
        "log or saved parameters of a SINUMERIK: touches, R parameters, result fields"
    }

    fn content(&self) -> &'static str {
        "a log of a SINUMERIK"
    }

    fn recognises(&self, first_line: &str) -> bool {
        first_line.contains('=') || first_line.starts_with("%_N_") || first_line.starts_with(';')
    }

    fn read(&self, text: &str) -> Result<Results, ParseError> {
        let log = sinumerik_log(text)?;
        let touches = log.touches.into_iter().map(|touch| {
            let outcome = Outcome::of_trip(touch.touched);
            let (number, point) = (touch.number, touch.point_index);
            Touch::with_axes(outcome, number, point, touch.frame, touch.position)
        });
        let mut results = Results::of_touches(touches.collect(), true);
        let values = log.values.iter();
        results.content["values"] = values
            .clone()
            .map(|(name, value)| json!({ "name": name, "value": value }))
            .collect();
        let lines = values.map(|(name, value)| format!("{name} = {value}"));
        results.lines.extend(lines);
        Ok(results)
    }
}

/// One logged touch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoggedTouch {
    /// The probe tripped.
    pub touched: bool,
    /// Number of the touch, from 1.
    pub number: u32,
    /// Index into the plan's points.
    pub point_index: u32,
    /// In which coordinates.
    pub frame: Frame,
    /// mm and degrees, position of each axis.
    pub position: Vec<(Letter, f64)>,
}

/// What a log holds, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Log {
    /// Touches.
    pub touches: Vec<LoggedTouch>,
    /// Other values: name with indices, and value.
    pub values: Vec<(String, f64)>,
}

/// Reads a log.
///
/// # Errors
/// Line and column of what is not of the format.
pub fn sinumerik_log(text: &str) -> Result<Log, ParseError> {
    let mut log = Log::default();
    for (line, content) in lines(text) {
        let content = content.split_once(';').map_or(content, |(code, _)| code);
        let mut words = Words::new(line, content);
        match words.clone().next_word().unwrap_or_default() {
            "TOUCH" => log.touches.push(touch(&mut words, true)?),
            "MISS" => log.touches.push(touch(&mut words, false)?),
            "" | "M17" | "M30" => {}
            framing if framing.starts_with("%_N_") || framing.starts_with("CHANDATA(") => {}
            _ => {
                while words.clone().next_word().is_some() {
                    log.values.push(assignment(&mut words)?);
                }
            }
        }
    }
    Ok(log)
}

fn touch(words: &mut Words, touched: bool) -> Result<LoggedTouch, ParseError> {
    words.next_word();
    let (number, point_index) = (words.count()?, words.count()?);
    let mut frame = None;
    let mut position: Vec<(Letter, f64)> = Vec::new();
    loop {
        let mut at = words.clone();
        let (name, value) = assignment(words)?;
        let axis = |variable: &str| name.strip_prefix(variable)?.strip_suffix(']')?.parse().ok();
        let (found, letter) = if let Some(letter) = axis("$AA_MM[").or_else(|| axis("$AA_IM[")) {
            (Frame::Machine, letter)
        } else if let Some(letter) = axis("$AA_MW[").or_else(|| axis("$AA_IW[")) {
            (Frame::Work, letter)
        } else {
            return Err(at.error("$AA_MM, $AA_MW, $AA_IM or $AA_IW of an axis"));
        };
        if frame.is_some_and(|frame| frame != found) {
            return Err(at.error("one coordinate system in a line"));
        }
        if position.iter().any(|(known, _)| *known == letter) {
            return Err(at.error("each axis once"));
        }
        frame = Some(found);
        position.push((letter, value));
        if words.clone().next_word().is_none() {
            return Ok(LoggedTouch {
                touched,
                number,
                point_index,
                frame: found,
                position,
            });
        }
    }
}

/// `NAME=value` or `NAME[i,j]=value`; `$R[5]` and `R[5]` are `R5`.
fn assignment(words: &mut Words) -> Result<(String, f64), ParseError> {
    words.take("NAME=value", |word| {
        let (name, value) = word.split_once('=')?;
        let value: f64 = value.parse().ok()?;
        let bare = name.split('[').next()?;
        let good = bare
            .starts_with(|first: char| first.is_ascii_alphabetic() || "_$".contains(first))
            && bare
                .chars()
                .skip(1)
                .all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
            && (bare.len() == name.len() || name.ends_with(']'));
        let parameter = ["$R[", "R["]
            .iter()
            .find_map(|start| name.strip_prefix(start));
        let name = match parameter.and_then(|rest| rest.strip_suffix(']')) {
            Some(number) => format!("R{number}"),
            None => name.to_owned(),
        };
        (good && value.is_finite()).then_some((name, value))
    })
}
