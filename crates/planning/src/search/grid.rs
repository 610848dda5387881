//! Holds a problem in the form the search wants: integer costs, a first and a last point, near neighbours.

use crate::problem::Problem;

/// Near neighbours per point and direction.
const NEIGHBOURS: usize = 5;

/// Nearest points among which relative neighbours are sought.
const LOOK: usize = 300;

/// Most neighbours kept.
const MOST: usize = 10;

/// The largest cost becomes this integer; rounding is 7e-9 of it.
const LARGEST: f64 = (1_u32 << 26) as f64;

/// Cost of the edge that closes the path to a ring: so cheap that no exchange of a few edges removes it.
const CLOSING: i32 = -(1 << 30);

/// Integer costs between points and, where an end is free, a dummy point. Points are numbered along a short path, so
/// that near points lie near each other in memory too.
pub(super) struct Grid {
    /// The caller's index of each point; dummies have none.
    labels: Vec<Option<usize>>,
    entries: Vec<i32>,
    symmetric: bool,
    after: Vec<Vec<(u32, i32)>>,
    before: Vec<Vec<(u32, i32)>>,
}

impl Grid {
    /// `beginning` is the path by which the points are numbered; it becomes 0, 1, 2, …
    pub(super) fn new(problem: &Problem, beginning: &[usize]) -> Self {
        let costs = &problem.costs;
        let head = problem.start.is_none().then_some(None);
        let tail = problem.end.is_none().then_some(None);
        let labels: Vec<Option<usize>> =
            head.into_iter().chain(beginning.iter().copied().map(Some)).chain(tail).collect();
        let points = labels.len();
        let largest = costs.largest();
        let scale = if largest > 0.0 { LARGEST / largest } else { 0.0 };
        let mut entries = Vec::with_capacity(points * points);
        for &from in &labels {
            entries.extend(labels.iter().map(|&to| match (from, to) {
                (Some(from), Some(to)) => (costs.cost(from, to) * scale).round() as i32,
                _ => 0,
            }));
        }
        entries[points - 1] = CLOSING;
        entries[(points - 1) * points] = CLOSING;
        let symmetric = costs.is_symmetric();
        let mut grid = Self { labels, entries, symmetric, after: Vec::new(), before: Vec::new() };
        grid.after = grid.select(Self::cost);
        grid.before = grid.select(|grid, here, there| grid.cost(there, here));
        grid
    }

    /// For each point the nearest others, nearest first, lowest index among equals; dummies stay out. Beside the
    /// nearest, a point further off is kept when no kept one is nearer to it (a relative neighbour, Toussaint 1980):
    /// so clusters stay connected, whatever the unit of cost.
    fn select(&self, cost: impl Fn(&Self, u32, u32) -> i64) -> Vec<Vec<(u32, i32)>> {
        let points = self.points() as u32;
        (0..points)
            .map(|here| {
                let wanted = |point: u32| self.labels[point as usize].is_some();
                if !wanted(here) {
                    return Vec::new();
                }
                let mut others: Vec<(u32, i32)> = (0..points)
                    .filter(|&there| there != here && wanted(there) && self.cost(here, there) >= 0)
                    .map(|there| (there, cost(self, here, there) as i32))
                    .collect();
                let key = |&(there, cost): &(u32, i32)| (cost, there);
                let look = LOOK.min(others.len());
                if look < others.len() {
                    others.select_nth_unstable_by_key(look, key);
                    others.truncate(look);
                }
                others.sort_unstable_by_key(key);
                let mut kept: Vec<(u32, i32)> = Vec::new();
                for (rank, &(there, distance)) in others.iter().enumerate() {
                    let shadowed = || kept.iter().any(|&(near, _)| cost(self, near, there) < i64::from(distance));
                    if rank < NEIGHBOURS || !shadowed() {
                        kept.push((there, distance));
                    }
                    if kept.len() >= MOST {
                        break;
                    }
                }
                kept
            })
            .collect()
    }

    pub(super) fn cost(&self, from: u32, to: u32) -> i64 {
        i64::from(self.entries[from as usize * self.labels.len() + to as usize])
    }

    pub(super) fn points(&self) -> usize {
        self.labels.len()
    }

    pub(super) fn is_symmetric(&self) -> bool {
        self.symmetric
    }

    /// Near points, to which a move is cheap, with its cost.
    pub(super) fn near(&self, here: u32) -> &[(u32, i32)] {
        &self.after[here as usize]
    }

    /// Points to which a move from here is cheap.
    pub(super) fn after(&self, here: u32) -> impl Iterator<Item = u32> {
        self.after[here as usize].iter().map(|&(point, _)| point)
    }

    /// Points from which a move to here is cheap.
    pub(super) fn before(&self, here: u32) -> impl Iterator<Item = u32> {
        self.before[here as usize].iter().map(|&(point, _)| point)
    }

    pub(super) fn length(&self, path: &[u32]) -> i64 {
        path.windows(2)
            .map(|move_| self.cost(move_[0], move_[1]))
            .sum()
    }

    /// The caller's order of a path, or of a ring that holds the path in either direction.
    pub(super) fn strip(&self, ring: &[u32]) -> Vec<usize> {
        let size = ring.len();
        let start = ring.iter().position(|&point| point == 0).unwrap_or(0);
        let backwards = size > 2 && ring[(start + 1) % size] as usize == size - 1;
        (0..size)
            .map(|step| ring[if backwards { start + size - step } else { start + step } % size])
            .filter_map(|point| self.labels[point as usize])
            .collect()
    }
}
