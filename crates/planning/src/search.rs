//! Iterated local search, for problems too large for the exact solution.
//!
//! A symmetric problem without rules is a ring, improved by exchanges of edges ([`tour`]); points may have alternative
//! poses there. Everything else is a path with a direction ([`directed`]): Or-opt, 2-opt, and exchange of
//! neighbouring stretches. Moves are proposed by a short list of near neighbours and driven by a work queue. Kicks are
//! double bridges confined to a short stretch; a kicked path is accepted like in annealing. A large ring without alternatives
//! is improved by longer sequences of exchanges ([`lin_kernighan`]) and searched in walks: each begins with the shortest ring,
//! shaken, and ends when it has not become shorter for long. Costs are integers, so sums are exact and comparisons need no tolerance;
//! a free end is a dummy point without costs. Between two kicks a search is a [`Checkpoint`], from which it can be resumed with the result of one run.

mod alpha_nearness;
mod bridges;
mod choice;
mod construction;
mod directed;
mod exchange;
mod integer_costs;
mod lin_kernighan;
mod neighbours;
mod ring;
mod tour;

use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};

use serde::{Deserialize, Serialize};

use crate::options::{Options, Progress};
use crate::problem::Checked;
use choice::{Chosen, Plain};
use directed::Directed;
use integer_costs::{IntegerCosts, NeighbourLists};
use tour::Tour;

/// Kicks per point in the first cycle of cooling.
const CYCLE: u64 = 10;

/// More points than this begin with a cold cycle: a search stopped in it has no time to make good what it accepts.
const LARGE: usize = 3000;

/// A walk ends when it has not become shorter within so many kicks per point, and at least so many kicks.
const PATIENCE: u64 = 1;
const MIN_PATIENCE: u64 = 1000;

/// Points visited by all further beginnings of a search among clusters, and most beginnings.
const BEGINNINGS: usize = 50_000;
const MAX_BEGINNINGS: usize = 50;

/// By how much of its length one beginning must be shorter than the first, so that it is more than luck in details.
const CLEARLY: f64 = 0.01;

/// Fewer points with alternatives than this are no ring to exchange stretches of.
const RING: usize = 8;

/// A path between two kicks, in the numbers of the grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Path {
    /// Points of a ring as they lie in memory, or poses of a path with a direction.
    order: Vec<u32>,
    /// The pose of each point of a ring with alternatives.
    poses: Vec<u32>,
    /// Where a large ring is kicked next, and how often it was kicked there.
    window: (usize, usize),
}

/// A search between two kicks: with the problem, all that is needed to resume it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Checkpoint {
    /// The order of poses by which the grid numbers them.
    beginning: Vec<usize>,
    path: Path,
    /// Length of that path.
    here: i64,
    /// The shortest order so far.
    pub(crate) order: Vec<usize>,
    shortest: i64,
    mean_move: f64,
    cycle: Cycle,
    walk: Walk,
    rng: Pcg32,
    /// Kicks made.
    pub(crate) kicks: u64,
    /// Nothing is left to be kicked, or the caller has ended the search.
    pub(crate) over: bool,
}

/// A path that can be kicked, improved and brought back.
trait Kicked {
    /// Writes the poses, as a path or a ring.
    fn write(&self, order: &mut Vec<u32>);
    /// The path between two kicks.
    fn suspend(&self) -> Path;
    /// Becomes a path that was suspended, of this length.
    fn resume(&mut self, path: &Path, length: i64);
    fn length(&self) -> i64;
    fn can_be_kicked(&self) -> bool;
    fn improve_all(&mut self);
    /// Remembers the path, exchanges a few neighbouring stretches at random, and improves what changed.
    fn kick(&mut self, rng: &mut Pcg32);
    /// Brings back the path as it was before the kick.
    fn revert(&mut self);
    /// How the acceptance of kicked paths cools down.
    fn cooling(&self) -> Cooling;
    /// Begins a walk from a ring of this length: many kicks, then what changed is improved; for searches in walks.
    fn restart(&mut self, _shortest: &[u32], _length: i64, _rng: &mut Pcg32) {}
}

/// The temperature of the acceptance, in mean moves.
#[derive(Clone, Copy)]
enum Cooling {
    /// Falls in cycles, from the beginning to the end of each.
    Cycles { hot: f64, cold: f64 },
    /// Falls with a power of the kicks per point, one added, so that the search may be stopped at any time.
    Steady { hot: f64, power: f64 },
    /// None: a path is accepted that is longer than the shortest of its walk by no more than this (record-to-record travel,
    /// Dueck 1993). A walk that has not become shorter for long ends, and the next begins with the shortest path, shaken.
    Record { slack: f64 },
}

