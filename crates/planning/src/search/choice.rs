//! Holds what the moves of a ring cost: between points with one pose each, or with alternatives of which one is chosen.
//!
//! Exchanges of edges know points only; at which pose a point is visited is decided here, by the cheapest chain of
//! poses through a few neighbouring points (dynamic programming through its layers). Chosen poses are logged, so
//! that going back costs what was changed.

use std::cell::Cell;

use super::Cooling;
use super::integer_costs::IntegerCosts;
use super::ring::{MOST, Ring};

/// Points to either side of a changed one whose poses are chosen with its own.
const REACH: usize = 1;

/// Costs kept at hand of each point.
const CACHED: usize = 32;

/// What a ring asks about its points.
pub(super) trait Moves {
    /// True when some point has several poses.
    const ALTERNATIVES: bool;
    /// Continuations followed after the first, the second and the third removed edge.
    const BREADTH: [usize; MOST - 2];
    /// How the acceptance of kicked rings cools down.
    const COOLING: Cooling;
    fn grid(&self) -> &IntegerCosts;
    fn cost(&self, here: u32, there: u32) -> i64;
    /// Near points, by the least that a move to them costs, which is given with each.
    fn near(&self, here: u32) -> &[(u32, i32)];
    /// Cost of the move to a near point whose entry says `least`.
    fn cost_to(&self, here: u32, there: u32, least: i32) -> i64;
    /// What an added edge at this point costs at least, nearly always.
    fn least(&self, here: u32) -> i64;
    /// The pose at which a point is visited.
    fn pose(&self, point: u32) -> u32;
    fn choose(&mut self, point: u32, pose: u32);
    /// Finds the cheapest poses about a point, appends the points whose pose changed, and returns the gain.
    fn choose_about(&mut self, ring: &Ring, point: u32, changed: &mut Vec<u32>) -> i64;
    /// Forgets how to go back.
    fn keep(&mut self);
    /// Goes back to the poses at the last [`Moves::keep`].
    fn undo(&mut self);
}

/// Points with one pose each: point and pose have the same number.
pub(super) struct Plain<'a> {
    grid: &'a IntegerCosts,
    /// Cost to the nearest candidate of each point.
    least: Vec<i64>,
    /// Costs asked for last: of each point, to [`CACHED`] others by the last digits of their numbers.
    cache: Vec<Cell<(u32, i32)>>,
}

impl<'a> Plain<'a> {
    pub(super) fn new(grid: &'a IntegerCosts) -> Self {
        let nearest = |point| grid.near(point).first().map_or(0, |near| i64::from(near.1));
        Self {
            grid,
            least: (0..grid.points() as u32).map(nearest).collect(),
            cache: vec![Cell::new((u32::MAX, 0)); grid.points() * CACHED],
        }
    }
}

impl Moves for Plain<'_> {
    const ALTERNATIVES: bool = false;
    const BREADTH: [usize; MOST - 2] = [4, 2, 1];
    const COOLING: Cooling = Cooling::Steady {
        hot: 0.5,
        power: 0.4,
    };

    fn grid(&self) -> &IntegerCosts {
        self.grid
    }

    #[inline]
    fn cost(&self, here: u32, there: u32) -> i64 {
        let entry = &self.cache[here as usize * CACHED + there as usize % CACHED];
        let (cached, cost) = entry.get();
        if cached == there {
            return i64::from(cost);
        }
        let cost = self.grid.cost(here, there);
        entry.set((there, cost as i32));
        cost
    }

    #[inline]
    fn near(&self, here: u32) -> &[(u32, i32)] {
        self.grid.near(here)
    }

    #[inline]
    fn cost_to(&self, _here: u32, _there: u32, least: i32) -> i64 {
        i64::from(least)
    }

    #[inline]
    fn least(&self, here: u32) -> i64 {
        self.least[here as usize]
    }

    fn pose(&self, point: u32) -> u32 {
        point
    }

    fn choose(&mut self, _point: u32, _pose: u32) {}

    fn choose_about(&mut self, _ring: &Ring, _point: u32, _changed: &mut Vec<u32>) -> i64 {
        0
    }

    fn keep(&mut self) {}

    fn undo(&mut self) {}
}

