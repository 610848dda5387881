//! Reads the lines that a measuring program of [`super::program`] prints.

use controllers::{
    axes::Letter,
    text::{ParseError, Words},
};
use serde::Serialize;

use crate::results::{Frame, Outcome, Results, ResultsFormat, Touch, lines};

/// Lines printed by `DPRNT`.
pub(super) struct Dprnt;

impl ResultsFormat for Dprnt {
    fn name(&self) -> &'static str {
        "dprnt"
    }

    fn description(&self) -> &'static str {
        "lines that a FANUC program of `probecell program` printed by DPRNT"
    }

    fn content(&self) -> &'static str {
        "a printed touch"
    }

    fn recognises(&self, first_line: &str) -> bool {
        match first_line.split_whitespace().next() {
            Some("AXES") => true,
            Some("TOUCH" | "MISS") => !first_line.contains('='),
            _ => false,
        }
    }

    fn read(&self, text: &str) -> Result<Results, ParseError> {
        let Printed { axes, touches } = printed_touches(text)?;
        let touches = touches.into_iter().map(|touch| {
            let position = axes.iter().copied().zip(touch.position);
            let outcome = Outcome::of_trip(touch.touched);
            let (number, point) = (touch.number, touch.point_index);
            Touch::with_axes(outcome, number, point, Frame::Machine, position)
        });
        Ok(Results::of_touches(touches.collect(), true))
    }
}

/// What a measuring program printed.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Printed {
    /// Axes of the positions.
    pub axes: Vec<Letter>,
    /// Touches in the order in which they were made.
    pub touches: Vec<PrintedTouch>,
}

/// One printed touch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PrintedTouch {
    /// The probe tripped.
    pub touched: bool,
    /// Number of the touch, from 1.
    pub number: u32,
    /// Index into the plan's points.
    pub point_index: u32,
    /// mm and degrees, machine position of each axis.
    pub position: Vec<f64>,
}

/// Reads printed lines: `AXES X Y …`, then `TOUCH n p …` and `MISS n p …` with a position for each axis. Blank lines are
/// passed over; each new `AXES` must name the same.
///
/// # Errors
/// Line and column of what is not of the format.
pub fn printed_touches(text: &str) -> Result<Printed, ParseError> {
    let mut printed = Printed::default();
    for (line, content) in lines(text) {
        let mut words = Words::new(line, content);
        if words.clone().next_word() == Some("AXES") {
            words.next_word();
            let mut at = words.clone();
            let axes = letters(&mut words)?;
            if printed.axes.is_empty() {
                printed.axes = axes;
            } else if printed.axes != axes {
                return Err(at.error("the same axes as before"));
            }
            continue;
        }
        if printed.axes.is_empty() {
            return Err(words.error("AXES and their letters"));
        }
        let touched = words.take("TOUCH, MISS or AXES", |word| match word {
            "TOUCH" => Some(true),
            "MISS" => Some(false),
            _ => None,
        })?;
        let (number, point_index) = (words.count()?, words.count()?);
        let position = printed.axes.iter().map(|_| words.number());
        let position = position.collect::<Result<_, _>>()?;
        words.end()?;
        printed.touches.push(PrintedTouch {
            touched,
            number,
            point_index,
            position,
        });
    }
    Ok(printed)
}

fn letters(words: &mut Words) -> Result<Vec<Letter>, ParseError> {
    let mut letters = Vec::new();
    loop {
        letters.push(words.take("the letter of an axis, once", |word| {
            word.parse().ok().filter(|letter| !letters.contains(letter))
        })?);
        if words.clone().next_word().is_none() {
            return Ok(letters);
        }
    }
}