/// Begins a search, or resumes a suspended one, until `until` kicks are made or the caller stops it.
pub(crate) fn run(
    problem: &Checked,
    options: &Options,
    taken: Option<Checkpoint>,
    until: u64,
    keep_going: &mut dyn FnMut(&Progress) -> bool,
) -> Checkpoint {
    let mut reporter = Reporter::new(problem, keep_going);
    let fresh = taken.is_none();
    let begun = taken
        .as_ref()
        .map(|checkpoint| checkpoint.beginning.clone());
    let nearest = || construction::by_nearest(problem);
    if problem.costs.is_symmetric() && problem.is_plain() {
        let scale = integer_costs::scale(problem.costs);
        let near = neighbours::select_all(problem.costs, scale);
        let bridges = bridges::between_clusters(problem.costs, scale, &near);
        let beginning = begun.unwrap_or_else(|| construction::by_cheapest(problem, &near));
        let grid = IntegerCosts::new(
            problem,
            &beginning,
            NeighbourLists::Promising(&near, &bridges),
        );
        let mut tour = Tour::new(Plain::new(&grid));
        if fresh && !bridges.is_empty() {
            tour = shortest_of_many(problem, &near, &grid, tour, options.seed);
        }
        let checkpoint = checkpoint(&mut tour, &grid, taken, beginning, options.seed);
        iterate(tour, &grid, checkpoint, until, options, &mut reporter)
    } else if problem.costs.is_symmetric() && problem.is_free() && problem.poses_of.len() >= RING {
        let beginning = begun.unwrap_or_else(nearest);
        let grid = IntegerCosts::new(problem, &beginning, NeighbourLists::Points);
        let mut tour = Tour::new(Chosen::new(&grid));
        let checkpoint = checkpoint(&mut tour, &grid, taken, beginning, options.seed);
        iterate(tour, &grid, checkpoint, until, options, &mut reporter)
    } else {
        let beginning = begun.unwrap_or_else(nearest);
        let grid = IntegerCosts::new(problem, &beginning, NeighbourLists::Poses);
        let mut path = Directed::new(&grid, (0..grid.points() as u32).collect());
        let checkpoint = checkpoint(&mut path, &grid, taken, beginning, options.seed);
        iterate(path, &grid, checkpoint, until, options, &mut reporter)
    }
}

/// Resumes the path of a suspended search, or improves the one that a new search begins with.
fn checkpoint(
    path: &mut impl Kicked,
    grid: &IntegerCosts,
    taken: Option<Checkpoint>,
    beginning: Vec<usize>,
    seed: u64,
) -> Checkpoint {
    if let Some(checkpoint) = taken {
        path.resume(&checkpoint.path, checkpoint.here);
        return checkpoint;
    }
    path.improve_all();
    let mut order = Vec::new();
    path.write(&mut order);
    let length = path.length();
    Checkpoint {
        beginning,
        path: path.suspend(),
        here: length,
        shortest: length,
        mean_move: length as f64 / order.len() as f64,
        cycle: Cycle {
            begun: 0,
            length: CYCLE * order.len() as u64,
            cold_first: order.len() > LARGE,
        },
        walk: Walk {
            shortest: length,
            since: 0,
        },
        order: grid.strip(&order),
        rng: Pcg32::seed_from_u64(seed),
        kicks: 0,
        over: false,
    }
}

/// In which order far clusters are visited is hardly changed by kicks, so of several beginnings the shortest is taken,
/// when it is clearly shorter once improved.
fn shortest_of_many<'a>(
    problem: &Checked,
    near: &neighbours::Near,
    grid: &'a IntegerCosts,
    mut tour: Tour<Plain<'a>>,
    seed: u64,
) -> Tour<Plain<'a>> {
    let mut rng = Pcg32::seed_from_u64(seed);
    tour.improve_all();
    let clearly = tour.length() - (CLEARLY * tour.length() as f64) as i64;
    for _ in 0..(BEGINNINGS / near.len()).clamp(1, MAX_BEGINNINGS) {
        let order = construction::by_nearly_cheapest(problem, near, &mut rng);
        let mut other = Tour::along(Plain::new(grid), &grid.path(&order));
        other.improve_all();
        if other.length() < clearly.min(tour.length()) {
            tour = other;
        }
    }
    tour
}

/// A stretch of the search in which the acceptance cools down. Each is twice as long as the one before, so that a
/// search stopped at any time has just spent a good part of it cooling.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Cycle {
    begun: u64,
    length: u64,
    cold_first: bool,
}

/// The shortest path of the present walk, and how many kicks ago it was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Walk {
    shortest: i64,
    since: u64,
}

