//! Decides a short path for more points than can be solved exactly: iterated local search.
//!
//! Moves: Or-opt (segments up to three points, both directions), 2-opt, and exchange of two neighbouring segments
//! (Or-3opt), each proposed by a short list of near neighbours and driven by a work queue. Kicks are double bridges
//! confined to a short stretch; a kicked path is accepted like in annealing. Costs are integers, so sums are exact and
//! comparisons need no tolerance; a free end is a dummy point without costs.

mod grid;
mod path;

use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};

use crate::problem::Problem;
use crate::solve::{Options, Progress};
use grid::Grid;
use path::Path;

/// Temperature of the acceptance at the first kick, in mean moves of the locally shortest path; falls to zero.
const WARMTH: f64 = 0.1;

/// Longest stretch of each segment that a kick exchanges.
const KICK_SPAN: usize = 50;

/// Nearest-neighbour paths tried as a beginning; each costs O(n²).
const BEGINNINGS: usize = 32;

/// Searches until the budget ends or the caller stops; returns the best order and the kicks made.
pub(crate) fn run(
    problem: &Problem,
    given: &[usize],
    options: &Options,
    keep_going: &mut dyn FnMut(&Progress) -> bool,
) -> (Vec<usize>, u64) {
    let grid = Grid::new(&problem.costs, problem.start, problem.end);
    let given_cost = problem.costs.path_cost(given);
    let beginning = beginning(&grid, given);
    let mut path = Path::new(&grid, beginning);
    path.improve_all();

    let mut best = path.order().to_vec();
    let mut best_length = path.length();
    let mut here = best_length;
    let mut order = grid.strip(&best);
    let mut cost = problem.costs.path_cost(&order);
    let mut rng = Pcg32::seed_from_u64(options.seed);
    let warmth = WARMTH * best_length as f64 / best.len() as f64;
    let every = options.report_every.max(1);
    let mut reported = best_length;
    let mut kicks = 0;
    loop {
        if kicks % every == 0 {
            if best_length < reported {
                reported = best_length;
                order = grid.strip(&best);
                cost = problem.costs.path_cost(&order);
            }
            let (order, cost) = if cost <= given_cost {
                (&order[..], cost)
            } else {
                (given, given_cost)
            };
            if !keep_going(&Progress {
                kicks,
                order,
                cost,
                given_cost,
            }) {
                break;
            }
        }
        if kicks >= options.kicks || !path.can_be_kicked() {
            break;
        }
        kicks += 1;
        path.mark();
        path.kick(&mut rng, KICK_SPAN);
        path.improve_queue();
        let length = path.length();
        let left = 1.0 - kicks as f64 / options.kicks as f64;
        let luck = (f64::from(rng.next_u32()) + 1.0) / 4_294_967_297.0;
        if ((length - here) as f64) <= -luck.ln() * warmth * left {
            here = length;
            if length < best_length {
                best_length = length;
                best.copy_from_slice(path.order());
            }
        } else {
            path.revert();
        }
    }
    (grid.strip(&best), kicks)
}

/// The shortest of the given order and nearest-neighbour paths from spread starts; ties go to the earlier one.
fn beginning(grid: &Grid, given: &[usize]) -> Vec<u32> {
    let mut best = grid.dress(given);
    let mut best_length = grid.length(&best);
    let starts = grid.first_choices();
    let step = starts.len().div_ceil(BEGINNINGS).max(1);
    for &start in starts.iter().step_by(step) {
        let path = nearest_neighbour(grid, start);
        let length = grid.length(&path);
        if length < best_length {
            (best, best_length) = (path, length);
        }
    }
    best
}

/// Goes to the nearest unvisited point, lowest index among equals, and ends at the fixed end.
fn nearest_neighbour(grid: &Grid, start: u32) -> Vec<u32> {
    let mut path = grid.opening(start);
    let mut rest: Vec<u32> = (0..grid.points() as u32)
        .filter(|&i| !path.contains(&i) && i != grid.last())
        .collect();
    while !rest.is_empty() {
        let here = path[path.len() - 1];
        let (at, _) = rest
            .iter()
            .enumerate()
            .map(|(at, &next)| (at, grid.cost(here, next)))
            .fold((0, i64::MAX), |best, candidate| {
                if candidate.1 < best.1 {
                    candidate
                } else {
                    best
                }
            });
        path.push(rest.remove(at));
    }
    path.push(grid.last());
    path
}
