//! Writes LinuxCNC programs: a measuring program from a plan's order, and programs that change an offset.
//!
//! Results come back by a log file (`(LOG,…)`), one line for each probing move: the controller flushes each line, nothing
//! is lost however seldom it is read, and the line names touch and point. The other ways lose something: operator
//! messages overwrite one another in the remote shell, and `(PROBEOPEN …)` writes no line for a miss and no point.
//!
//! All targets are joint positions in the machine's coordinates. `G53` gives them to ordinary moves; a probing move knows
//! no `G53`, so the offset that is active is taken off its target and added to its result. `G38.3` is used since a
//! miss of `G38.2` stops the program. `G38.3` does not refuse to start with a probe that is already tripped: it latches
//! where it stands. So a trip within two servo periods of the start is logged as `stuck`, never as a touch, and ends the
//! program.
//!
//! Moves stop exactly at their targets (`G61.1`), as the plan promises their times. Under `G61` LinuxCNC plans moves that meet at a
//! bend for a tenth less acceleration (`ARC_BLEND_KINK_RATIO`) and still all but stops there.
//!
//! The modal state is saved before the first word and restored after the last (`M70`, `M72`); the file ends by `%` and not
//! by `M2`, which would change the modal state again. After an abort the driver sends `M72`.

mod writer;

use std::fmt::Write as _;

use probecell_msgs::{InspectionPlan, MeasurementOrder};

use self::writer::Writer;
pub use crate::measuring::ProgramError;
use crate::{
    axes::{Axis, Letter},
    measuring::check_order,
};

/// Longest path or word in a comment; LinuxCNC reads lines of 255 characters.
const COMMENT_LIMIT: usize = 200;

/// How a point is touched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Touching {
    /// Once, at the plan's feed.
    Once,
    /// First to find the surface, then again at the plan's feed from a short way back; only that counts.
    Twice {
        /// m/s, of the first move.
        search_feed: f64,
        /// m, way back from the first trip.
        back_off: f64,
    },
}

/// What a program depends on in addition to plan and order.
#[derive(Clone, Debug)]
pub struct Settings<'a> {
    /// The machine's axes.
    pub axes: &'a [Axis],
    /// How to touch.
    pub touching: Touching,
    /// Blocks run before the first move, for example to select identity kinematics.
    pub preamble: &'a [String],
    /// Rapid moves made first, one after the other: index into `axes`, and position in m or rad.
    pub first_moves: &'a [(usize, f64)],
    /// s, period of the controller's position loop.
    pub servo_period: f64,
    /// Log file as the controller knows it.
    pub log_path: &'a str,
    /// A word that says whose log it is.
    pub token: &'a str,
}

/// One touch as the program will make it.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedTouch {
    /// Index into the plan's points.
    pub point_index: u32,
    /// m/s, of the move that counts.
    pub feed: f64,
    /// m or rad, of the settings' axes: where the probing move begins.
    pub start: Vec<f64>,
    /// m or rad, of the settings' axes: where it ends without a trip.
    pub end: Vec<f64>,
}

/// A program and what its log will speak of.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuringProgram {
    /// Text of the program.
    pub text: String,
    /// The touches in order.
    pub touches: Vec<PlannedTouch>,
}

/// Writes the measuring program of a plan in the order given.
///
/// # Errors
/// [`ProgramError`] names the move that the controller cannot make.
pub fn measuring_program(
    plan: &InspectionPlan,
    order: &MeasurementOrder,
    settings: &Settings,
) -> Result<MeasuringProgram, ProgramError> {
    check_settings(settings)?;
    let columns = check_order(plan, order, settings.axes)?;
    let mut writer = Writer::new(plan, settings, &columns);
    writer.head(order.order.len());
    let mut index = 0;
    for number in 1..=order.order.len() {
        index = writer.point(number, index, &order.moves)?;
    }
    writer.park(index, &order.moves)?;
    writer.tail(order.order.len());
    Ok(MeasuringProgram {
        text: writer.text,
        touches: writer.touches,
    })
}

