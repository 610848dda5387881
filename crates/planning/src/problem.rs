//! Holds what is to be ordered: costs, fixed ends, and the order that has to be beaten.

use serde::{Deserialize, Serialize};

use crate::costs::CostMatrix;

/// Why a problem was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProblemError {
    /// A fixed end names a point that does not exist.
    #[error("the fixed {end} is point {point}, but there are {points} points")]
    End {
        /// `start` or `end`.
        end: &'static str,
        /// Index given.
        point: usize,
        /// Number of points.
        points: usize,
    },
    /// One point cannot be both ends of a path of several.
    #[error("point {0} cannot be both start and end of a path of several points")]
    SameEnds(usize),
    /// The given order is not a permutation of the points.
    #[error("the given order visits point {0} not exactly once, or it does not exist")]
    GivenNotAPermutation(usize),
    /// The given order does not keep a fixed end.
    #[error("the given order does not have point {point} as its {end}")]
    GivenEnd {
        /// `start` or `end`.
        end: &'static str,
        /// The fixed point.
        point: usize,
    },
}

/// An open path through all points of a cost table, to be made short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Problem {
    pub(crate) costs: CostMatrix,
    pub(crate) start: Option<usize>,
    pub(crate) end: Option<usize>,
    pub(crate) given: Option<Vec<usize>>,
}

impl Problem {
    /// Every point once, ends free, compared with the order 0, 1, 2, …
    pub fn new(costs: CostMatrix) -> Self {
        Self {
            costs,
            start: None,
            end: None,
            given: None,
        }
    }

    /// Fixes the first point of the path.
    pub fn starting_at(mut self, point: usize) -> Self {
        self.start = Some(point);
        self
    }

    /// Fixes the last point of the path.
    pub fn ending_at(mut self, point: usize) -> Self {
        self.end = Some(point);
        self
    }

    /// The order in use so far; the answer is never longer. Without it, the points by index between the fixed ends.
    pub fn given(mut self, order: Vec<usize>) -> Self {
        self.given = Some(order);
        self
    }

    /// The table of costs.
    pub fn costs(&self) -> &CostMatrix {
        &self.costs
    }

    /// Checks the problem and returns the order to beat.
    ///
    /// # Errors
    /// The first [`ProblemError`] found.
    pub fn checked_given(&self) -> Result<Vec<usize>, ProblemError> {
        let points = self.costs.len();
        for (end, fixed) in [("start", self.start), ("end", self.end)] {
            if let Some(point) = fixed.filter(|&point| point >= points) {
                return Err(ProblemError::End { end, point, points });
            }
        }
        if let (Some(start), Some(end)) = (self.start, self.end)
            && start == end
            && points > 1
        {
            return Err(ProblemError::SameEnds(start));
        }
        let Some(given) = &self.given else {
            let inner = (0..points).filter(|&i| Some(i) != self.start && Some(i) != self.end);
            let last = self.end.filter(|_| self.end != self.start);
            return Ok(self.start.into_iter().chain(inner).chain(last).collect());
        };
        let mut seen = vec![false; points];
        for &point in given {
            if point >= points || std::mem::replace(&mut seen[point], true) {
                return Err(ProblemError::GivenNotAPermutation(point));
            }
        }
        if let Some(missing) = seen.iter().position(|&s| !s) {
            return Err(ProblemError::GivenNotAPermutation(missing));
        }
        for (end, fixed, is) in [
            ("start", self.start, given.first()),
            ("end", self.end, given.last()),
        ] {
            if let Some(point) = fixed.filter(|point| is != Some(point)) {
                return Err(ProblemError::GivenEnd { end, point });
            }
        }
        Ok(given.clone())
    }
}
