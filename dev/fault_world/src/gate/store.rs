//! What the states of a search have in common, stored once: payloads, states of nodes, and the steps made so far.

use std::{collections::HashMap, rc::Rc};

use serde_json::Value;

/// What a node is given in a step.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Given {
    /// Number of the port, and of the payload.
    Message(usize, u32),
    /// Number of the timer.
    Timer(u32),
}

/// A step of a node: which, the number of its state, the instant in ns, and what it is given.
pub(super) type Step = (u8, u32, i64, Given);

/// What a step has made: the number of the next state, and messages by port and number of the payload.
pub(super) struct Made {
    pub(super) snapshot: u32,
    pub(super) messages: Vec<(usize, u32)>,
}

/// Payloads and states by number, and the steps that were made.
#[derive(Default)]
pub(super) struct Store {
    payloads: Numbered,
    snapshots: Numbered,
    pub(super) made: HashMap<Step, Rc<Made>>,
}

/// Byte strings, each with a number.
#[derive(Default)]
struct Numbered {
    all: Vec<Rc<[u8]>>,
    numbers: HashMap<Rc<[u8]>, u32>,
}

impl Numbered {
    fn number(&mut self, bytes: &[u8]) -> u32 {
        if let Some(number) = self.numbers.get(bytes) {
            return *number;
        }
        let number = u32::try_from(self.all.len()).unwrap_or(u32::MAX);
        let bytes: Rc<[u8]> = bytes.into();
        self.all.push(Rc::clone(&bytes));
        self.numbers.insert(bytes, number);
        number
    }
}

impl Store {
    /// Number of a payload.
    pub(super) fn payload(&mut self, payload: &[u8]) -> u32 {
        self.payloads.number(payload)
    }

    /// The payload of a number.
    pub(super) fn bytes(&self, payload: u32) -> Rc<[u8]> {
        Rc::clone(&self.payloads.all[payload as usize])
    }

    /// Number of the state of a node. A map of JSON is ordered by its keys, so equal states are equal bytes.
    pub(super) fn snapshot(&mut self, snapshot: &Value) -> u32 {
        self.snapshots.number(snapshot.to_string().as_bytes())
    }

    /// The state of a number.
    pub(super) fn value(&self, snapshot: u32) -> Value {
        let bytes = &self.snapshots.all[snapshot as usize];
        serde_json::from_slice(bytes).unwrap_or_else(|error| panic!("{error}"))
    }
}
