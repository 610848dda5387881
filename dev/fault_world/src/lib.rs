//! Whole cells on virtual time under faults of all kinds, from one seed.
//!
//! [`of_seed`] draws a list of [`Fault`]s: messages late, lost and twice, processes killed, paused and started again with
//! empty memory, a recorder that stops, wall clocks that are set, operators who stop, reject, disagree and click twice,
//! strangers who forge. [`run`] puts the real nodes of the default cell and its simulated machine through it and checks
//! every [`Invariant`] at every step; then everything is in order again, every part must have its report, a further part
//! must be made, and a replay of what was recorded must equal it or say truthfully that it is incomplete. A run is a
//! function of its seed and its list. [`shortened`] drops faults from the list of a failure while it still fails.

mod check;
mod fault;
mod gate;
mod operators;
mod recorder;
mod settings;
mod shrink;
mod traffic;
mod world;

pub use check::{Count, Invariant, Violation};
pub use fault::{Fault, Forgery, Kind, Mood, Way, of_seed, ways};
pub use gate::{Bounds, DEEP, Found, SEARCHES, Search};
pub use shrink::shortened;
pub use world::{Outcome, StandIn, run};

use cell::Cell;
use settings::default_cell;

/// The cells of the runs, and the ways of their messages.
pub struct Cells {
    by_policy: Cell,
    by_operators: Cell,
    ways: Vec<Way>,
}

impl Default for Cells {
    fn default() -> Self {
        let by_policy = default_cell(true);
        Self {
            ways: ways(&by_policy),
            by_operators: default_cell(false),
            by_policy,
        }
    }
}

impl Cells {
    /// The cell of a seed: of three seeds, two have their corrections approved by operators.
    pub fn of(&self, seed: u64) -> &Cell {
        if seed.is_multiple_of(3) {
            &self.by_policy
        } else {
            &self.by_operators
        }
    }

    /// The faults of a seed.
    pub fn faults(&self, seed: u64) -> Vec<Fault> {
        of_seed(seed, &self.ways)
    }

    /// The run of a seed.
    pub fn run(&self, seed: u64) -> Outcome {
        run(self.of(seed), seed, &self.faults(seed), None)
    }
}
