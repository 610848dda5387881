//! Holds a problem in the form the search wants: integer costs, a first and a last point, near neighbours.

use crate::costs::CostMatrix;

/// Near neighbours per point and direction.
const NEIGHBOURS: usize = 10;

/// The largest cost becomes this integer: sums of millions of moves fit, and rounding is 4e-9 of the largest cost.
const LARGEST: f64 = (1_u32 << 28) as f64;

/// Integer costs between points and, where an end is free, a dummy point.
pub(super) struct Grid {
    real: usize,
    points: usize,
    entries: Vec<u32>,
    symmetric: bool,
    first: u32,
    last: u32,
    after: Vec<Vec<u32>>,
    before: Vec<Vec<u32>>,
}

impl Grid {
    pub(super) fn new(costs: &CostMatrix, start: Option<usize>, end: Option<usize>) -> Self {
        let real = costs.len();
        let first = start.unwrap_or(real);
        let last = end.unwrap_or(if start.is_none() { real + 1 } else { real });
        let points = real + usize::from(start.is_none()) + usize::from(end.is_none());
        let largest = costs.largest();
        let scale = if largest > 0.0 {
            LARGEST / largest
        } else {
            0.0
        };
        let mut entries = vec![0; points * points];
        for from in 0..real {
            for to in 0..real {
                entries[from * points + to] = (costs.cost(from, to) * scale).round() as u32;
            }
        }
        let mut grid = Self {
            real,
            points,
            entries,
            symmetric: costs.is_symmetric(),
            first: first as u32,
            last: last as u32,
            after: Vec::new(),
            before: Vec::new(),
        };
        grid.after = grid.near(Self::cost);
        grid.before = grid.near(|grid, here, there| grid.cost(there, here));
        grid
    }

    /// For each point the nearest others, nearest first, lowest index among equals; dummies stay out.
    fn near(&self, cost: impl Fn(&Self, u32, u32) -> i64) -> Vec<Vec<u32>> {
        let real = self.real as u32;
        (0..self.points as u32)
            .map(|here| {
                if here >= real {
                    return Vec::new();
                }
                let mut others: Vec<u32> = (0..real).filter(|&there| there != here).collect();
                let keep = NEIGHBOURS.min(others.len());
                if keep < others.len() {
                    others.select_nth_unstable_by_key(keep, |&there| {
                        (cost(self, here, there), there)
                    });
                    others.truncate(keep);
                }
                others.sort_unstable_by_key(|&there| (cost(self, here, there), there));
                others
            })
            .collect()
    }

    pub(super) fn cost(&self, from: u32, to: u32) -> i64 {
        i64::from(self.entries[from as usize * self.points + to as usize])
    }

    pub(super) fn points(&self) -> usize {
        self.points
    }

    pub(super) fn is_symmetric(&self) -> bool {
        self.symmetric
    }

    pub(super) fn last(&self) -> u32 {
        self.last
    }

    /// Points to which a move from here is cheap.
    pub(super) fn after(&self, here: u32) -> &[u32] {
        &self.after[here as usize]
    }

    /// Points from which a move to here is cheap.
    pub(super) fn before(&self, here: u32) -> &[u32] {
        &self.before[here as usize]
    }

    pub(super) fn length(&self, path: &[u32]) -> i64 {
        path.windows(2)
            .map(|move_| self.cost(move_[0], move_[1]))
            .sum()
    }

    /// Points a path may begin with: the fixed start, or every point but the fixed end.
    pub(super) fn first_choices(&self) -> Vec<u32> {
        if (self.first as usize) < self.real {
            vec![self.first]
        } else {
            (0..self.real as u32).filter(|&i| i != self.last).collect()
        }
    }

    /// The beginning of a path that visits `start` first.
    pub(super) fn opening(&self, start: u32) -> Vec<u32> {
        if start == self.first {
            vec![start]
        } else {
            vec![self.first, start]
        }
    }

    /// An order of real points with the dummies at its free ends.
    pub(super) fn dress(&self, order: &[usize]) -> Vec<u32> {
        let real = self.real as u32;
        let head = Some(self.first).filter(|&i| i >= real);
        let tail = Some(self.last).filter(|&i| i >= real);
        head.into_iter()
            .chain(order.iter().map(|&i| i as u32))
            .chain(tail)
            .collect()
    }

    /// The order of real points of a path.
    pub(super) fn strip(&self, path: &[u32]) -> Vec<usize> {
        path.iter()
            .map(|&i| i as usize)
            .filter(|&i| i < self.real)
            .collect()
    }
}