/// Points with alternatives. The near poses of the grid are points here.
pub(super) struct Chosen<'a> {
    grid: &'a IntegerCosts,
    /// The pose of each point.
    visited: Vec<u32>,
    log: Vec<(u32, u32)>,
    /// The chain looked at: its points, and for each of their poses the cost of the cheapest chain to it and the pose before.
    chain: Vec<u32>,
    reached: Vec<(i64, u32)>,
}

impl<'a> Chosen<'a> {
    pub(super) fn new(grid: &'a IntegerCosts) -> Self {
        Self {
            grid,
            visited: (0..grid.points() as u32).collect(),
            log: Vec::new(),
            chain: Vec::new(),
            reached: Vec::new(),
        }
    }

    fn poses(&self, point: u32) -> &'a [u32] {
        &self.grid.rules.poses_of[point as usize]
    }

    /// The point and its neighbours to either side, as far as [`REACH`] and one further.
    fn gather(&mut self, ring: &Ring, point: u32) {
        let reach = REACH.min((ring.len() - 3) / 2);
        let mut here = point;
        for _ in 0..=reach {
            here = ring.previous(here);
        }
        self.chain.clear();
        for _ in 0..2 * reach + 3 {
            self.chain.push(here);
            here = ring.next(here);
        }
    }
}

impl Moves for Chosen<'_> {
    const ALTERNATIVES: bool = true;
    const BREADTH: [usize; MOST - 2] = [3, 1, 0];
    const COOLING: Cooling = Cooling::Cycles {
        hot: 1.0,
        cold: 0.03,
    };

    fn grid(&self) -> &IntegerCosts {
        self.grid
    }

    #[inline]
    fn cost(&self, here: u32, there: u32) -> i64 {
        let [here, there] = [here, there].map(|point| self.visited[point as usize]);
        self.grid.cost(here, there)
    }

    #[inline]
    fn near(&self, here: u32) -> &[(u32, i32)] {
        self.grid.near(self.visited[here as usize])
    }

    #[inline]
    fn cost_to(&self, here: u32, there: u32, _least: i32) -> i64 {
        self.cost(here, there)
    }

    #[inline]
    fn least(&self, here: u32) -> i64 {
        self.near(here).first().map_or(0, |near| i64::from(near.1))
    }

    fn pose(&self, point: u32) -> u32 {
        self.visited[point as usize]
    }

    fn choose(&mut self, point: u32, pose: u32) {
        let old = std::mem::replace(&mut self.visited[point as usize], pose);
        self.log.push((point, old));
    }

    fn choose_about(&mut self, ring: &Ring, point: u32, changed: &mut Vec<u32>) -> i64 {
        self.gather(ring, point);
        let last = self.chain.len() - 1;
        let grid = self.grid;
        let (mut reached, chain) = (std::mem::take(&mut self.reached), &self.chain);
        reached.clear();
        reached.push((0, 0));
        let mut old = 0;
        let first = [self.visited[chain[0] as usize]];
        let end = [self.visited[chain[last] as usize]];
        let (mut ahead, mut begin) = (&first[..], 0);
        for at in 1..=last {
            old += self.cost(chain[at - 1], chain[at]);
            let layer = if at < last {
                self.poses(chain[at])
            } else {
                &end
            };
            let next = reached.len();
            for &pose in layer {
                let mut best = (i64::MAX, 0);
                for (which, &before) in ahead.iter().enumerate() {
                    let cost = reached[begin + which].0 + grid.cost(before, pose);
                    if cost < best.0 {
                        best = (cost, which as u32);
                    }
                }
                reached.push(best);
            }
            (ahead, begin) = (layer, next);
        }
        let mut at = reached.len() - 1;
        let gain = old - reached[at].0;
        if gain > 0 {
            let mut which = reached[at].1 as usize;
            let mut behind = begin;
            for layer in (1..last).rev() {
                let point = self.chain[layer];
                let poses = self.poses(point);
                behind -= poses.len();
                at = behind + which;
                if self.visited[point as usize] != poses[which] {
                    self.choose(point, poses[which]);
                    changed.push(point);
                }
                which = reached[at].1 as usize;
            }
        }
        self.reached = reached;
        gain.max(0)
    }

    fn keep(&mut self) {
        self.log.clear();
    }

    fn undo(&mut self) {
        while let Some((point, old)) = self.log.pop() {
            self.visited[point as usize] = old;
        }
    }
}
