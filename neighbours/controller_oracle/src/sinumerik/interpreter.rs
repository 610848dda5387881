//! Runs SINUMERIK programs as far as measuring and deciding need: what they move, touch, write and say.
//!
//! Understood: R parameters, `DEF` of INT, REAL and BOOL and fields of them, assignments, `IF … ELSE … ENDIF`,
//! `WHILE … ENDWHILE`, `GOTOF`, `GOTOB`, `GOTO` with and without `IF`, calls of subprograms by name, `PROC`, `M17`, `RET`,
//! `M2`, `M30`, `G0`/`G1` in `G90` and `G91`, `MEAS=1`, `STOPRE`, `MSG`, `WRITE`, `SETAL`. Several programs stand in one
//! text, each after its name as `%_N_NAME_MPF` or `%_N_NAME_SPF`; what stands after `_DEF` is global. Measured values may
//! be read only after a `STOPRE`: a control that reads ahead would see those of the touch before. Anything else that
//! moves an axis is an error and never passed over.

use std::collections::BTreeMap;

use controllers::text::ParseError;

use super::{
    block::{Block, Statement, block, without_comment},
    expression::ValueError,
    flow::{after_branch, begins_loop, end_of_loop, find_label},
    memory::{Local, RESULTS, Variables},
};
use crate::control::{self, Control, End, Event, Motion, Next, Position, Probe, RunError};

/// Longest text that `WRITE` takes.
const WRITE_LIMIT: usize = 200;

/// A controller with its programs and variables.
#[derive(Clone, Debug)]
pub struct Interpreter {
    programs: BTreeMap<String, Vec<Block>>,
    pub(super) defined: BTreeMap<String, Option<u32>>,
    axes: Vec<char>,
    /// R parameters, global user data and system variables.
    pub variables: Variables,
    /// What `WRITE` answers; 0: the line was written.
    pub write_error: f64,
    pub(super) motion: Motion,
    message: String,
    /// A touch may still be under way for what is read ahead.
    pub(super) ahead: bool,
    blocks: usize,
    events: Vec<Event>,
}

impl Control for Interpreter {
    type Block = Block;
    type Locals = Local;

    fn line(block: &Block) -> u64 {
        block.line
    }

    fn executed(&mut self) -> &mut usize {
        &mut self.blocks
    }

    /// The statements of a block one after the other, until one of them leads elsewhere.
    fn execute(
        &mut self,
        blocks: &[Block],
        index: usize,
        locals: &mut Local,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Next, RunError> {
        for statement in &blocks[index].statements {
            match self.step(blocks, index, statement, locals, depth, probe)? {
                Next::Block => {}
                next => return Ok(next),
            }
        }
        Ok(Next::Block)
    }
}

impl Interpreter {
    /// A controller with these axes, all at zero.
    pub fn new(axes: &[char]) -> Self {
        Self {
            programs: BTreeMap::new(),
            defined: BTreeMap::from([(RESULTS.0.to_owned(), Some(RESULTS.1))]),
            axes: axes.to_vec(),
            variables: Variables::new(),
            write_error: 0.0,
            motion: Motion::new(axes),
            message: String::new(),
            ahead: false,
            blocks: 0,
            events: Vec::new(),
        }
    }

    /// Where the axes are.
    pub fn position(&mut self) -> &mut Position {
        &mut self.motion.position
    }

