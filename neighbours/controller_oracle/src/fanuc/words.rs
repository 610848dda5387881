//! Obeys a block of words: preparatory codes, motion, calls, offsets.

use super::interpreter::{Interpreter, Variables};
use crate::control::{End, Next, Position, Probe, RunError};

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

impl Interpreter {
    /// One block of words: preparatory codes first, then the motion, then the miscellaneous code.
    pub(super) fn words(
        &mut self,
        line: u64,
        words: &[(char, f64)],
        locals: &mut Variables,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Next, RunError> {
        let wrong = |reason: String| RunError::Block { line, reason };
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
                31.0 => skip = true,
                90.0 => self.motion.absolute = true,
                91.0 => self.motion.absolute = false,
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
                // Rapid or feed, units, planes, compensation off, work offset, rotation off, feed mode: no move follows
                // from them.
                0.0 | 1.0 | 17.0 | 18.0 | 19.0 | 21.0 | 40.0 | 49.0 | 54.0 | 69.0 | 80.0 | 94.0
                | 98.0 => {}
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
    ) -> Result<Option<End>, RunError> {
        for _ in 0..times.map_or(1, |times| times.clamp(1.0, 9999.0) as u32) {
            if let Some(end) = self.call(line, program.max(0.0) as u32, locals, depth + 1, probe)? {
                return Ok(Some(end));
            }
        }
        Ok(None)
    }

    fn travel(&mut self, words: &Position, skip: bool, probe: &mut dyn Probe) {
        if !skip {
            let event = self.motion.travel(words);
            self.events.push(event);
            return;
        }
        let (_, event) = self.motion.skip(words, probe);
        for (number, axis) in (5061..).zip(&self.axes) {
            let reached = self.motion.position.get(axis).copied().unwrap_or(0.0);
            self.variables.insert(number, reached);
        }
        self.events.push(event);
    }

    /// `G10 L2 Pn`: work offset n, 1 for G54.
    fn write_offset(&mut self, line: u64, words: &[(char, f64)]) -> Result<Next, RunError> {
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
            return Err(RunError::Block {
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
}
