//! Repeatability and walk of the series of one kind, from their likelihood.

use super::Point;
use super::filter::Level;

/// What moves an estimate from one session to the next when nothing happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Repeatability between sessions, variance beyond the points' own uncertainty.
    pub repeatability: f64,
    /// Variance of the level per day.
    pub walk: f64,
}

/// Fewest points of a series that takes part.
const FEWEST: usize = 5;
/// Repeatability over the mean variance of the points, and walk over a month against it.
const TRIED: [f64; 8] = [0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0];
/// Days of the walk that is compared with the variance of a point.
const MONTH: f64 = 30.0;

impl Spread {
    /// Variance of a point about the level.
    pub fn variance(&self, point: &Point) -> f64 {
        point.uncertainty.powi(2) + self.repeatability
    }
}

/// The spread under which the series are most likely, each with a level of its own; no spread where no series is long enough.
pub fn spread(series: &[&[Point]]) -> Spread {
    let long: Vec<&[Point]> = series
        .iter()
        .copied()
        .filter(|one| one.len() >= FEWEST)
        .collect();
    let variances = long
        .iter()
        .flat_map(|one| one.iter())
        .map(|point| point.uncertainty.powi(2));
    let count = long.iter().map(|one| one.len()).sum::<usize>();
    let none = Spread {
        repeatability: 0.0,
        walk: 0.0,
    };
    if count == 0 {
        return none;
    }
    let mean = variances.sum::<f64>() / count as f64;
    let mut best = (f64::NEG_INFINITY, none);
    for repeatability in TRIED {
        for walk in TRIED {
            let tried = Spread {
                repeatability: repeatability * mean,
                walk: 0.1 * walk * mean / MONTH,
            };
            let sum: f64 = long.iter().map(|one| log_likelihood(one, &tried)).sum();
            if sum > best.0 {
                best = (sum, tried);
            }
        }
    }
    best.1
}

/// Logarithm of the density of all points after the first.
fn log_likelihood(points: &[Point], spread: &Spread) -> f64 {
    let Some((first, rest)) = points.split_first() else {
        return 0.0;
    };
    let mut level = Level::first(first.time, first.value, spread.variance(first));
    let mut sum = 0.0;
    for point in rest {
        level = level.at(point.time, spread.walk);
        sum += level.update(point.value, spread.variance(point));
    }
    sum
}
