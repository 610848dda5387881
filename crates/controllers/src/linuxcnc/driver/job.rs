//! The command under way, from its first request to its reply.

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
};

use probecell_msgs::ControllerCommand;

use crate::linuxcnc::{
    client::Sample,
    log::{Entry, Fate, Follower, LogError},
    program::MeasuringProgram,
    protocol::{Interpreter, Mode, Set},
};

/// ns that the interpreter must have been idle before a program without its end in the log counts as over. The text of
/// an error comes on another way than the state: an emergency stop may be told by "Queue is not empty after probing"
/// before the state says so. A program may also be idle for a moment before it has begun.
const SETTLE: i64 = 500_000_000;

/// ns after which a measuring program in which nothing changes is given up: no move of it stands still.
const STALL: i64 = 10_000_000_000;

/// A command under way.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) command: ControllerCommand,
    pub(super) work: Work,
    /// Requests to make before the program runs, one in each poll.
    pub(super) steps: VecDeque<Set>,
    /// Error texts that came meanwhile.
    pub(super) errors: Vec<String>,
    /// Since when the interpreter has been idle, ns.
    idle_since: Option<i64>,
    /// G92 offsets are put aside until the program ends.
    pub(super) g92: bool,
    ended: bool,
    /// The motion sampled last, and since when it has been unchanged, ns.
    motion: Option<(i64, Motion)>,
}

/// Readings of the joints, line of the program and state of the interpreter.
type Motion = ([f64; 6], u32, Interpreter);

/// The kind of work and how far it is.
#[derive(Debug)]
pub(super) enum Work {
    Measure {
        program: MeasuringProgram,
        follower: Follower,
        heading: Option<(u32, u32)>,
        tally: Tally,
    },
    Operation,
    Shift {
        follower: Follower,
        values: Vec<f64>,
    },
    Wear {
        follower: Follower,
        tool: u32,
        before: f64,
        wanted: f64,
    },
    /// Waits until the controller has stopped.
    Stop,
}

/// Probing moves that have ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    pub(super) ended: usize,
    pub(super) misses: usize,
    pub(super) stuck: Option<u32>,
    pub(super) rotated: Option<f64>,
}

/// A probing move that has ended, as logged; mm and degrees.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Probed {
    pub(super) number: usize,
    pub(super) fate: Fate,
    pub(super) position: Vec<f64>,
}

/// Progress of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    Working,
    /// The program has come to its end, or, where it has no log, the controller is idle again.
    Ended,
    /// The controller is idle, but the program has not come to its end.
    BrokenOff,
    /// The controller reports the program as running, but nothing changes.
    Stalled,
}

impl Job {
    pub(super) fn new(command: ControllerCommand, work: Work, program: Option<&Path>) -> Self {
        let steps = match program {
            Some(path) => {
                let path = path.to_string_lossy().into_owned();
                [Set::Mode(Mode::Auto), Set::Open(path), Set::Run].into()
            }
            None => VecDeque::new(),
        };
        Self {
            command,
            work,
            steps,
            errors: Vec::new(),
            idle_since: None,
            g92: false,
            ended: false,
            motion: None,
        }
    }

    /// Takes in what the log has grown by.
    pub(super) fn follow(&mut self, token: &str) -> Result<Vec<Probed>, LogError> {
        let entries = match &mut self.work {
            Work::Measure { follower, .. }
            | Work::Shift { follower, .. }
            | Work::Wear { follower, .. } => follower.read_new()?,
            Work::Operation | Work::Stop => return Ok(Vec::new()),
        };
        let mut probed = Vec::new();
        for entry in entries {
            match (entry, &mut self.work) {
                (
                    Entry::Begin {
                        token: found, g92, ..
                    },
                    _,
                ) => {
                    // A file of this name from another run would have been removed; its lines must not count.
                    self.g92 = g92 && found == token;
                }
                (Entry::End, _) => self.ended = true,
                (Entry::Offset(value), Work::Shift { values, .. }) => values.push(value),
                (
                    Entry::Next {
                        number,
                        point_index,
                    },
                    Work::Measure { heading, .. },
                ) => {
                    *heading = Some((number, point_index));
                }
                (Entry::Rotated(angle), Work::Measure { tally, .. }) => tally.rotated = Some(angle),
                (
                    Entry::Probed {
                        number,
                        point_index,
                        fate,
                        position,
                    },
                    Work::Measure { tally, heading, .. },
                ) => {
                    tally.ended += 1;
                    tally.misses += usize::from(fate == Fate::Miss);
                    if fate == Fate::Stuck {
                        tally.stuck = Some(point_index);
                    }
                    *heading = None;
                    probed.push(Probed {
                        number: number as usize,
                        fate,
                        position,
                    });
                }
                _ => {}
            }
        }
        Ok(probed)
    }

