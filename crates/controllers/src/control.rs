//! What the interpreters of all controllers share: positions, the probe that answers, what a program did and how it ended.
//!
//! Positions are those that a program names, in mm and degrees; there are no work or tool offsets in them, so machine and
//! work coordinates are the same.

use std::collections::BTreeMap;

use crate::text::ParseError;

/// Deepest nesting of calls.
pub(crate) const CALL_DEPTH: usize = 16;
/// Blocks after which a program counts as endless.
pub(crate) const BLOCK_LIMIT: usize = 1_000_000;

/// Position by axis letter, mm or degrees.
pub type Position = BTreeMap<char, f64>;

/// What answers a probing move: the machine and its part.
pub trait Probe {
    /// Where the probe trips on the straight way, if it does.
    fn skip(&mut self, from: &Position, to: &Position) -> Option<Position>;
}

/// What a program did.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A move at rapid or feed, to here.
    Move(Position),
    /// A probing move: its target, and where it ended.
    Skip {
        /// Programmed target.
        target: Position,
        /// Where the axes stopped.
        reached: Position,
        /// The probe tripped.
        tripped: bool,
    },
    /// A line that was printed, or written to a log.
    Print(String),
    /// A message to the operator.
    Message(String),
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// At the end of the program.
    Finished,
    /// By an alarm.
    Alarm {
        /// Number of the alarm.
        number: u32,
        /// Its text.
        text: String,
    },
}

/// Why a program cannot be read or run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RunError {
    /// A line makes no sense.
    #[error(transparent)]
    Line(#[from] ParseError),
    /// A program was called that is not there.
    #[error("line {line}: there is no program {name}")]
    NoProgram {
        /// Line of the call.
        line: u64,
        /// Name of the program.
        name: String,
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

/// The axes of a controller: where they are, and how a target is meant.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    pub(crate) position: Position,
    pub(crate) absolute: bool,
}

impl Motion {
    /// All axes at zero, absolute targets.
    pub(crate) fn new(axes: &[char]) -> Self {
        Self {
            position: axes.iter().map(|&axis| (axis, 0.0)).collect(),
            absolute: true,
        }
    }

    fn target(&self, words: &Position) -> Position {
        let mut target = self.position.clone();
        for (axis, value) in words {
            let place = target.entry(*axis).or_insert(0.0);
            *place = if self.absolute {
                *value
            } else {
                *place + value
            };
        }
        target
    }

    /// An ordinary move.
    pub(crate) fn travel(&mut self, words: &Position) -> Event {
        self.position = self.target(words);
        Event::Move(self.position.clone())
    }

    /// A probing move, which ends where the probe trips; gives whether it did.
    pub(crate) fn skip(&mut self, words: &Position, probe: &mut dyn Probe) -> (bool, Event) {
        let target = self.target(words);
        let at = probe.skip(&self.position, &target);
        let tripped = at.is_some();
        let reached = at.unwrap_or_else(|| target.clone());
        self.position.clone_from(&reached);
        let event = Event::Skip {
            target,
            reached,
            tripped,
        };
        (tripped, event)
    }
}
