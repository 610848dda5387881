//! Runs FANUC programs as far as measuring and deciding need: what they move, touch, print and write.
//!
//! Understood: `#i=`, `IF[]GOTO`, `IF[]THEN`, `GOTO`, `WHILE[]DOm … ENDm`, `G65 P L` with arguments, `M98`, `M99`, `M30`,
//! `G0`/`G1` in `G90` and `G91`, the skip move `G31`, `G10 L2`, `#3000=n(TEXT)`, `#3006=1(TEXT)`, `POPEN`, `DPRNT[]`,
//! `PCLOS`. Positions are programmed positions in mm; there are no tool or work offsets in them. Anything else that moves
//! an axis is an error and never passed over.

use std::collections::BTreeMap;

use super::{
    block::{Block, Statement, split_comment, statement},
    expression::{Condition, Expression, Reader, ValueError, variable_number},
};
use crate::text::ParseError;

/// Deepest nesting of calls.
const CALL_DEPTH: usize = 16;
/// Blocks after which a program counts as endless.
const BLOCK_LIMIT: usize = 1_000_000;
/// Arguments of `G65` and the local variables that they set.
const ARGUMENTS: [(char, u32); 21] = [
    ('A', 1),
    ('B', 2),
    ('C', 3),
    ('I', 4),
    ('J', 5),
    ('K', 6),
    ('D', 7),
    ('E', 8),
    ('F', 9),
    ('H', 11),
    ('M', 13),
    ('Q', 17),
    ('R', 18),
    ('S', 19),
    ('T', 20),
    ('U', 21),
    ('V', 22),
    ('W', 23),
    ('X', 24),
    ('Y', 25),
    ('Z', 26),
];

/// Variables by number; a variable that is missing is vacant.
pub type Variables = BTreeMap<u32, f64>;
/// Position by axis letter, mm or degrees.
pub type Position = BTreeMap<char, f64>;

/// What answers a skip move: the machine and its part.
pub trait Probe {
    /// Where the probe trips on the straight way, if it does. `variables` are the common and system variables.
    fn skip(&mut self, from: &Position, to: &Position, variables: &Variables) -> Option<Position>;
}

/// What a program did.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A move at rapid or feed, to here.
    Move(Position),
    /// A skip move: its target, and where it ended.
    Skip {
        /// Programmed target.
        target: Position,
        /// Where the axes stopped.
        reached: Position,
        /// The probe tripped.
        tripped: bool,
    },
    /// A line printed by `DPRNT`.
    Print(String),
    /// A stop with a message (`#3006`).
    Message(String),
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// At `M30`, `M02`, or the end of the program.
    Finished,
    /// By an alarm (`#3000`).
    Alarm {
        /// Number of the alarm.
        number: u32,
        /// Its text.
        text: String,
    },
}

/// Why a program cannot be read or run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MacroError {
    /// A line makes no sense.
    #[error(transparent)]
    Line(#[from] ParseError),
    /// A program was called that is not there.
    #[error("line {line}: there is no program O{number:04}")]
    NoProgram {
        /// Line of the call.
        line: u64,
        /// Number of the program.
        number: u32,
    },
    /// A block cannot be obeyed.
    #[error("line {line}: {reason}")]
    Block {
        /// Its line.
        line: u64,
        /// What is wrong.
        reason: String,
    },
    /// The program does not come to an end.
    #[error("line {line}: no end after {BLOCK_LIMIT} blocks")]
    Endless {
        /// Line that was reached.
        line: u64,
    },
}

/// A controller with its programs and variables.
#[derive(Clone, Debug)]
pub struct Interpreter {
    programs: BTreeMap<u32, Vec<Block>>,
    axes: Vec<char>,
    /// Common and system variables.
    pub variables: Variables,
    /// Where the axes are.
    pub position: Position,
    absolute: bool,
    motion: u32,
    blocks: usize,
    events: Vec<Event>,
}

/// What a block leads to.
enum Next {
    Block,
    Jump(usize),
    Return,
    End(End),
}

impl Interpreter {
    /// A controller with these axes, in the order of their numbers; all at zero.
    pub fn new(axes: &[char]) -> Self {
        Self {
            programs: BTreeMap::new(),
            axes: axes.to_vec(),
            variables: Variables::new(),
            position: axes.iter().map(|&axis| (axis, 0.0)).collect(),
            absolute: true,
            motion: 0,
            blocks: 0,
            events: Vec::new(),
        }
    }

