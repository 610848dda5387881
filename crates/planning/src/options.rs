//! What a search is given, and what it reports while it runs.

use serde::{Deserialize, Serialize};

/// How long to search, and with which random numbers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// Seed of the kicks. The same seed and budget give the same path.
    pub seed: u64,
    /// Kicks (local restarts of the search) after which the search ends by itself.
    pub kicks: u64,
    /// Kicks between two calls of the progress closure; zero counts as one.
    pub report_every: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            kicks: 200_000,
            report_every: 1_000,
        }
    }
}

/// The best path so far, as passed to the progress closure. Its order is complete and keeps every constraint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress<'a> {
    /// Kicks made.
    pub kicks: u64,
    /// Best order so far.
    pub order: &'a [usize],
    /// Its cost, in the unit of the table.
    pub cost: f64,
    /// Cost of the order given.
    pub given_cost: f64,
}
