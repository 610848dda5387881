//! The invariants, checked at every step against what was published and what has reached whom. Nothing of the nodes' own
//! checks is used here but the verification of a signature.

mod parts;
mod touches;
mod writes;

use cell_tests::BEGIN;
use graph::{Published, Stamp};
use probecell_msgs::{Message, from_cdr};

use crate::traffic::Taken;

/// What must hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Invariant {
    /// A write lies within the bounds of its correction and of the cell file.
    Bound,
    /// A correction names touches of its plan that were made in this session of the driver.
    Source,
    /// A write is exactly what somebody entitled has signed.
    Signature,
    /// A write is for the session of the driver in which its source was measured.
    Session,
    /// A write is for a part that is being made and waits for it.
    LivingPart,
    /// No correction is written twice, and the machine carries out no command twice.
    Twice,
    /// Nothing is written or begun for a part after an operator's STOP has reached the gate.
    AfterStop,
    /// Nothing is written after a rejection, or the withdrawal of a key, has reached the gate.
    AfterWithdrawal,
    /// No operation begins without a recorder.
    Unrecorded,
    /// A machine does not move for longer than a second without a gate.
    Unsupervised,
    /// Each trigger that reached `probe_events` is an event, and each that did not is a gap in their numbers.
    TouchLost,
    /// No touch is published twice.
    TouchTwice,
    /// No number of a request, command, run or correction stands for two things.
    Number,
    /// No part is reported twice.
    ReportTwice,
    /// Every part ends in a report, within the deadline of its stage.
    PartLate,
    /// A replay of what was recorded equals it, or says truthfully that it is incomplete.
    Replay,
    /// When everything is in order again, a part can be made.
    Recovery,
}

/// An invariant that does not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// Which one.
    pub invariant: Invariant,
    /// s after the beginning of the session.
    pub at: f64,
    /// What was seen.
    pub text: String,
}

/// What all checks share.
pub(crate) struct Findings {
    now: Stamp,
    first: Option<Violation>,
}

impl Findings {
    /// Notes a violation; the first one counts.
    fn expect(&mut self, holds: bool, invariant: Invariant, text: impl FnOnce() -> String) {
        if !holds && self.first.is_none() {
            self.first = Some(Violation {
                invariant,
                at: self.now.since_s(BEGIN),
                text: text(),
            });
        }
    }
}

fn read<M: Message>(payload: &[u8]) -> M {
    from_cdr(payload).unwrap_or_else(|error| panic!("{}: {error}", M::TYPE.name))
}

/// All checks of a run.
pub(crate) struct Checker {
    findings: Findings,
    writes: writes::Writes,
    parts: parts::Parts,
    touches: touches::Touches,
}

/// What was made in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Parts that were begun.
    pub parts: usize,
    /// Corrections written.
    pub writes: usize,
    /// Touches.
    pub touches: usize,
}

impl Checker {
    /// `wear_limit`: m, from the cell file; `part_limit`: s.
    pub(crate) fn new(wear_limit: f64, part_limit: f64) -> Self {
        Self {
            findings: Findings {
                now: BEGIN,
                first: None,
            },
            writes: writes::Writes::new(wear_limit, part_limit),
            parts: parts::Parts::default(),
            touches: touches::Touches::default(),
        }
    }

    /// A message has reached a subscriber.
    pub(crate) fn taken(&mut self, taken: &Taken) {
        self.findings.now = taken.now;
        self.writes.taken(taken);
        self.parts.taken(taken);
        self.touches.taken(taken);
    }

    /// A message was published.
    pub(crate) fn published(&mut self, now: Stamp, published: &Published) {
        self.findings.now = now;
        self.writes.published(published, &mut self.findings);
        self.parts.published(now, published, &mut self.findings);
        self.touches.published(published, &mut self.findings);
    }

    /// A process has ended.
    pub(crate) fn ended(&mut self, node: &str) {
        self.writes.ended(node);
        self.parts.ended(node);
        self.touches.ended(node);
    }

    /// The whole cell has been started anew, but its driver: names and numbers of parts begin again.
    pub(crate) fn new_session(&mut self) {
        self.writes.new_session();
        self.parts.new_session();
        self.touches.new_session();
    }

    /// A process has been started, or goes on.
    pub(crate) fn begins(&mut self, now: Stamp, node: &str) {
        self.parts.begins(now, node);
    }

    /// A process stands still.
    pub(crate) fn pauses(&mut self, node: &str) {
        self.parts.pauses(node);
    }

    /// Parts that have no report yet and must get one.
    pub(crate) fn open_parts(&self) -> Vec<String> {
        self.parts.open()
    }

    /// Checks what can be said at the end only. `waiting`: numbers of the triggers that `probe_events` still holds.
    pub(crate) fn end(&mut self, now: Stamp, waiting: &[u64]) {
        self.findings.now = now;
        self.touches.end(waiting, &mut self.findings);
        let open = self.parts.open();
        self.findings
            .expect(open.is_empty(), Invariant::PartLate, || {
                format!("{} has no report", open.join(", "))
            });
    }

    /// Notes what the world itself has found.
    pub(crate) fn expect(
        &mut self,
        now: Stamp,
        holds: bool,
        invariant: Invariant,
        text: impl FnOnce() -> String,
    ) {
        self.findings.now = now;
        self.findings.expect(holds, invariant, text);
    }

    /// The first invariant that did not hold.
    pub(crate) fn violation(&self) -> Option<&Violation> {
        self.findings.first.as_ref()
    }

    pub(crate) fn count(&self) -> Count {
        Count {
            parts: self.parts.begun(),
            writes: self.writes.written(),
            touches: self.touches.made(),
        }
    }
}
