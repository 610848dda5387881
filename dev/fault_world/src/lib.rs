//! Whole cells on virtual time under faults of all kinds, from one seed.
//!
//! [`of_seed`] draws a list of [`Fault`]s: messages late, lost and twice, processes killed, paused and started again with
//! empty memory or at first some seconds after the others, a machine that takes its time to stop, a recorder that stops, wall clocks that are set, operators who stop, reject, disagree and click twice,
//! strangers who forge. [`run`] puts the real nodes of the default cell and its simulated machine through it and checks
//! every [`Invariant`] at every step; then everything is in order again, every part must have its report, a further part
//! must be made, and a replay of what was recorded must equal it or say truthfully that it is incomplete. A run is a
//! function of its seed and its list. [`shortened`] drops faults from the list of a failure while it still fails.

mod altered;
mod check;
mod fault;
mod gate;
mod operators;
mod recorder;
mod settings;
mod shrink;
mod traffic;
mod world;

pub use altered::{Alteration, altered};
pub use check::{Count, Invariant, Violation};
pub use fault::{Fault, Forgery, Kind, Mood, Route, of_seed, routes};
pub use gate::{Bounds, DEEP, Found, SEARCHES, Search};
pub use shrink::shortened;
pub use world::{Outcome, StandIn, run};

use cell::Cell;
use settings::{STOPS, default_cell};

/// The cells of the runs, and the routes of their messages.
pub struct Cells {
    by_policy: Vec<Cell>,
    by_operators: Vec<Cell>,
    routes: Vec<Route>,
}

impl Default for Cells {
    fn default() -> Self {
        let cells = |automatic| STOPS.map(|stop| default_cell(automatic, stop)).to_vec();
        let by_policy = cells(true);
        Self {
            routes: routes(&by_policy[0]),
            by_operators: cells(false),
            by_policy,
        }
    }
}

impl Cells {
    /// The cell of a seed: of three seeds, two have their corrections approved by operators; of twelve, three have a machine that
    /// stands at once when it is told to stop.
    pub fn of(&self, seed: u64) -> &Cell {
        let cells = if seed.is_multiple_of(3) {
            &self.by_policy
        } else {
            &self.by_operators
        };
        &cells[(seed / 3) as usize % cells.len()]
    }

    /// The faults of a seed.
    pub fn faults(&self, seed: u64) -> Vec<Fault> {
        of_seed(seed, &self.routes)
    }

    /// The run of a seed.
    pub fn run(&self, seed: u64) -> Outcome {
        run(self.of(seed), seed, &self.faults(seed), None)
    }
}