    /// Reads a text of one or more programs, each beginning with its `O` number.
    pub fn load(&mut self, text: &str) -> Result<(), MacroError> {
        let mut current = None;
        for (index, line) in text.lines().enumerate() {
            let line_number = index as u64 + 1;
            let (code, comment) = split_comment(line_number, line)?;
            let mut reader = Reader::new(line_number, &code);
            if reader.take('%') || reader.peek().is_none() {
                continue;
            }
            if reader.peek() == Some('O') {
                reader.take('O');
                let number = reader.whole()?;
                self.programs.insert(number, Vec::new());
                current = Some(number);
            }
            let Some(blocks) = current.and_then(|number| self.programs.get_mut(&number)) else {
                return Err(reader.error("a program number O").into());
            };
            let number = if reader.take('N') {
                Some(reader.whole()?)
            } else {
                None
            };
            let statement = statement(&mut reader, comment)?;
            if reader.peek().is_some() {
                return Err(reader.error("the end of the line").into());
            }
            blocks.push(Block {
                line: line_number,
                number,
                statement,
            });
        }
        Ok(())
    }

    /// Runs a program to its end; gives how it ended and what it did.
    pub fn run(
        &mut self,
        number: u32,
        probe: &mut dyn Probe,
    ) -> Result<(End, Vec<Event>), MacroError> {
        self.blocks = 0;
        self.events.clear();
        let mut locals = Variables::new();
        let end = self
            .call(0, number, &mut locals, 0, probe)?
            .unwrap_or(End::Finished);
        Ok((end, std::mem::take(&mut self.events)))
    }