    /// Reads a text of one or more programs.
    pub fn load(&mut self, text: &str) -> Result<(), RunError> {
        let mut current: Option<String> = None;
        for (line, content) in (1..).zip(text.lines()) {
            let content = without_comment(content);
            if let Some(name) = content.strip_prefix("%_N_") {
                let (name, kind) = name.rsplit_once('_').unwrap_or((name, ""));
                if !matches!(kind, "MPF" | "SPF" | "DEF") || name.is_empty() {
                    return Err(ParseError {
                        line,
                        column: 1,
                        expected: "%_N_NAME_MPF, _SPF or _DEF".to_owned(),
                        found: format!("{content:?}"),
                    }
                    .into());
                }
                let key = if kind == "DEF" {
                    String::new()
                } else {
                    name.to_ascii_uppercase()
                };
                self.programs.entry(key.clone()).or_default().clear();
                current = Some(key);
                continue;
            }
            let block = block(line, content)?;
            if block.statements.is_empty() && block.label.is_none() {
                continue;
            }
            match &current {
                Some(name) if name.is_empty() => self.define(line, &block.statements)?,
                Some(name) => self.programs.entry(name.clone()).or_default().push(block),
                None => {
                    return Err(ParseError {
                        line,
                        column: 1,
                        expected: "the name of a program, %_N_NAME_MPF".to_owned(),
                        found: format!("{content:?}"),
                    }
                    .into());
                }
            }
        }
        Ok(())
    }

    /// Global definitions.
    fn define(&mut self, line: u64, statements: &[Statement]) -> Result<(), RunError> {
        for statement in statements {
            match statement {
                Statement::Define { name, fields } => {
                    self.defined.insert(name.clone(), *fields);
                }
                Statement::Words { .. } | Statement::Return => {}
                _ => {
                    return Err(RunError::Block {
                        line,
                        reason: "only DEF can stand among definitions".to_owned(),
                    });
                }
            }
        }
        Ok(())
    }

    /// Runs a program to its end; gives how it ended and what it did.
    pub fn run(
        &mut self,
        name: &str,
        probe: &mut dyn Probe,
    ) -> Result<(End, Vec<Event>), RunError> {
        self.blocks = 0;
        self.events.clear();
        self.message.clear();
        let end = self.call(0, name, 0, probe)?.unwrap_or(End::Finished);
        Ok((end, std::mem::take(&mut self.events)))
    }