/// Writes the program that sets one axis of a work offset (system 1 is G54) and logs it before and after; m or rad.
///
/// # Errors
/// A value that is not finite, or a text that cannot stand in a comment.
pub fn work_offset_program(
    system: u8,
    letter: Letter,
    value: f64,
    log_path: &str,
    token: &str,
) -> Result<String, ProgramError> {
    let parameter = 5201 + 20 * usize::from(system) + letter.index();
    let setting = format!(
        "G10 L2 P{system} {letter}{}",
        number(letter.to_controller(value))
    );
    let mut text = offset_head(log_path, token, value)?;
    line(&mut text, format_args!("(LOG,offset %.6f #{parameter})"));
    line(&mut text, format_args!("{setting}"));
    line(&mut text, format_args!("(LOG,offset %.6f #{parameter})"));
    offset_tail(&mut text);
    Ok(text)
}

/// Writes the program that sets the diameter of a tool, m. The result stands in the table file: a program can read
/// the entry of the tool in the spindle only.
///
/// # Errors
/// A value that is not finite, or a text that cannot stand in a comment.
pub fn tool_diameter_program(
    tool: u32,
    diameter: f64,
    log_path: &str,
    token: &str,
) -> Result<String, ProgramError> {
    let mut text = offset_head(log_path, token, diameter)?;
    line(
        &mut text,
        format_args!("G10 L1 P{tool} R{}", number(diameter * 0.5e3)),
    );
    offset_tail(&mut text);
    Ok(text)
}

fn offset_head(log_path: &str, token: &str, value: f64) -> Result<String, ProgramError> {
    check_comment(log_path)?;
    check_comment(token)?;
    if !value.is_finite() {
        return Err(ProgramError::Setting {
            name: "offset",
            value,
        });
    }
    let mut text = String::new();
    for block in ["%", "M70", "G8 G21 G90"] {
        line(&mut text, format_args!("{block}"));
    }
    line(&mut text, format_args!("(LOGOPEN,{log_path})"));
    line(&mut text, format_args!("(LOG,begin {token} 0 0)"));
    Ok(text)
}

fn offset_tail(text: &mut String) {
    for block in ["M72", "(LOG,end 0)", "(LOGCLOSE)", "%"] {
        line(text, format_args!("{block}"));
    }
}

fn check_settings(settings: &Settings) -> Result<(), ProgramError> {
    check_comment(settings.log_path)?;
    check_comment(settings.token)?;
    let mut positive = vec![("servo_period", settings.servo_period)];
    if let Touching::Twice {
        search_feed,
        back_off,
    } = settings.touching
    {
        positive.extend([("search_feed", search_feed), ("back_off", back_off)]);
    }
    match positive
        .into_iter()
        .find(|(_, value)| !(value.is_finite() && *value > 0.0))
    {
        Some((name, value)) => Err(ProgramError::Setting { name, value }),
        None => Ok(()),
    }
}

/// A comment ends at its bracket and a line at 255 characters, `#` and `%` are read as a parameter and a format.
fn check_comment(text: &str) -> Result<(), ProgramError> {
    let bad = |letter: char| {
        matches!(letter, '(' | ')' | '#' | '%' | ';') || letter.is_control() || !letter.is_ascii()
    };
    if text.is_empty() || text.len() > COMMENT_LIMIT || text.contains(bad) {
        Err(ProgramError::Comment(text.to_owned()))
    } else {
        Ok(())
    }
}

fn line(text: &mut String, block: std::fmt::Arguments) {
    // Writing to a string does not fail.
    let written = writeln!(text, "{block}");
    debug_assert!(written.is_ok());
}

/// A number as a program takes it: nanometres are kept, no exponent, no negative zero.
fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

impl PlannedTouch {
    /// m, length of the probing move.
    fn length(&self, axes: &[Axis]) -> f64 {
        let steps = axes.iter().zip(self.start.iter().zip(&self.end));
        let linear = steps.filter(|(axis, _)| !axis.letter.is_rotary());
        linear
            .map(|(_, (start, end))| (end - start).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}
