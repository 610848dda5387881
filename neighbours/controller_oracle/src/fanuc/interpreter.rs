//! Runs FANUC programs as far as measuring and deciding need: what they move, touch, print and write.
//!
//! Understood: `#i=`, `IF[]GOTO`, `IF[]THEN`, `GOTO`, `WHILE[]DOm … ENDm`, `G65 P L` with arguments, `M98`, `M99`, `M30`,
//! `G0`/`G1` in `G90` and `G91`, the skip move `G31`, `G10 L2`, `#3000=n(TEXT)`, `#3006=1(TEXT)`, `POPEN`, `DPRNT[]`,
//! `PCLOS`. Positions are programmed positions in mm; there are no tool or work offsets in them. Anything else that moves
//! an axis is an error and never passed over.

use std::collections::BTreeMap;

use super::{
    block::{Block, Statement, split_comment, statement},
    expression::{Condition, Expression, ValueError, variable_number},
};
use crate::{
    control::{self, Control, End, Event, Motion, Next, Position, Probe, RunError},
    reader::Reader,
};

/// Variables by number; a variable that is missing is vacant.
pub type Variables = BTreeMap<u32, f64>;

/// A controller with its programs and variables.
#[derive(Clone, Debug)]
pub struct Interpreter {
    programs: BTreeMap<u32, Vec<Block>>,
    pub(super) axes: Vec<char>,
    /// Common and system variables.
    pub variables: Variables,
    pub(super) motion: Motion,
    blocks: usize,
    pub(super) events: Vec<Event>,
}

impl Control for Interpreter {
    type Block = Block;
    type Locals = Variables;

    fn line(block: &Block) -> u64 {
        block.line
    }

    fn executed(&mut self) -> &mut usize {
        &mut self.blocks
    }

    fn execute(
        &mut self,
        blocks: &[Block],
        index: usize,
        locals: &mut Variables,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Next, RunError> {
        self.step(
            blocks,
            index,
            &blocks[index].statement,
            locals,
            depth,
            probe,
        )
    }
}

impl Interpreter {
    /// A controller with these axes, in the order of their numbers; all at zero.
    pub fn new(axes: &[char]) -> Self {
        Self {
            programs: BTreeMap::new(),
            axes: axes.to_vec(),
            variables: Variables::new(),
            motion: Motion::new(axes),
            blocks: 0,
            events: Vec::new(),
        }
    }

    /// Where the axes are.
    pub fn position(&mut self) -> &mut Position {
        &mut self.motion.position
    }

    /// Reads a text of one or more programs, each beginning with its `O` number.
    pub fn load(&mut self, text: &str) -> Result<(), RunError> {
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
    ) -> Result<(End, Vec<Event>), RunError> {
        self.blocks = 0;
        self.events.clear();
        let mut locals = Variables::new();
        let end = self
            .call(0, number, &mut locals, 0, probe)?
            .unwrap_or(End::Finished);
        Ok((end, std::mem::take(&mut self.events)))
    }

    /// Runs a program until it returns (`None`) or everything ends.
    pub(super) fn call(
        &mut self,
        line: u64,
        number: u32,
        locals: &mut Variables,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Option<End>, RunError> {
        let blocks = self
            .programs
            .get(&number)
            .cloned()
            .ok_or_else(|| RunError::NoProgram {
                line,
                name: format!("O{number:04}"),
            })?;
        control::call(self, line, &blocks, locals, depth, probe)
    }

    fn step(
        &mut self,
        blocks: &[Block],
        at: usize,
        statement: &Statement,
        locals: &mut Variables,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Next, RunError> {
        let line = blocks[at].line;
        let wrong = |reason: String| RunError::Block { line, reason };
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

    /// Values of variables; #5021 and #5041 and those after them tell where the axes are.
    pub(super) fn lookup<'a>(&'a self, locals: &'a Variables) -> impl Fn(u32) -> Option<f64> + 'a {
        move |number| {
            let axis = match number {
                5021..=5026 | 5041..=5046 => self.axes.get((number % 10) as usize - 1),
                _ => None,
            };
            if let Some(axis) = axis {
                return self.motion.position.get(axis).copied();
            }
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
    ) -> Result<Next, RunError> {
        match index {
            0 => {
                return Err(RunError::Block {
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
}
