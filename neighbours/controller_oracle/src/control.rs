//! What the interpreters of all controllers share: positions, the probe that answers, what a program did and how it ended.
//!
//! Positions are those that a program names, in mm and degrees; there are no work or tool offsets in them, so machine and
//! work coordinates are the same.

use std::collections::BTreeMap;

use controllers::text::ParseError;

/// Deepest nesting of calls.
const CALL_DEPTH: usize = 16;
/// Blocks after which a program counts as endless.
const BLOCK_LIMIT: usize = 1_000_000;

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

/// What a block leads to.
pub(crate) enum Next {
    /// The block after it.
    Block,
    /// The block with this index.
    Jump(usize),
    /// The caller.
    Return,
    /// The end of everything.
    End(End),
}

/// A controller that can call programs: what differs between the languages.
pub(crate) trait Control {
    /// One line of a program.
    type Block: Clone;
    /// Variables of one call.
    type Locals;

    /// The line of a block.
    fn line(block: &Self::Block) -> u64;

    /// Blocks executed since the run began.
    fn executed(&mut self) -> &mut usize;

    /// Executes the block at `index`.
    fn execute(
        &mut self,
        blocks: &[Self::Block],
        index: usize,
        locals: &mut Self::Locals,
        depth: usize,
        probe: &mut dyn Probe,
    ) -> Result<Next, RunError>;
}

/// Calls a program: its blocks until it returns (`None`) or the run ends. `line` is that of the call.
pub(crate) fn call<C: Control>(
    control: &mut C,
    line: u64,
    blocks: &[C::Block],
    locals: &mut C::Locals,
    depth: usize,
    probe: &mut dyn Probe,
) -> Result<Option<End>, RunError> {
    if depth > CALL_DEPTH {
        return Err(RunError::Block {
            line,
            reason: format!("calls are nested deeper than {CALL_DEPTH}"),
        });
    }
    let mut index = 0;
    while let Some(block) = blocks.get(index) {
        *control.executed() += 1;
        if *control.executed() > BLOCK_LIMIT {
            return Err(RunError::Endless {
                line: C::line(block),
            });
        }
        match control.execute(blocks, index, locals, depth, probe)? {
            Next::Block => index += 1,
            Next::Jump(target) => index = target,
            Next::Return => return Ok(None),
            Next::End(end) => return Ok(Some(end)),
        }
    }
    Ok(None)
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
            let coordinate = target.entry(*axis).or_insert(0.0);
            *coordinate = if self.absolute {
                *value
            } else {
                *coordinate + value
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
