//! What each node of a run took and gave, step by step, so that one node can be run again from any of its steps.
//!
//! Inputs come from the log by the node's own journal; outputs from a fresh node that is fed with them. That these
//! outputs are the logged ones is what `tests/main/replay.rs` proves.

use std::collections::BTreeMap;

use cell::Cell;
use graph::{
    Emitted, Instance, Published, Stamp,
    journal::{self, TIMER_PORT},
    topics,
};
use probecell_msgs::{StepJournal, from_cdr};
use serde_json::Value;

use crate::instance;

/// What a step is made on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Timer of that number.
    Timer(u32),
    /// Input port and CDR payload.
    Message(usize, Vec<u8>),
}

/// One node of a run.
pub struct Trace {
    /// The node.
    pub node: &'static str,
    cell: Cell,
    steps: Vec<(Stamp, Cause)>,
    given: Vec<Emitted>,
}

impl Trace {
    /// The trace of every node of the cell in the log of a run.
    pub fn all(cell: &Cell, log: &[Published]) -> Vec<Self> {
        let payloads: BTreeMap<(&str, u64), &[u8]> = log
            .iter()
            .map(|published| {
                let key = (published.topic.as_str(), published.sequence);
                (key, published.payload.as_slice())
            })
            .collect();
        let names = cell.node_names();
        names
            .into_iter()
            .map(|name| Self::of(cell, name, &payloads))
            .collect()
    }

    fn of(cell: &Cell, node: &'static str, payloads: &BTreeMap<(&str, u64), &[u8]>) -> Self {
        let mut fresh = instance(cell, node);
        let topic = topics::journal_name(node);
        let journals = payloads.iter().filter(|((name, _), _)| *name == topic);
        let mut steps = Vec::new();
        for (_, payload) in journals {
            let journal: StepJournal =
                from_cdr(payload).unwrap_or_else(|error| panic!("{topic}: {error}"));
            for step in journal::steps(&journal) {
                let cause = if step.port == TIMER_PORT {
                    Cause::Timer(step.sequence as u32)
                } else {
                    let port = usize::from(step.port);
                    let key = (fresh.inputs()[port].name, step.sequence);
                    Cause::Message(port, payloads[&key].to_vec())
                };
                steps.push((step.now, cause));
            }
        }
        let given = steps
            .iter()
            .map(|(now, cause)| take(fresh.as_mut(), *now, cause))
            .collect();
        Self {
            node,
            cell: cell.clone(),
            steps,
            given,
        }
    }

    /// Number of steps.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// The node made no step.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// What the steps are made on.
    pub fn causes(&self) -> impl Iterator<Item = &Cause> {
        self.steps.iter().map(|(_, cause)| cause)
    }

    /// The node's state before each step of `cuts` (ascending), as JSON text.
    pub fn snapshots(&self, cuts: &[usize]) -> Vec<String> {
        let mut node = instance(&self.cell, self.node);
        let mut at = 0;
        let mut texts = Vec::with_capacity(cuts.len());
        for &cut in cuts {
            for (now, cause) in &self.steps[at..cut] {
                take(node.as_mut(), *now, cause);
            }
            at = cut;
            texts.push(node.snapshot().to_string());
        }
        texts
    }

    /// The node's state at its start.
    pub fn start(&self) -> Value {
        instance(&self.cell, self.node).snapshot()
    }

    /// The node at its start.
    pub fn fresh(&self) -> Box<dyn Instance> {
        instance(&self.cell, self.node)
    }

    /// `node` with that state continues from step `cut` for `count` steps; gives the first one that leaves anything else
    /// than it did.
    pub fn first_difference(
        &self,
        node: &mut dyn Instance,
        cut: usize,
        count: usize,
        snapshot: Value,
    ) -> Option<usize> {
        node.restore(snapshot)
            .unwrap_or_else(|error| panic!("{}: {error}", self.node));
        let mut steps = self
            .steps
            .iter()
            .zip(&self.given)
            .enumerate()
            .skip(cut)
            .take(count);
        steps.find_map(|(index, ((now, cause), given))| {
            (take(node, *now, cause) != *given).then_some(index)
        })
    }
}

/// One step.
pub fn take(node: &mut dyn Instance, now: Stamp, cause: &Cause) -> Emitted {
    match cause {
        Cause::Timer(id) => node.timer(now, *id),
        Cause::Message(port, payload) => node
            .deliver(now, *port, payload)
            .unwrap_or_else(|error| panic!("{}: {error}", node.name())),
    }
}