    /// Runs a program until it returns (`None`) or everything ends.
    fn call(
        &mut self,
        line: u64,
        name: &str,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Option<End>, RunError> {
        let no_program = || RunError::NoProgram {
            line,
            name: name.to_owned(),
        };
        let blocks = self.programs.get(name).cloned().ok_or_else(no_program)?;
        control::call(self, line, &blocks, &mut Local::default(), depth, probe)
    }

    fn step(
        &mut self,
        blocks: &[Block],
        at: usize,
        statement: &Statement,
        local: &mut Local,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Next, RunError> {
        let line = blocks[at].line;
        let wrong = |reason: String| RunError::Block { line, reason };
        let no_value = |error: ValueError| wrong(error.to_string());
        let missing = |what: &str| wrong(format!("there is no {what}"));
        match statement {
            Statement::If(condition) => {
                if self.number(condition, local).map_err(no_value)? != 0.0 {
                    return Ok(Next::Block);
                }
                let after = after_branch(blocks, at, true).ok_or_else(|| missing("ENDIF"))?;
                return Ok(Next::Jump(after));
            }
            Statement::Else => {
                let after = after_branch(blocks, at, false).ok_or_else(|| missing("ENDIF"))?;
                return Ok(Next::Jump(after));
            }
            Statement::EndIf => {}
            Statement::While(condition) => {
                if self.number(condition, local).map_err(no_value)? == 0.0 {
                    let end = end_of_loop(blocks, at).ok_or_else(|| missing("ENDWHILE"))?;
                    return Ok(Next::Jump(end + 1));
                }
            }
            Statement::EndWhile => {
                let begins = |&index: &usize| {
                    begins_loop(&blocks[index]) && end_of_loop(blocks, index) == Some(at)
                };
                let begin = (0..at).rev().find(begins).ok_or_else(|| missing("WHILE"))?;
                return Ok(Next::Jump(begin));
            }
            Statement::Jump {
                condition,
                direction,
                label,
            } => {
                let holds = match condition {
                    Some(condition) => self.number(condition, local).map_err(no_value)? != 0.0,
                    None => true,
                };
                if holds {
                    let target = find_label(blocks, at, *direction, label);
                    return target
                        .map(Next::Jump)
                        .ok_or_else(|| missing(&format!("label {label} in this direction")));
                }
            }
            Statement::Define { name, fields: None } => {
                local.defined.insert(name.clone());
            }
            Statement::Define { .. } => {
                return Err(wrong("a local field is not understood".to_owned()));
            }
            Statement::Assign(target, value) => {
                let value = self.number(value, local).map_err(no_value)?;
                self.assign(target, value, local).map_err(no_value)?;
            }
            Statement::Message(text) => {
                self.message = self.text(text, local).map_err(no_value)?;
                self.events.push(Event::Message(self.message.clone()));
            }
            Statement::Write { error, text } => {
                let text = self.text(text, local).map_err(no_value)?;
                if text.len() > WRITE_LIMIT {
                    return Err(wrong(format!(
                        "WRITE takes {WRITE_LIMIT} characters, not {}",
                        text.len()
                    )));
                }
                if self.write_error == 0.0 {
                    self.events.push(Event::Print(text));
                }
                let answer = self.write_error;
                self.assign(error, answer, local).map_err(no_value)?;
            }
            Statement::Alarm(number) => {
                let number = self.number(number, local).map_err(no_value)?;
                return Ok(Next::End(End::Alarm {
                    number: number.max(0.0) as u32,
                    text: self.message.clone(),
                }));
            }
            Statement::Stop => self.ahead = false,
            Statement::Call(name) => {
                if let Some(end) = self.call(line, name, depth + 1, probe)? {
                    return Ok(Next::End(end));
                }
            }
            Statement::Return => return Ok(Next::Return),
            Statement::Words { words, measure } => {
                let mut values = Vec::new();
                for (letter, expression) in words {
                    values.push((*letter, self.number(expression, local).map_err(no_value)?));
                }
                let measure = match measure {
                    Some(measure) => Some(self.number(measure, local).map_err(no_value)?),
                    None => None,
                };
                return self.words(line, &values, measure, probe);
            }
        }
        Ok(Next::Block)
    }

    /// One block of words: preparatory codes, the motion, then the miscellaneous code.
    fn words(
        &mut self,
        line: u64,
        words: &[(char, f64)],
        measure: Option<f64>,
        probe: &mut dyn Probe,
    ) -> Result<Next, RunError> {
        let wrong = |reason: String| RunError::Block { line, reason };
        let mut target = Position::new();
        let mut next = Next::Block;
        for &(letter, value) in words {
            let code = value as i64;
            match (letter, code) {
                ('G', 90) => self.motion.absolute = true,
                ('G', 91) => self.motion.absolute = false,
                // Rapid or feed, dwell, planes, compensation off, frames, metric, feed per minute.
                ('G', 0 | 1 | 4 | 17..=19 | 40 | 53..=57 | 71 | 94 | 500 | 710) => {}
                ('G', _) => return Err(wrong(format!("G{value} is not understood"))),
                ('M', 2 | 30) => next = Next::End(End::Finished),
                ('M', 17) => next = Next::Return,
                ('D' | 'F' | 'M' | 'N' | 'S' | 'T', _) => {}
                _ if self.axes.contains(&letter) => {
                    target.insert(letter, value);
                }
                _ => return Err(wrong(format!("{letter} is not understood"))),
            }
        }
        let event = match (measure, target.is_empty()) {
            (None, true) => return Ok(next),
            (None, false) => self.motion.travel(&target),
            (Some(_), true) => return Err(wrong("MEAS needs a move".to_owned())),
            (Some(number), false) if number != 1.0 => {
                return Err(wrong(format!("MEAS={number} is not understood")));
            }
            (Some(_), false) => {
                let (tripped, event) = self.motion.skip(&target, probe);
                self.ahead = true;
                self.latch(tripped);
                event
            }
        };
        self.events.push(event);
        Ok(next)
    }
}
