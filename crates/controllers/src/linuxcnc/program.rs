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
//! The modal state is saved before the first word and restored after the last (`M70`, `M72`); the file ends by `%` and not
//! by `M2`, which would change the modal state again. After an abort the driver sends `M72`.

use std::fmt::Write as _;

use probecell_msgs::{InspectionPlan, MeasurementOrder, ProbingMove};

use super::axes::{Axis, Letter};

/// Shortest probing move that LinuxCNC takes (0.01 inch), m.
const SHORTEST_TOUCH: f64 = 0.254e-3;
/// Part of a start position that may be left over from the move to it, mm.
const POSITION_SLACK: f64 = 1e-3;
/// Joint targets of one touch may differ in a rotary axis by no more than this, rad.
const SAME_ANGLE: f64 = 1e-9;

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

/// What a program depends on beside plan and order.
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

/// Why there is no program.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProgramError {
    /// Plan and order do not belong together.
    #[error("the order is of plan {order:?}, not of plan {plan:?}")]
    OtherPlan {
        /// Plan to measure.
        plan: String,
        /// Plan of the order.
        order: String,
    },
    /// The order speaks of an axis that the controller does not have.
    #[error("the order moves axis {0:?}, which the controller does not have")]
    UnknownAxis(String),
    /// A move cannot be made.
    #[error("move {index} to point {point}: {reason}")]
    Move {
        /// Index of the move.
        index: usize,
        /// Index of its point.
        point: u32,
        /// What is wrong.
        reason: String,
    },
    /// The moves do not touch the points in the order that the order itself gives.
    #[error("the moves touch points {moves:?}, the order says {order:?}")]
    OrderOfMoves {
        /// Points of the moves.
        moves: Vec<u32>,
        /// Points of the order.
        order: Vec<u32>,
    },
    /// A path or a word would end a comment of the program.
    #[error("{0:?} cannot stand in a comment of a program")]
    Comment(String),
    /// A setting is not usable.
    #[error("{name} = {value} is not a positive finite number")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Writes the measuring program of a plan in the order given.
pub fn measuring_program(
    plan: &InspectionPlan,
    order: &MeasurementOrder,
    settings: &Settings,
) -> Result<MeasuringProgram, ProgramError> {
    if order.plan_id != plan.plan_id {
        return Err(ProgramError::OtherPlan {
            plan: plan.plan_id.clone(),
            order: order.plan_id.clone(),
        });
    }
    check_settings(settings)?;
    let columns = columns(order, settings.axes)?;
    let touches: Vec<&ProbingMove> = order
        .moves
        .iter()
        .filter(|one| one.kind == ProbingMove::TOUCH)
        .collect();
    let touched: Vec<u32> = touches.iter().map(|touch| touch.point_index).collect();
    if touched != order.order {
        return Err(ProgramError::OrderOfMoves {
            moves: touched,
            order: order.order.clone(),
        });
    }
    let mut writer = Writer {
        text: String::new(),
        settings,
        columns: &columns,
        plan,
        touches: Vec::new(),
    };
    writer.head(touches.len());
    let mut index = 0;
    for number in 1..=touches.len() {
        index = writer.point(number, index, &order.moves)?;
    }
    writer.park(index, &order.moves)?;
    writer.tail(touches.len());
    Ok(MeasuringProgram {
        text: writer.text,
        touches: writer.touches,
    })
}

/// Writes the program that sets one axis of a work offset (system 1 is G54) and logs it before and after; m or rad.
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

/// Writes the program that sets the diameter of a tool, m. The table file tells what became of it: a program can read
/// the entry of the tool in the spindle only.
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

/// For each axis of the settings, its place in the order's moves.
fn columns(order: &MeasurementOrder, axes: &[Axis]) -> Result<Vec<Option<usize>>, ProgramError> {
    if let Some(unknown) = order
        .axis_names
        .iter()
        .find(|name| axes.iter().all(|axis| axis.name != **name))
    {
        return Err(ProgramError::UnknownAxis(unknown.clone()));
    }
    Ok(axes
        .iter()
        .map(|axis| order.axis_names.iter().position(|name| *name == axis.name))
        .collect())
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

struct Writer<'a> {
    text: String,
    settings: &'a Settings<'a>,
    columns: &'a [Option<usize>],
    plan: &'a InspectionPlan,
    touches: Vec<PlannedTouch>,
}