    /// Runs a program until it returns (`None`) or everything ends.
    fn call(
        &mut self,
        line: u64,
        number: u32,
        locals: &mut Variables,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Option<End>, MacroError> {
        let blocks = self
            .programs
            .get(&number)
            .cloned()
            .ok_or(MacroError::NoProgram { line, number })?;
        if depth > CALL_DEPTH {
            return Err(MacroError::Block {
                line,
                reason: format!("calls are nested deeper than {CALL_DEPTH}"),
            });
        }
        let mut at = 0;
        while let Some(block) = blocks.get(at) {
            self.blocks += 1;
            if self.blocks > BLOCK_LIMIT {
                return Err(MacroError::Endless { line: block.line });
            }
            match self.step(&blocks, at, &block.statement, locals, depth, probe)? {
                Next::Block => at += 1,
                Next::Jump(target) => at = target,
                Next::Return => return Ok(None),
                Next::End(end) => return Ok(Some(end)),
            }
        }
        Ok(None)
    }

    fn step(
        &mut self,
        blocks: &[Block],
        at: usize,
        statement: &Statement,
        locals: &mut Variables,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Next, MacroError> {
        let line = blocks[at].line;
        let wrong = |reason: String| MacroError::Block { line, reason };
        let no_value = |error: ValueError| wrong(error.to_string());
        match statement {
            Statement::Nothing => Ok(Next::Block),
            Statement::Assign {
                variable,
                value,
                text,
            } => {
                let index = self
                    .value(variable, locals)
                    .map_err(no_value)?
                    .unwrap_or(0.0);
                let index = variable_number(index).map_err(no_value)?;
                let value = self.value(value, locals).map_err(no_value)?;
                self.assign(line, index, value, text, locals)
            }
            Statement::If(condition, then) => {
                if self.holds(condition, locals).map_err(no_value)? {
                    self.step(blocks, at, then, locals, depth, probe)
                } else {
                    Ok(Next::Block)
                }
            }
            Statement::Goto(target) => {
                let target = self.value(target, locals).map_err(no_value)?.unwrap_or(0.0);
                let found = blocks.iter().position(|block| {
                    block
                        .number
                        .is_some_and(|number| f64::from(number) == target)
                });
                found
                    .map(Next::Jump)
                    .ok_or_else(|| wrong(format!("there is no block N{target}")))
            }
            Statement::While(condition, label) => {
                if self.holds(condition, locals).map_err(no_value)? {
                    return Ok(Next::Block);
                }
                let ends = |block: &Block| matches!(block.statement, Statement::EndWhile(end) if end == *label);
                let end = blocks.iter().skip(at).position(ends);
                end.map(|offset| Next::Jump(at + offset + 1))
                    .ok_or_else(|| wrong(format!("there is no END{label}")))
            }
            Statement::EndWhile(label) => {
                let begins = |block: &Block| matches!(block.statement, Statement::While(_, begin) if begin == *label);
                let begin = blocks.iter().take(at).rposition(begins);
                begin
                    .map(Next::Jump)
                    .ok_or_else(|| wrong(format!("there is no DO{label}")))
            }
            Statement::Print(format) => {
                let printed = self.print(line, format, locals)?;
                self.events.push(Event::Print(printed));
                Ok(Next::Block)
            }
            Statement::Words(words) => {
                let mut values = Vec::new();
                for (letter, expression) in words {
                    // An address with a vacant value is ignored.
                    if let Some(value) = self.value(expression, locals).map_err(no_value)? {
                        values.push((*letter, value));
                    }
                }
                self.words(line, &values, locals, depth, probe)
            }
        }
    }

    fn lookup<'a>(&'a self, locals: &'a Variables) -> impl Fn(u32) -> Option<f64> + 'a {
        move |number| {
            let table = if (1..=33).contains(&number) {
                locals
            } else {
                &self.variables
            };
            table.get(&number).copied()
        }
    }

    fn value(
        &self,
        expression: &Expression,
        locals: &Variables,
    ) -> Result<Option<f64>, ValueError> {
        expression.value(&self.lookup(locals))
    }

    fn holds(&self, condition: &Condition, locals: &Variables) -> Result<bool, ValueError> {
        condition.holds(&self.lookup(locals))
    }

    fn assign(
        &mut self,
        line: u64,
        index: u32,
        value: Option<f64>,
        text: &str,
        locals: &mut Variables,
    ) -> Result<Next, MacroError> {
        match index {
            0 => {
                return Err(MacroError::Block {
                    line,
                    reason: "#0 is always vacant".to_owned(),
                });
            }
            3000 => {
                let number = value.unwrap_or(0.0).max(0.0) as u32;
                return Ok(Next::End(End::Alarm {
                    number,
                    text: text.to_owned(),
                }));
            }
            3006 => {
                self.events.push(Event::Message(text.to_owned()));
                return Ok(Next::Block);
            }
            _ => {}
        }
        let table = if index <= 33 {
            locals
        } else {
            &mut self.variables
        };
        match value {
            Some(value) => table.insert(index, value),
            None => table.remove(&index),
        };
        Ok(Next::Block)
    }

    /// One block of words: preparatory codes first, then the motion, then the miscellaneous code.
    fn words(
        &mut self,
        line: u64,
        words: &[(char, f64)],
        locals: &mut Variables,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Next, MacroError> {
        let wrong = |reason: String| MacroError::Block { line, reason };
        let get = |letter: char| {
            words
                .iter()
                .find(|(found, _)| *found == letter)
                .map(|(_, value)| *value)
        };
        let codes = |letter: char| {
            words
                .iter()
                .filter(move |(found, _)| *found == letter)
                .map(|(_, value)| *value)
        };
        let mut skip = false;
        for code in codes('G') {
            match code {
                0.0 | 1.0 => self.motion = code as u32,
                31.0 => skip = true,
                90.0 => self.absolute = true,
                91.0 => self.absolute = false,
                10.0 => return self.write_offset(line, words),
                65.0 => {
                    let mut inner = Variables::new();
                    for (letter, number) in ARGUMENTS {
                        if let Some(value) = get(letter) {
                            inner.insert(number, value);
                        }
                    }
                    let program = get('P').ok_or_else(|| wrong("G65 needs P".to_owned()))?;
                    let end = self.repeat(line, program, get('L'), &mut inner, depth, probe)?;
                    return Ok(end.map_or(Next::Block, Next::End));
                }
                // Units, planes, compensation off, work offset and feed mode: no move follows from them.
                17.0 | 18.0 | 19.0 | 21.0 | 40.0 | 49.0 | 54.0 | 80.0 | 94.0 | 98.0 => {}
                other => return Err(wrong(format!("G{other} is not understood"))),
            }
        }
        let target: Position = self
            .axes
            .iter()
            .filter_map(|&axis| get(axis).map(|value| (axis, value)))
            .collect();
        if !target.is_empty() {
            self.travel(&target, skip, probe);
        }
        for code in codes('M') {
            match code {
                98.0 => {
                    let program = get('P').ok_or_else(|| wrong("M98 needs P".to_owned()))?;
                    if let Some(end) = self.repeat(line, program, get('L'), locals, depth, probe)? {
                        return Ok(Next::End(end));
                    }
                }
                99.0 => return Ok(Next::Return),
                2.0 | 30.0 => return Ok(Next::End(End::Finished)),
                _ => {}
            }
        }
        Ok(Next::Block)
    }

    fn repeat(
        &mut self,
        line: u64,
        program: f64,
        times: Option<f64>,
        locals: &mut Variables,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Option<End>, MacroError> {
        for _ in 0..times.map_or(1, |times| times.clamp(1.0, 9999.0) as u32) {
            if let Some(end) = self.call(line, program.max(0.0) as u32, locals, depth + 1, probe)? {
                return Ok(Some(end));
            }
        }
        Ok(None)
    }

    fn travel(&mut self, words: &Position, skip: bool, probe: &mut dyn Probe) {
        let mut target = self.position.clone();
        for (axis, value) in words {
            let place = target.entry(*axis).or_insert(0.0);
            *place = if self.absolute {
                *value
            } else {
                *place + value
            };
        }
        if skip {
            let tripped = probe.skip(&self.position, &target, &self.variables);
            let reached = tripped.clone().unwrap_or_else(|| target.clone());
            for (number, axis) in (5061..).zip(&self.axes) {
                self.variables
                    .insert(number, reached.get(axis).copied().unwrap_or(0.0));
            }
            self.position.clone_from(&reached);
            self.events.push(Event::Skip {
                target,
                reached,
                tripped: tripped.is_some(),
            });
        } else {
            self.position.clone_from(&target);
            self.events.push(Event::Move(target));
        }
    }

    /// `G10 L2 Pn`: work offset n, 1 for G54.
    fn write_offset(&mut self, line: u64, words: &[(char, f64)]) -> Result<Next, MacroError> {
        let get = |letter: char| {
            words
                .iter()
                .find(|(found, _)| *found == letter)
                .map(|(_, value)| *value)
        };
        let (Some(2.0), Some(system)) = (
            get('L'),
            get('P').filter(|system| (1.0..=6.0).contains(system)),
        ) else {
            return Err(MacroError::Block {
                line,
                reason: "only G10 L2 P1 to P6 is understood".to_owned(),
            });
        };
        for (number, axis) in (5201 + 20 * system as u32..).zip(&self.axes) {
            if let Some(value) = get(*axis) {
                self.variables.insert(number, value);
            }
        }
        Ok(Next::Block)
    }

    /// The line that `DPRNT` makes: `*` is a space, `#n[wf]` a number with w digits before the point and f after it. The
    /// fraction is rounded; a number that needs more digits gets them; leading zeros are not printed.
    fn print(&self, line: u64, format: &str, locals: &Variables) -> Result<String, MacroError> {
        let mut printed = String::new();
        let mut rest = format;
        while let Some(letter) = rest.chars().next() {
            rest = &rest[letter.len_utf8()..];
            if letter == '*' {
                printed.push(' ');
            } else if letter == '#' {
                let wrong = || MacroError::Block {
                    line,
                    reason: format!("DPRNT: #n[wf] expected before {rest:?}"),
                };
                let (number, after) = rest.split_once('[').ok_or_else(wrong)?;
                let (digits, after) = after.split_once(']').ok_or_else(wrong)?;
                let number: u32 = number.trim().parse().map_err(|_not_whole| wrong())?;
                let fraction: usize = digits
                    .get(1..)
                    .unwrap_or("0")
                    .parse()
                    .map_err(|_not_whole| wrong())?;
                let value = self.lookup(locals)(number).unwrap_or(0.0);
                let mut text = format!("{value:.fraction$}");
                if fraction == 0 {
                    text.push('.');
                }
                printed.push_str(&text);
                rest = after;
            } else {
                printed.push(letter);
            }
        }
        Ok(printed)
    }
}