impl Cycle {
    /// How much of the cycle has passed, from 0 to 1; all of it where the cycle is cold.
    fn part(&mut self, kicks: u64) -> f64 {
        if kicks >= self.begun + self.length {
            self.begun += self.length;
            self.length *= 2;
        }
        if self.cold_first && self.begun == 0 {
            1.0
        } else {
            (kicks - self.begun) as f64 / self.length as f64
        }
    }
}

/// Reports the best path so far to the caller, in the caller's unit.
struct Reporter<'a> {
    problem: &'a Checked<'a>,
    given_cost: f64,
    keep_going: &'a mut dyn FnMut(&Progress) -> bool,
    reported: i64,
    order: Vec<usize>,
    cost: f64,
}

impl<'a> Reporter<'a> {
    fn new(problem: &'a Checked<'a>, keep_going: &'a mut dyn FnMut(&Progress) -> bool) -> Self {
        let given_cost = problem.costs.path_cost(&problem.given);
        Self {
            problem,
            given_cost,
            keep_going,
            reported: i64::MAX,
            order: problem.given.clone(),
            cost: given_cost,
        }
    }

    fn report(&mut self, checkpoint: &Checkpoint) -> bool {
        if checkpoint.shortest < self.reported {
            self.reported = checkpoint.shortest;
            let order = checkpoint.order.clone();
            let cost = self.problem.costs.path_cost(&order);
            (self.order, self.cost) = if cost <= self.given_cost {
                (order, cost)
            } else {
                (self.problem.given.clone(), self.given_cost)
            };
        }
        let progress = Progress {
            kicks: checkpoint.kicks,
            order: &self.order,
            cost: self.cost,
            given_cost: self.given_cost,
        };
        (self.keep_going)(&progress)
    }
}

/// Kick, improve, keep or bring back.
fn iterate(
    mut path: impl Kicked,
    grid: &IntegerCosts,
    mut checkpoint: Checkpoint,
    until: u64,
    options: &Options,
    reporter: &mut Reporter,
) -> Checkpoint {
    let size = grid.points();
    let cooling = path.cooling();
    let every = options.report_every.max(1);
    let patience = (PATIENCE * size as u64).max(MIN_PATIENCE);
    // The shortest ring or path, and whether the order does not show it yet.
    let mut best = Vec::new();
    let mut is_new = false;
    loop {
        if checkpoint.kicks.is_multiple_of(every) {
            if std::mem::take(&mut is_new) {
                checkpoint.order = grid.strip(&best);
            }
            checkpoint.over |= !reporter.report(&checkpoint);
        }
        checkpoint.over |= !path.can_be_kicked();
        if checkpoint.kicks >= until || checkpoint.over {
            break;
        }
        checkpoint.kicks += 1;
        path.kick(&mut checkpoint.rng);
        let length = path.length();
        let luck = (f64::from(checkpoint.rng.next_u32()) + 1.0) / 4_294_967_297.0;
        let annealed = |warmth: f64| -luck.ln() * warmth;
        let (above, allowed) = match cooling {
            Cooling::Cycles { hot, cold } => {
                let part = checkpoint.cycle.part(checkpoint.kicks);
                (checkpoint.here, annealed(hot * (cold / hot).powf(part)))
            }
            Cooling::Steady { hot, power } => {
                let per_point = checkpoint.kicks as f64 / size as f64;
                (
                    checkpoint.here,
                    annealed(hot * (1.0 + per_point).powf(-power)),
                )
            }
            Cooling::Record { slack } => (checkpoint.walk.shortest, slack),
        };
        if ((length - above) as f64) <= allowed * checkpoint.mean_move {
            checkpoint.here = length;
            if length < checkpoint.shortest {
                checkpoint.shortest = length;
                path.write(&mut best);
                is_new = true;
            }
        } else {
            path.revert();
        }
        if let Cooling::Record { .. } = cooling {
            if checkpoint.here < checkpoint.walk.shortest {
                checkpoint.walk = Walk {
                    shortest: checkpoint.here,
                    since: 0,
                };
            } else {
                checkpoint.walk.since += 1;
            }
            if checkpoint.walk.since >= patience {
                if std::mem::take(&mut is_new) {
                    checkpoint.order = grid.strip(&best);
                }
                path.restart(
                    &grid.path(&checkpoint.order),
                    checkpoint.shortest,
                    &mut checkpoint.rng,
                );
                checkpoint.here = path.length();
                checkpoint.walk = Walk {
                    shortest: checkpoint.here,
                    since: 0,
                };
            }
        }
    }
    if is_new {
        checkpoint.order = grid.strip(&best);
    }
    checkpoint.path = path.suspend();
    checkpoint
}