impl Writer<'_> {
    fn line(&mut self, block: std::fmt::Arguments) {
        line(&mut self.text, block);
    }

    /// Axes that the order moves, with their place in its moves.
    fn moved(&self) -> impl Iterator<Item = (&Axis, usize)> {
        self.settings
            .axes
            .iter()
            .zip(self.columns)
            .filter_map(|(axis, column)| column.map(|column| (axis, column)))
    }

    fn linear(&self) -> impl Iterator<Item = (Letter, usize)> {
        self.moved()
            .filter(|(axis, _)| !axis.letter.is_rotary())
            .map(|(axis, column)| (axis.letter, column))
    }

    fn head(&mut self, touches: usize) {
        let settings = self.settings;
        for block in ["%", "M70", "G8 G17 G21 G40 G49 G61 G80 G90 G94"] {
            self.line(format_args!("{block}"));
        }
        for block in settings.preamble {
            self.line(format_args!("{block}"));
        }
        // Offsets of G92 are put aside and not deleted.
        self.line(format_args!("#<g92>=#5210"));
        self.line(format_args!("G92.2"));
        self.line(format_args!("#<base>=[5201+20*#5220]"));
        for axis in settings.axes {
            let letter = axis.letter;
            self.line(format_args!(
                "#<offset_{letter}>=#[#<base>+{}]",
                letter.index()
            ));
        }
        self.line(format_args!("(LOGOPEN,{})", settings.log_path));
        self.line(format_args!(
            "(LOG,begin {} {touches} %d #<g92>)",
            settings.token
        ));
        self.line(format_args!("#<go>=1"));
        self.line(format_args!("#<rotation>=#[#<base>+9]"));
        self.line(format_args!("o<rotated> if [ABS[#<rotation>] GT 0]"));
        self.line(format_args!("(LOG,rotated %.6f #<rotation>)"));
        self.line(format_args!("#<go>=0"));
        self.line(format_args!("o<rotated> else"));
        for &(index, position) in settings.first_moves {
            if let Some(axis) = settings.axes.get(index) {
                let target = number(axis.letter.to_controller(position));
                self.line(format_args!("G53 G0 {}{target}", axis.letter));
            }
        }
        self.line(format_args!("o<rotated> endif"));
    }

    fn tail(&mut self, touches: usize) {
        self.line(format_args!("o<g92> if [#<g92> NE 0]"));
        self.line(format_args!("G92.3"));
        self.line(format_args!("o<g92> endif"));
        self.line(format_args!("M72"));
        self.line(format_args!("(LOG,end {touches})"));
        self.line(format_args!("(LOGCLOSE)"));
        self.line(format_args!("%"));
    }

    /// Writes the moves after the last touch.
    fn park(&mut self, first: usize, moves: &[ProbingMove]) -> Result<(), ProgramError> {
        self.line(format_args!("o<park> if [#<go> EQ 1]"));
        for (index, one) in moves.iter().enumerate().skip(first) {
            self.ordinary(index, one)?;
        }
        self.line(format_args!("o<park> endif"));
        Ok(())
    }

    /// Writes the moves of one touch, from the first after the touch before it to the last retract after it.
    fn point(
        &mut self,
        touch_number: usize,
        first: usize,
        moves: &[ProbingMove],
    ) -> Result<usize, ProgramError> {
        let touch_at = first
            + moves[first..]
                .iter()
                .take_while(|one| one.kind != ProbingMove::TOUCH)
                .count();
        let after = moves
            .iter()
            .skip(touch_at + 1)
            .take_while(|one| one.kind == ProbingMove::RETRACT)
            .count();
        let touch = &moves[touch_at];
        let point = touch.point_index;
        self.line(format_args!("o<point{touch_number}> if [#<go> EQ 1]"));
        self.line(format_args!("(LOG,next {touch_number} {point})"));
        for (index, one) in moves.iter().enumerate().take(touch_at).skip(first) {
            self.ordinary(index, one)?;
        }
        let Some(start) = touch_at.checked_sub(1).and_then(|index| moves.get(index)) else {
            return Err(refuse(touch_at, touch, "there is no move to its start"));
        };
        self.touch(touch_number, touch_at, start, touch)?;
        self.line(format_args!("o<retract{touch_number}> if [#<go> EQ 1]"));
        for (index, one) in moves.iter().enumerate().skip(touch_at + 1).take(after) {
            self.ordinary(index, one)?;
        }
        self.line(format_args!("o<retract{touch_number}> endif"));
        self.line(format_args!("o<point{touch_number}> endif"));
        Ok(touch_at + 1 + after)
    }

    fn ordinary(&mut self, index: usize, one: &ProbingMove) -> Result<(), ProgramError> {
        self.check(index, one)?;
        let word = |(axis, column): (&Axis, usize)| {
            format!(
                "{}{}",
                axis.letter,
                number(axis.letter.to_controller(one.axis_positions[column]))
            )
        };
        let words = self.moved().map(word).collect::<Vec<_>>().join(" ");
        if one.feed > 0.0 {
            self.line(format_args!("G53 G1 {words} F{}", number(one.feed * 60e3)));
        } else {
            self.line(format_args!("G53 G0 {words}"));
        }
        Ok(())
    }

    fn touch(
        &mut self,
        touch_number: usize,
        index: usize,
        start: &ProbingMove,
        touch: &ProbingMove,
    ) -> Result<(), ProgramError> {
        self.check(index, touch)?;
        let planned = self.planned(index, start, touch)?;
        let point = planned.point_index;
        let position = |one: &ProbingMove, letter: Letter, column: usize| {
            number(letter.to_controller(one.axis_positions[column]))
        };
        let word = |(letter, column)| {
            format!(
                "{letter}[{}-#<offset_{letter}>]",
                position(touch, letter, column)
            )
        };
        let target = self.linear().map(word).collect::<Vec<_>>().join(" ");
        let from: Vec<_> = self
            .linear()
            .map(|(letter, column)| (letter, position(start, letter, column)))
            .collect();
        let result = format!("result{touch_number}");
        let first_feed = match self.settings.touching {
            Touching::Once => planned.feed,
            Touching::Twice { search_feed, .. } => search_feed,
        };
        self.probe(&target, first_feed, &from);
        self.fate(&result, touch_number, point, first_feed);
        self.line(format_args!("o<{result}> else"));
        match self.settings.touching {
            Touching::Once => self.report("touch", touch_number, point),
            Touching::Twice { back_off, .. } => {
                self.back_off(&planned, back_off, &from);
                let from: Vec<_> = from
                    .iter()
                    .map(|(letter, _)| (*letter, format!("#<back_{letter}>")))
                    .collect();
                self.probe(&target, planned.feed, &from);
                let again = format!("again{touch_number}");
                self.fate(&again, touch_number, point, planned.feed);
                self.line(format_args!("o<{again}> else"));
                self.report("touch", touch_number, point);
                self.line(format_args!("o<{again}> endif"));
            }
        }
        self.line(format_args!("o<{result}> endif"));
        self.touches.push(planned);
        Ok(())
    }

    /// The probing move, its result in the machine's coordinates, and the way it went.
    fn probe(&mut self, target: &str, feed: f64, from: &[(Letter, String)]) {
        self.line(format_args!("G38.3 {target} F{}", number(feed * 60e3)));
        let settings = self.settings;
        for axis in settings.axes {
            let letter = axis.letter;
            self.line(format_args!(
                "#<trip_{letter}>=[#{}+#<offset_{letter}>]",
                5061 + letter.index()
            ));
        }
        let squares: Vec<String> = from
            .iter()
            .map(|(letter, position)| format!("[[#<trip_{letter}>-[{position}]]**2]"))
            .collect();
        self.line(format_args!("#<travel>=SQRT[{}]", squares.join("+")));
    }

    /// A move without a trip, and a trip where the move began. The condition is left open for what is a touch.
    fn fate(&mut self, label: &str, touch_number: usize, point: u32, feed: f64) {
        let shortest = feed * 1e3 * 2.0 * self.settings.servo_period + POSITION_SLACK;
        self.line(format_args!("o<{label}> if [#5070 EQ 0]"));
        self.report("miss", touch_number, point);
        self.line(format_args!(
            "o<{label}> elseif [#<travel> LE {}]",
            number(shortest)
        ));
        self.report("stuck", touch_number, point);
        self.line(format_args!("#<go>=0"));
    }

    fn report(&mut self, what: &str, touch_number: usize, point: u32) {
        let parameter = |axis: &Axis| format!("#<trip_{}>", axis.letter);
        let positions = self
            .settings
            .axes
            .iter()
            .map(parameter)
            .collect::<Vec<_>>()
            .join(" ");
        self.line(format_args!(
            "(LOG,{what} {touch_number} {point} %.6f {positions})"
        ));
    }

    /// Goes back along the approach, but not behind where it began.
    fn back_off(&mut self, planned: &PlannedTouch, back_off: f64, from: &[(Letter, String)]) {
        let length = planned.length(self.settings.axes);
        let back = number(back_off * 1e3);
        self.line(format_args!("#<back>={back}"));
        self.line(format_args!(
            "o<short{0}> if [#<travel> LT {back}]",
            self.touches.len()
        ));
        self.line(format_args!("#<back>=#<travel>"));
        self.line(format_args!("o<short{0}> endif", self.touches.len()));
        let mut words = Vec::new();
        for (letter, _) in from {
            let Some(index) = self
                .settings
                .axes
                .iter()
                .position(|axis| axis.letter == *letter)
            else {
                continue;
            };
            let cosine = (planned.end[index] - planned.start[index]) / length;
            self.line(format_args!(
                "#<back_{letter}>=[#<trip_{letter}>-#<back>*[{cosine:.9}]]"
            ));
            words.push(format!("{letter}#<back_{letter}>"));
        }
        self.line(format_args!("G53 G0 {}", words.join(" ")));
    }

    fn planned(
        &self,
        index: usize,
        start: &ProbingMove,
        touch: &ProbingMove,
    ) -> Result<PlannedTouch, ProgramError> {
        let point = self.plan.points.get(touch.point_index as usize);
        let Some(point) = point else {
            return Err(refuse(index, touch, "the plan has no such point"));
        };
        let feed = if touch.feed > 0.0 {
            touch.feed
        } else {
            point.feed
        };
        if !(feed.is_finite() && feed > 0.0) {
            return Err(refuse(index, touch, &format!("its feed is {feed} m/s")));
        }
        let positions = |one: &ProbingMove| -> Vec<f64> {
            self.columns
                .iter()
                .map(|column| column.map_or(0.0, |column| one.axis_positions[column]))
                .collect()
        };
        let planned = PlannedTouch {
            point_index: touch.point_index,
            feed,
            start: positions(start),
            end: positions(touch),
        };
        let turns = self
            .settings
            .axes
            .iter()
            .zip(planned.start.iter().zip(&planned.end));
        if turns
            .clone()
            .any(|(axis, (start, end))| axis.letter.is_rotary() && (start - end).abs() > SAME_ANGLE)
        {
            return Err(refuse(
                index,
                touch,
                "it turns a rotary axis, which LinuxCNC cannot do while probing",
            ));
        }
        let length = planned.length(self.settings.axes);
        if length.is_nan() || length < SHORTEST_TOUCH {
            let reason = format!(
                "it is {:.3} mm long, LinuxCNC needs {:.3} mm",
                length * 1e3,
                SHORTEST_TOUCH * 1e3
            );
            return Err(refuse(index, touch, &reason));
        }
        Ok(planned)
    }

    fn check(&self, index: usize, one: &ProbingMove) -> Result<(), ProgramError> {
        let width = self.columns.iter().flatten().count();
        if one.axis_positions.len() != width {
            return Err(refuse(
                index,
                one,
                &format!("{} positions for {width} axes", one.axis_positions.len()),
            ));
        }
        if !(one.feed.is_finite() && one.feed >= 0.0) {
            return Err(refuse(index, one, &format!("its feed is {} m/s", one.feed)));
        }
        for (axis, column) in self.moved() {
            let position = one.axis_positions[column];
            let [lower, upper] = axis.limits.unwrap_or([f64::MIN, f64::MAX]);
            if !(position >= lower && position <= upper) {
                let shown = axis.letter.to_controller(position);
                let unit = if axis.letter.is_rotary() {
                    "degrees"
                } else {
                    "mm"
                };
                let reason = format!("axis {} at {shown} {unit} is outside its limits", axis.name);
                return Err(refuse(index, one, &reason));
            }
        }
        Ok(())
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

fn refuse(index: usize, one: &ProbingMove, reason: &str) -> ProgramError {
    ProgramError::Move {
        index,
        point: one.point_index,
        reason: reason.to_owned(),
    }
}
