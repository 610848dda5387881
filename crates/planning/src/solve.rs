//! Decides which search answers a problem, and that its answer is never longer than the order given.

use serde::{Deserialize, Serialize};

use crate::exact::{EXACT_LIMIT, shortest_path};
use crate::problem::{Checked, Problem, ProblemError};
use crate::search;

/// Most places (poses of all points) for which the exact table is kept.
const EXACT_PLACES: usize = 100;

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

/// The best path so far, told to the progress closure. Its order is complete and keeps every constraint.
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

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Solution {
    /// Places in measuring order, one of each point.
    pub order: Vec<usize>,
    /// Its cost, summed from the table along the order.
    pub cost: f64,
    /// The order it was compared with.
    pub given: Vec<usize>,
    /// Cost of that order; never less than `cost`.
    pub given_cost: f64,
    /// True when the order is proven shortest.
    pub optimal: bool,
    /// Kicks made.
    pub kicks: u64,
}

/// Searches a short open path. `keep_going` is called with the best path so far, at least once, and ends the search
/// by returning `false`; this is where a caller looks at its clock or streams the plan.
///
/// # Errors
/// [`ProblemError`] when the problem contradicts itself.
pub fn solve(
    problem: &Problem,
    options: &Options,
    keep_going: &mut dyn FnMut(&Progress) -> bool,
) -> Result<Solution, ProblemError> {
    let checked = Checked::new(problem)?;
    let given_cost = problem.costs.path_cost(&checked.given);
    let small = checked.places_of.len() <= EXACT_LIMIT && checked.point_of.len() <= EXACT_PLACES;
    let (mut order, kicks) = if small {
        (shortest_path(&checked), 0)
    } else {
        search::run(&checked, options, keep_going)
    };
    let mut cost = problem.costs.path_cost(&order);
    // Sums of one path read in two directions may differ in the last bit.
    if cost > given_cost || cost == given_cost && !small {
        (order, cost) = (checked.given.clone(), given_cost);
    }
    if small {
        keep_going(&Progress {
            kicks,
            order: &order,
            cost,
            given_cost,
        });
    }
    Ok(Solution {
        order,
        cost,
        given: checked.given,
        given_cost,
        optimal: small,
        kicks,
    })
}