    /// Whether the job has come to an end, seen from the controller's state at `now` (ns).
    pub(super) fn progress(&mut self, sample: &Sample, now: i64) -> Progress {
        if !self.steps.is_empty() {
            return Progress::Working;
        }
        if sample.interpreter != Interpreter::Idle {
            self.idle_since = None;
            return if self.stalls(sample, now) {
                Progress::Stalled
            } else {
                Progress::Working
            };
        }
        let since = *self.idle_since.get_or_insert(now);
        let settled = now - since >= SETTLE;
        match self.work {
            Work::Stop => Progress::Ended,
            _ if self.ended => Progress::Ended,
            _ if !settled => Progress::Working,
            Work::Operation if self.errors.is_empty() => Progress::Ended,
            _ => Progress::BrokenOff,
        }
    }

    /// Whether a measurement that should run shows no change at all. The remote shell goes on answering from its last
    /// picture when the controller behind it has died.
    fn stalls(&mut self, sample: &Sample, now: i64) -> bool {
        let seen = (sample.joints, sample.line, sample.interpreter);
        if self.motion.as_ref().is_none_or(|(_, known)| *known != seen) {
            self.motion = Some((now, seen));
        }
        let may_stand = sample.interpreter == Interpreter::Paused || sample.feed_override == 0.0;
        let since = self.motion.as_ref().map_or(now, |(since, _)| *since);
        matches!(self.work, Work::Measure { .. }) && !may_stand && now - since > STALL
    }

    /// Where a measurement was, for a person.
    pub(super) fn whereabouts(&self) -> String {
        match &self.work {
            Work::Measure {
                program,
                heading,
                tally,
                ..
            } => match heading {
                Some((number, point)) => {
                    format!(
                        "on the way to point {point}, touch {number} of {}",
                        program.touches.len()
                    )
                }
                None => format!("after {} of {} touches", tally.ended, program.touches.len()),
            },
            Work::Operation => format!("in operation {:?}", self.command.operation),
            Work::Shift { .. } => "while writing a work offset".to_owned(),
            Work::Wear { tool, .. } => format!("while writing the wear of tool {tool}"),
            Work::Stop => "while stopping".to_owned(),
        }
    }
}

/// Program and log of a job, here and as the controller knows them.
#[derive(Clone, Debug)]
pub(super) struct Files {
    pub(super) token: String,
    pub(super) program: PathBuf,
    pub(super) log: PathBuf,
    pub(super) controller_program: PathBuf,
    pub(super) controller_log: PathBuf,
}

impl Files {
    /// Names made of the run of the driver and the number of the command, so that no two jobs share a log.
    pub(super) fn new(here: &Path, there: &Path, session: &str, command_id: u64) -> Self {
        let plain = |letter: char| {
            if letter.is_ascii_alphanumeric() || letter == '-' {
                letter
            } else {
                '_'
            }
        };
        let token = format!(
            "probecell-{}-{command_id}",
            session.chars().map(plain).collect::<String>()
        );
        let (program, log) = (format!("{token}.ngc"), format!("{token}.log"));
        Self {
            program: here.join(&program),
            log: here.join(&log),
            controller_program: there.join(&program),
            controller_log: there.join(&log),
            token,
        }
    }
}
