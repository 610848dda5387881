//! The journal of a hall: what happened, numbered, so that a page that was cut off can be told what it missed.

use graph::Stamp;

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EventKind {
    /// A cell appeared, left or came back.
    Cell,
    /// The stage of a part changed, or a part ended.
    Part,
    /// A touch.
    Touch,
    /// A verdict, or the decision on a pass.
    Verdict,
    /// A correction was proposed, decided on or acknowledged.
    Correction,
    /// A gap report.
    Gap,
    /// A fault or an alarm.
    Fault,
    /// Messages were lost.
    Loss,
}

impl EventKind {
    /// In words, for one and for several.
    pub fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Cell => ("change of a cell", "changes of cells"),
            Self::Part => ("stage of a part", "stages of parts"),
            Self::Touch => ("touch", "touches"),
            Self::Verdict => ("verdict", "verdicts"),
            Self::Correction => ("correction step", "correction steps"),
            Self::Gap => ("gap report", "gap reports"),
            Self::Fault => ("fault", "faults"),
            Self::Loss => ("loss", "losses"),
        }
    }
}

/// Something that happened in a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Number in the hall, from 1, without gaps.
    pub number: u64,
    /// When it was received.
    pub at: Stamp,
    /// Name of the cell.
    pub cell: String,
    /// Kind.
    pub kind: EventKind,
    /// A sentence for people.
    pub text: String,
}
