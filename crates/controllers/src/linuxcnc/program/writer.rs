//! Writes a measuring program block by block.

use probecell_msgs::{InspectionPlan, ProbingMove};

use super::{PlannedTouch, ProgramError, Settings, Touching, line, number};
use crate::{
    axes::{Axis, Letter},
    measuring::{check_move, refuse},
};

/// Shortest probing move that LinuxCNC takes (0.01 inch), m.
const SHORTEST_TOUCH: f64 = 0.254e-3;
/// Part of a start position that may be left over from the move to it, mm.
const POSITION_SLACK: f64 = 1e-3;
/// Joint targets of one touch may differ in a rotary axis by no more than this, rad.
const SAME_ANGLE: f64 = 1e-9;

pub(super) struct Writer<'a> {
    pub(super) text: String,
    settings: &'a Settings<'a>,
    columns: &'a [Option<usize>],
    plan: &'a InspectionPlan,
    pub(super) touches: Vec<PlannedTouch>,
}

impl<'a> Writer<'a> {
    /// A program without a line yet; `columns` is the index of each axis in the order's moves.
    pub(super) fn new(
        plan: &'a InspectionPlan,
        settings: &'a Settings<'a>,
        columns: &'a [Option<usize>],
    ) -> Self {
        Self {
            text: String::new(),
            settings,
            columns,
            plan,
            touches: Vec::new(),
        }
    }

    fn line(&mut self, block: std::fmt::Arguments) {
        line(&mut self.text, block);
    }

    /// Axes that the order moves, with their index in its moves.
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

    pub(super) fn head(&mut self, touches: usize) {
        let settings = self.settings;
        for block in ["%", "M70", "G8 G17 G21 G40 G49 G61.1 G80 G90 G94"] {
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

    pub(super) fn tail(&mut self, touches: usize) {
        self.line(format_args!("o<g92> if [#<g92> NE 0]"));
        self.line(format_args!("G92.3"));
        self.line(format_args!("o<g92> endif"));
        self.line(format_args!("M72"));
        self.line(format_args!("(LOG,end {touches})"));
        self.line(format_args!("(LOGCLOSE)"));
        self.line(format_args!("%"));
    }

    /// Writes the moves after the last touch.
    pub(super) fn park(&mut self, first: usize, moves: &[ProbingMove]) -> Result<(), ProgramError> {
        self.line(format_args!("o<park> if [#<go> EQ 1]"));
        for (index, one) in moves.iter().enumerate().skip(first) {
            self.ordinary(index, one)?;
        }
        self.line(format_args!("o<park> endif"));
        Ok(())
    }

    /// Writes the moves of one touch, from the first after the touch before it to the last retract after it.
    pub(super) fn point(
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
        check_move(index, one, self.settings.axes, self.columns)
    }
}
