//! Every order of events about two corrections: the real nodes `compensation`, `machine_state` and `cycle`, two operators,
//! and messages that are late, lost or twice, from the instant at which both corrections have been proposed.
//!
//! A breadth-first search of our own: a state is the serialised state of the three nodes, of the machine and of all ways of
//! messages, and is visited once. `stateright` would search in the same way, but asks for `Eq`, `Hash` and `Clone` of the
//! whole state, which holds floats: it would be keyed by the same bytes, at the price of twelve packages.

mod check;
mod state;
mod steps;

use std::{
    collections::{HashSet, VecDeque},
    rc::Rc,
};

use cell::Cell;
use cell_tests::{instance, session::Session};
use graph::{Instance, Stamp, topics};
use probecell_msgs::{ControllerStatus, Correction};
use serde_json::Value;

use state::{Event, State};

/// The nodes of the search.
const NODES: [&str; 3] = ["compensation", "machine_state", "cycle"];
const GATE: usize = 1;
/// ns of a period of time; three of them without a word are more than `machine_state.part_limit_s`.
const PERIOD: i64 = 1_300_000_000;

/// How much may happen in one order of events, beyond each message arriving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Bounds {
    /// Answers: one operator may approve or reject the first correction, another one the second.
    pub answers: u8,
    /// STOP of an operator.
    pub stops: u8,
    /// Messages lost.
    pub losses: u8,
    /// Messages that come twice.
    pub repeats: u8,
    /// Processes started again with empty memory: one of the three nodes, or the driver.
    pub restarts: u8,
    /// Corrections that a stranger puts on the bus: unsigned, out of bounds, without source, of another session.
    pub forgeries: u8,
    /// Periods of 1.3 s that pass.
    pub periods: u8,
}

/// What a search has found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// Different states.
    pub states: usize,
    /// Steps from one to another.
    pub steps: usize,
    /// Corrections written, over all steps.
    pub writes: usize,
    /// The events that lead to a write that must not be, and why it must not.
    pub violation: Option<(Vec<String>, String)>,
}

/// Changes the state of the gate after each of its steps, in a proof that the search bites.
pub type Tamper = fn(&mut Value);

/// The instant at which both corrections of a measurement have been proposed, and the nodes.
pub struct Search {
    proposed: Vec<Correction>,
    sample: ControllerStatus,
    begin: Stamp,
    first: State,
    /// One instance of each node makes all steps; and the state in which each starts.
    workers: Vec<Box<dyn Instance>>,
    fresh: Vec<Rc<Value>>,
    tamper: Option<Tamper>,
}

impl Search {
    /// The part `punch` of a cell whose corrections operators approve, its first measurement decided on.
    pub fn new(cell: &Cell, tamper: Option<Tamper>) -> Self {
        let mut session = Session::new(cell);
        session.ask_for("punch");
        session.run_to(topics::PASS_DECISIONS);
        session.run_s(0.3);
        let proposed: Vec<Correction> = session.all(topics::CORRECTIONS);
        assert_eq!(proposed.len(), 2, "two corrections of one measurement");
        let workers: Vec<_> = NODES.iter().map(|name| instance(cell, name)).collect();
        let fresh = workers
            .iter()
            .map(|node| Rc::new(node.snapshot()))
            .collect();
        let snapshots = NODES.map(|name| session.snapshot(name));
        Self {
            sample: session.last(topics::CONTROLLER_STATUS),
            begin: session.now(),
            first: State::new(snapshots, &session),
            proposed,
            workers,
            fresh,
            tamper,
        }
    }

    /// Visits every state that can be reached within the bounds, the nearest first, up to `limit` of them.
    pub fn run(&mut self, bounds: Bounds, limit: usize) -> Found {
        let mut found = Found::default();
        let first = State {
            left: bounds,
            ..self.first.clone()
        };
        let mut known: HashSet<u128> = HashSet::from([first.key()]);
        // Of each state found: where it came from, and by which event.
        let mut origins: Vec<(usize, Option<Event>)> = vec![(0, None)];
        let mut front = VecDeque::from([(0, first)]);
        while let Some((index, state)) = front.pop_front() {
            for event in state.events() {
                let mut next = state.clone();
                let wrong = self.happen(&mut next, event, &mut found.writes);
                found.steps += 1;
                if let Some(why) = wrong {
                    let mut events = vec![event.to_string()];
                    let mut at = index;
                    while let (before, Some(event)) = origins[at] {
                        events.push(event.to_string());
                        at = before;
                    }
                    events.reverse();
                    found.states = known.len();
                    found.violation = Some((events, why));
                    return found;
                }
                if known.len() < limit && known.insert(next.key()) {
                    origins.push((index, Some(event)));
                    front.push_back((origins.len() - 1, next));
                }
            }
        }
        found.states = known.len();
        found
    }
}
