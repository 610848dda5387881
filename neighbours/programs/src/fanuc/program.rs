//! Writes a FANUC measuring program from a plan and its order: protected moves, skip moves, and a printed line for each touch.
//!
//! Targets are positions of the joints in the machine's coordinates, as the order gives them; an axis letter is that of
//! the joint. G54 and whatever else shifts the work coordinates are read once at the start (#5021 less #5041) and taken
//! off each target, for a skip move knows no G53. A move that is not meant to touch runs as a skip move in O0410 and ends
//! in an alarm when the probe trips on it. First `AXES X Y Z` is printed, then for each touch `TOUCH n p` or, without a
//! trip, `MISS n p`, with number of the touch, index of the point, and machine position in mm and degrees. A lathe's X must
//! be programmed in radii, as everything here is.

use std::fmt::Write as _;

use controllers::{
    axes::{Axis, Letter},
    measuring::ProgramError,
};
use probecell_msgs::{InspectionPlan, MeasurementOrder};

use crate::measuring::{Leg, Purpose, legs, number};

/// Alarm of a touch where none was planned.
pub const UNPLANNED_TOUCH: u32 = 186;

/// Arguments of O0410 by axis letter, and the local variables that they set.
const ARGUMENTS: [(Letter, u32); 6] = [
    (Letter::X, 24),
    (Letter::Y, 25),
    (Letter::Z, 26),
    (Letter::A, 1),
    (Letter::B, 2),
    (Letter::C, 3),
];

/// Writes the measuring program O0390 and its protected move O0410. `axes` are in the order of the controller's axis
/// numbers; moves between touches are made at `travel_feed` (m/s) at most.
///
/// # Errors
/// [`ProgramError`] names the move that the controller cannot make.
pub fn measuring_program(
    plan: &InspectionPlan,
    order: &MeasurementOrder,
    axes: &[Axis],
    travel_feed: f64,
) -> Result<String, ProgramError> {
    let legs = legs(plan, order, axes, travel_feed)?;
    let mut writer = Writer {
        text: String::new(),
        axes,
    };
    writer.head();
    for leg in &legs {
        let feed = number(leg.feed);
        match leg.purpose {
            Purpose::Travel => {
                let words = writer.target(leg);
                writer.line(format_args!("G65P410{words}F{feed}"));
            }
            Purpose::Retract => {
                let words = writer.target(leg);
                writer.line(format_args!("G1{words}F{feed}"));
            }
            Purpose::Touch => writer.touch(leg),
        }
    }
    writer.tail();
    Ok(writer.text)
}

struct Writer<'a> {
    text: String,
    axes: &'a [Axis],
}

impl Writer<'_> {
    fn line(&mut self, block: std::fmt::Arguments) {
        // Writing to a string does not fail.
        let written = writeln!(self.text, "{block}");
        debug_assert!(written.is_ok());
    }

    /// Number of an axis, from 1.
    fn number_of(&self, letter: Letter) -> usize {
        let index = self.axes.iter().position(|axis| axis.letter == letter);
        index.unwrap_or(0) + 1
    }

    fn head(&mut self) {
        self.line(format_args!("%\nO0390(MEASURE)\nG90G21G40G49G69G80G94G54"));
        for number in 1..=self.axes.len() {
            self.line(format_args!("#11{number}=#502{number}-#504{number}"));
        }
        let letters: Vec<_> = self
            .axes
            .iter()
            .map(|axis| axis.letter.to_string())
            .collect();
        self.line(format_args!("POPEN\nDPRNT[AXES*{}]", letters.join("*")));
    }

    /// The words of a target, in work coordinates.
    fn target(&self, leg: &Leg) -> String {
        let word = |&(letter, position): &(Letter, f64)| {
            format!(
                "{letter}[{}-#11{}]",
                number(position),
                self.number_of(letter)
            )
        };
        leg.target.iter().map(word).collect()
    }

    fn touch(&mut self, leg: &Leg) {
        let (touch, point) = (leg.touch, leg.point);
        let words = self.target(leg);
        self.line(format_args!("G31{words}F{}", number(leg.feed)));
        for axis in 1..=self.axes.len() {
            self.line(format_args!("#12{axis}=#506{axis}+#11{axis}"));
        }
        // It ended at its target: no trip.
        let remaining = |&(letter, position): &(Letter, f64)| {
            format!("ABS[#12{}-[{}]]", self.number_of(letter), number(position))
        };
        let remaining = leg
            .target
            .iter()
            .map(remaining)
            .collect::<Vec<_>>()
            .join("+");
        let values: Vec<_> = (1..=self.axes.len())
            .map(|axis| format!("*#12{axis}[54]"))
            .collect();
        let values = values.concat();
        let (missed, on) = (2 * touch, 2 * touch + 1);
        self.line(format_args!("IF[{remaining}LT0.0001]GOTO{missed}"));
        self.line(format_args!("DPRNT[TOUCH*{touch}*{point}{values}]"));
        self.line(format_args!("GOTO{on}"));
        self.line(format_args!("N{missed}DPRNT[MISS*{touch}*{point}{values}]"));
        self.line(format_args!("N{on}"));
    }

    fn tail(&mut self) {
        self.line(format_args!("PCLOS\nM30\nO0410(PROTECTED MOVE)"));
        // Targets that are not given stay vacant: such an axis does not move and is not compared.
        let arguments: Vec<(usize, Letter, u32)> = self
            .axes
            .iter()
            .zip(1..)
            .filter_map(|(axis, number)| {
                let found = ARGUMENTS
                    .iter()
                    .find(|(letter, _)| *letter == axis.letter)?;
                Some((number, found.0, found.1))
            })
            .collect();
        let words: Vec<_> = arguments
            .iter()
            .map(|(_, letter, argument)| format!("{letter}#{argument}"))
            .collect();
        let words = words.concat();
        self.line(format_args!("G31{words}F#9"));
        for (number, _, argument) in arguments {
            self.line(format_args!("IF[#{argument}EQ#0]GOTO{number}"));
            self.line(format_args!(
                "IF[ABS[#506{number}-#{argument}]GT0.0005]GOTO90"
            ));
            self.line(format_args!("N{number}"));
        }
        self.line(format_args!(
            "M99\nN90#3000={UNPLANNED_TOUCH}(UNPLANNED TOUCH)\n%"
        ));
    }
}
