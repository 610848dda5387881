//! Which inputs a process took, in which order and when.
//!
//! The order in which messages on different topics reach a process cannot be reconstructed from their stamps. The process that drives a
//! node therefore writes a line for each step: the port, the publication number of the message on its topic (or the
//! timer's number) and the instant it gave as `now`. Lines are published in batches on `<node>/steps`.

use probecell_msgs::{StepJournal, std_msgs::Header};

use crate::Stamp;

/// Port number of timers.
pub const TIMER_PORT: u16 = u16::MAX;

/// One step of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The instant given as `now`.
    pub now: Stamp,
    /// Input port, or [`TIMER_PORT`].
    pub port: u16,
    /// Publication number of the message on its topic, or the timer's number.
    pub sequence: u64,
}

/// Collects steps until they are published.
#[derive(Debug)]
pub struct Journal {
    node: String,
    incarnation: u32,
    first_step: u64,
    steps: Vec<Step>,
}

impl Journal {
    /// An empty journal of the `incarnation`-th start of `node` in this session, counted from 0.
    pub fn new(node: impl Into<String>, incarnation: u32) -> Self {
        Self {
            node: node.into(),
            incarnation,
            first_step: 0,
            steps: Vec::new(),
        }
    }

    /// Starts of the node in this session before this one.
    pub fn incarnation(&self) -> u32 {
        self.incarnation
    }

    /// Adds a step.
    pub fn push(&mut self, step: Step) {
        self.steps.push(step);
    }

    /// Steps not yet taken as a batch.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// No step is waiting.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Takes the waiting steps as one message.
    pub fn take(&mut self) -> Option<StepJournal> {
        let last = self.steps.last()?;
        let message = StepJournal {
            header: Header {
                stamp: last.now.time(),
                frame_id: String::new(),
            },
            node: self.node.clone(),
            incarnation: self.incarnation,
            first_step: self.first_step,
            now: self.steps.iter().map(|step| step.now.0).collect(),
            port: self.steps.iter().map(|step| step.port).collect(),
            sequence: self.steps.iter().map(|step| step.sequence).collect(),
        };
        self.first_step += self.steps.len() as u64;
        self.steps.clear();
        Some(message)
    }
}

/// The steps that a message lists. Lists of unequal length are cut to the shortest.
pub fn steps(message: &StepJournal) -> impl Iterator<Item = Step> + '_ {
    message
        .now
        .iter()
        .zip(&message.port)
        .zip(&message.sequence)
        .map(|((&now, &port), &sequence)| Step {
            now: Stamp(now),
            port,
            sequence,
        })
}
