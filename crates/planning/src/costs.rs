//! Holds what each move costs: a square table of finite, non-negative numbers, symmetric or not.
//!
//! The unit is the caller's (metres of path, seconds of axis time); the crate only adds and compares. The diagonal is
//! never read by a path and is stored as zero.

use serde::{Deserialize, Serialize};

/// Why a table of costs was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CostError {
    /// The number of entries is not the square of the number of points.
    #[error("{entries} entries do not make a square table of {points} points")]
    Shape {
        /// Points claimed.
        points: usize,
        /// Entries found.
        entries: usize,
    },
    /// An entry is negative, infinite or not a number.
    #[error(
        "the cost from point {from} to point {to} is {cost}; it must be finite and not negative"
    )]
    Entry {
        /// Point left.
        from: usize,
        /// Point reached.
        to: usize,
        /// The entry.
        cost: f64,
    },
    /// A coordinate is infinite or not a number, or so large that a distance overflows.
    #[error("point {point} has the coordinate {coordinate}, from which no finite distance follows")]
    Coordinate {
        /// Index of the point.
        point: usize,
        /// The coordinate.
        coordinate: f64,
    },
}

/// Cost of every move from one point to another; asymmetric tables are allowed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Table", into = "Table")]
pub struct CostMatrix {
    points: usize,
    entries: Vec<f64>,
    symmetric: bool,
    largest: f64,
}

/// The serialised form; reading it back checks it again.
#[derive(Serialize, Deserialize)]
struct Table {
    points: usize,
    entries: Vec<f64>,
}

impl TryFrom<Table> for CostMatrix {
    type Error = CostError;
    fn try_from(table: Table) -> Result<Self, CostError> {
        Self::new(table.points, table.entries)
    }
}

impl From<CostMatrix> for Table {
    fn from(costs: CostMatrix) -> Self {
        Self {
            points: costs.points,
            entries: costs.entries,
        }
    }
}

impl CostMatrix {
    /// Checks a row-major table: `entries[from * points + to]`. Diagonal entries are replaced by zero.
    ///
    /// # Errors
    /// [`CostError::Shape`] unless there are `points²` entries, [`CostError::Entry`] for the first one off the
    /// diagonal that is negative or not finite.
    pub fn new(points: usize, mut entries: Vec<f64>) -> Result<Self, CostError> {
        if points.checked_mul(points) != Some(entries.len()) {
            return Err(CostError::Shape {
                points,
                entries: entries.len(),
            });
        }
        let mut largest = 0.0_f64;
        for from in 0..points {
            entries[from * points + from] = 0.0;
            for to in 0..points {
                let cost = entries[from * points + to];
                if !cost.is_finite() || cost < 0.0 {
                    return Err(CostError::Entry { from, to, cost });
                }
                largest = largest.max(cost);
            }
        }
        let symmetric =
            (0..points).all(|i| (0..i).all(|j| entries[i * points + j] == entries[j * points + i]));
        Ok(Self {
            points,
            entries,
            symmetric,
            largest,
        })
    }

    /// Fills the table from a function of (from, to); it is not called on the diagonal.
    ///
    /// # Errors
    /// [`CostError::Entry`] as in [`CostMatrix::new`].
    pub fn from_fn(
        points: usize,
        mut cost: impl FnMut(usize, usize) -> f64,
    ) -> Result<Self, CostError> {
        let mut entries = Vec::with_capacity(points.saturating_mul(points));
        for from in 0..points {
            for to in 0..points {
                entries.push(if from == to { 0.0 } else { cost(from, to) });
            }
        }
        Self::new(points, entries)
    }

    /// Straight distances between positions, m (length of the air path, `docs/source_systems.md, C.2`, equation 2).
    ///
    /// # Errors
    /// [`CostError::Coordinate`] for the first coordinate from which a distance is not finite.
    pub fn euclidean(positions: &[[f64; 3]]) -> Result<Self, CostError> {
        for (point, position) in positions.iter().enumerate() {
            if let Some(&coordinate) = position.iter().find(|x| x.is_nan() || x.abs() > 1e150) {
                return Err(CostError::Coordinate { point, coordinate });
            }
        }
        Self::from_fn(positions.len(), |from, to| {
            let [a, b] = [positions[from], positions[to]];
            ((b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2) + (b[2] - a[2]).powi(2)).sqrt()
        })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points
    }

    /// True when there are no points.
    pub fn is_empty(&self) -> bool {
        self.points == 0
    }

    /// Cost of the move between two points. Panics when an index is out of range.
    pub fn cost(&self, from: usize, to: usize) -> f64 {
        self.entries[from * self.points + to]
    }

    /// The costs of all moves from a point.
    pub(crate) fn row(&self, from: usize) -> &[f64] {
        &self.entries[from * self.points..(from + 1) * self.points]
    }

    /// True when every move costs the same both ways, to the last bit.
    pub fn is_symmetric(&self) -> bool {
        self.symmetric
    }

    /// Sum over consecutive moves of an open path. Panics when an index is out of range.
    pub fn path_cost(&self, order: &[usize]) -> f64 {
        order
            .windows(2)
            .map(|move_| self.cost(move_[0], move_[1]))
            .sum()
    }

    /// The largest entry; zero when there are fewer than two points.
    pub(crate) fn largest(&self) -> f64 {
        self.largest
    }
}
