//! Decides which search answers a problem, and that its answer is never longer than the order given; at once, or in slices.

use serde::{Deserialize, Serialize};

use crate::exact::{EXACT_LIMIT, shortest_path};
use crate::options::{Options, Progress};
use crate::problem::{Checked, Problem, ProblemError};
use crate::search::{self, Checkpoint};

/// Most poses (poses of all points) for which the exact table is kept.
const EXACT_PLACES: usize = 100;

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Solution {
    /// Poses in measuring order, one of each point.
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
    if !is_small(&checked) {
        let checkpoint = search::run(&checked, options, None, options.kicks, keep_going);
        return Ok(answer(&checked, &checkpoint.order, checkpoint.kicks));
    }
    let solution = exact(&checked);
    keep_going(&Progress {
        kicks: 0,
        order: &solution.order,
        cost: solution.cost,
        given_cost: solution.given_cost,
    });
    Ok(solution)
}

/// A search that can be suspended between two kicks, serialised and resumed. Slicing changes nothing: it makes the kicks
/// that [`solve`] makes and gives its answer. Each slice begins by computing the neighbour lists again, O(n²) for n poses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Search {
    problem: Problem,
    options: Options,
    solution: Solution,
    /// `None`: the answer is exact.
    checkpoint: Option<Checkpoint>,
}

impl Search {
    /// Makes the path that the search begins with, already improved; the whole answer for few points.
    ///
    /// # Errors
    /// [`ProblemError`] when the problem contradicts itself.
    pub fn new(problem: Problem, options: &Options) -> Result<Self, ProblemError> {
        let checked = Checked::new(&problem)?;
        let (solution, checkpoint) = if is_small(&checked) {
            (exact(&checked), None)
        } else {
            let checkpoint = search::run(&checked, options, None, 0, &mut |_| true);
            (answer(&checked, &checkpoint.order, 0), Some(checkpoint))
        };
        Ok(Self {
            options: options.clone(),
            problem,
            solution,
            checkpoint,
        })
    }

    /// Makes `kicks` more kicks, or the rest of the budget; true when the search is done.
    ///
    /// # Errors
    /// [`ProblemError`] when what was read back holds another problem than was written away.
    pub fn advance(&mut self, kicks: u64) -> Result<bool, ProblemError> {
        if self.is_done() {
            return Ok(true);
        }
        if let Some(checkpoint) = self.checkpoint.take() {
            let checked = Checked::new(&self.problem)?;
            let until = checkpoint
                .kicks
                .saturating_add(kicks)
                .min(self.options.kicks);
            let keep_going = &mut |_: &Progress| true;
            let checkpoint =
                search::run(&checked, &self.options, Some(checkpoint), until, keep_going);
            self.solution = answer(&checked, &checkpoint.order, checkpoint.kicks);
            self.checkpoint = Some(checkpoint);
        }
        Ok(self.is_done())
    }

    /// True when more kicks would change nothing.
    pub fn is_done(&self) -> bool {
        let done =
            |checkpoint: &Checkpoint| checkpoint.over || checkpoint.kicks >= self.options.kicks;
        self.checkpoint.as_ref().is_none_or(done)
    }

    /// How much of the search is done, from 0 to 1.
    pub fn share(&self) -> f64 {
        if self.is_done() {
            return 1.0;
        }
        self.solution.kicks as f64 / self.options.kicks as f64
    }

    /// The answer so far; never longer than the order given.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }
}

/// True when the answer can be proven shortest.
fn is_small(problem: &Checked) -> bool {
    problem.poses_of.len() <= EXACT_LIMIT && problem.point_of.len() <= EXACT_PLACES
}

fn exact(problem: &Checked) -> Solution {
    let order = shortest_path(problem);
    let (cost, given_cost) = (
        problem.costs.path_cost(&order),
        problem.costs.path_cost(&problem.given),
    );
    // Sums of one path read in two directions may differ in the last bit.
    let (order, cost) = if cost > given_cost {
        (problem.given.clone(), given_cost)
    } else {
        (order, cost)
    };
    Solution {
        order,
        cost,
        given: problem.given.clone(),
        given_cost,
        optimal: true,
        kicks: 0,
    }
}

/// What was searched, or the order given where that is not longer.
fn answer(problem: &Checked, order: &[usize], kicks: u64) -> Solution {
    let (cost, given_cost) = (
        problem.costs.path_cost(order),
        problem.costs.path_cost(&problem.given),
    );
    let (order, cost) = if cost >= given_cost {
        (&problem.given[..], given_cost)
    } else {
        (order, cost)
    };
    Solution {
        order: order.to_vec(),
        cost,
        given: problem.given.clone(),
        given_cost,
        optimal: false,
        kicks,
    }
}
