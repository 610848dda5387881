//! Every order of events about two corrections: the real nodes `compensation`, `machine_state` and `cycle`, two operators
//! who may contradict each other, and messages that are late, lost or twice, from the instant at which both corrections
//! have been proposed.
//!
//! A breadth-first search of our own, so that a counterexample is as short as it can be. States are made canonical: the
//! states of nodes and the payloads of messages are stored once and named by numbers, and instants depend on what has
//! happened from outside, not on the order in which messages arrived (`steps::now`). A step of a node on the same state,
//! input and instant is computed once. `stateright` 0.31 would search in the same way; the model, which is all of this
//! module, would be the same, and it would bring twelve packages for the loop in [`Search::run`].

mod check;
mod searches;
mod state;
mod steps;
mod store;

use std::{
    collections::{HashSet, VecDeque},
    fmt,
};

use cell::Cell;
use cell_tests::{instance, session::Session};
use graph::{Instance, Stamp, topics};
use probecell_msgs::{ControllerStatus, Correction};

pub use searches::{DEEP, SEARCHES};

use crate::world::StandIn;
use state::{Event, State};
use store::Store;

/// The nodes of the search.
const NODES: [&str; 3] = ["compensation", "machine_state", "cycle"];
const GATE: u8 = 1;
const CYCLE: u8 = 2;
/// ns of a period of time; three of them without a word are more than `machine_state.part_limit_s`.
const PERIOD: i64 = 1_300_000_000;

/// How much may happen in one order of events, beyond each message arriving at any time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Bounds {
    /// Answers: each of two operators may approve or reject each of the two corrections, once.
    pub answers: u8,
    /// The key of one of the operators is withdrawn.
    pub withdrawals: u8,
    /// STOP of an operator.
    pub stops: u8,
    /// Messages that are lost, for good or until all others have overtaken them.
    pub losses: u8,
    /// Messages that come twice, the second time at any time later.
    pub repeats: u8,
    /// Processes started again with empty memory: one of the three nodes, or the driver.
    pub restarts: u8,
    /// What a stranger puts on the bus: corrections unsigned, out of bounds, without source, of another session, signed
    /// with a withdrawn key, and approvals without a signature.
    pub forgeries: u8,
    /// Periods of 1.3 s that pass.
    pub periods: u8,
}

/// What a search has found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// Different states.
    pub states: usize,
    /// There are no others within the bounds.
    pub exhausted: bool,
    /// Steps from one to another.
    pub steps: usize,
    /// Corrections written, over all steps.
    pub writes: usize,
    /// The events that lead to what must not be, and what that is.
    pub violation: Option<(Vec<String>, String)>,
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let which = if self.exhausted { "all" } else { "the nearest" };
        let (states, steps, writes) = (self.states, self.steps, self.writes);
        write!(f, "{which} {states} states, {steps} steps, {writes} writes")
    }
}

/// The instant at which both corrections of a measurement have been proposed, and the nodes.
pub struct Search {
    proposed: Vec<Correction>,
    sample: ControllerStatus,
    begin: Stamp,
    first: State,
    /// One instance of each node makes all steps; and the number of the state in which each starts.
    workers: Vec<Box<dyn Instance>>,
    fresh: Vec<u32>,
    store: Store,
}

impl Search {
    /// The part `punch` of a cell whose corrections operators approve, its first measurement decided on. `stand_in` puts
    /// other nodes in the place of the real ones, in a proof that the search bites.
    pub fn new(cell: &Cell, stand_in: Option<StandIn>) -> Self {
        let mut session = Session::new(cell);
        session.ask_for("punch");
        session.run_to(topics::PASS_DECISIONS);
        session.run_s(0.3);
        let proposed: Vec<Correction> = session.all(topics::CORRECTIONS);
        assert_eq!(proposed.len(), 2, "two corrections of one measurement");
        let stand_in = stand_in.unwrap_or(|node| node);
        let mut workers = NODES.map(|name| stand_in(instance(cell, name)));
        let mut store = Store::default();
        let fresh = (workers.iter())
            .map(|node| store.snapshot(&node.snapshot()))
            .collect();
        let snapshots = std::array::from_fn(|index| {
            let node = &mut workers[index];
            let restored = node.restore(session.snapshot(NODES[index]));
            restored.unwrap_or_else(|error| panic!("{error}"));
            store.snapshot(&node.snapshot())
        });
        Self {
            sample: session.last(topics::CONTROLLER_STATUS),
            begin: session.now(),
            first: State::new(snapshots, &session, &mut store),
            proposed,
            workers: workers.into(),
            fresh,
            store,
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
        let mut origins: Vec<(u32, Option<Event>)> = vec![(0, None)];
        let mut front = VecDeque::from([(0_u32, first)]);
        while let Some((index, state)) = front.pop_front() {
            for event in state.events() {
                let mut next = state.clone();
                let wrong = self.happen(&mut next, event, &mut found.writes);
                found.steps += 1;
                if let Some(why) = wrong {
                    found.states = known.len();
                    found.violation = Some((history(&origins, index, event), why));
                    return found;
                }
                if known.len() < limit && known.insert(next.key()) {
                    let number = u32::try_from(origins.len()).unwrap_or(u32::MAX);
                    origins.push((index, Some(event)));
                    front.push_back((number, next));
                }
            }
        }
        found.states = known.len();
        found.exhausted = known.len() < limit;
        found
    }
}

/// The events that lead to a state, and one more.
fn history(origins: &[(u32, Option<Event>)], index: u32, last: Event) -> Vec<String> {
    let mut events = vec![last.to_string()];
    let mut at = index;
    while let (before, Some(event)) = origins[at as usize] {
        events.push(event.to_string());
        at = before;
    }
    events.reverse();
    events
}
