//! How the series of one kind vary when nothing happens, from their likelihood.

use super::Point;
use super::errors::Errors;
use super::filter::Level;
use super::spread::Spread;

/// Fewest points of a series that takes part.
const FEWEST: usize = 5;
/// Days with sessions at the beginning of each series from which the spread is estimated.
const FIRST_DAYS: usize = 30;
/// Repeatability over the mean variance of the points, and walk over a month against it.
const TRIED: [f64; 8] = [0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0];
/// Repeatability between days over the variance of a point with repeatability.
const TRIED_DAILY: [f64; 6] = [0.0, 0.1, 0.3, 1.0, 3.0, 10.0];
/// Degrees of freedom.
const TRIED_FREEDOM: [f64; 3] = [f64::INFINITY, 10.0, 4.0];
/// Days of the walk that is compared with the variance of a point.
const MONTH: f64 = 30.0;

/// The spread under which the first days of the series are most likely, each with a level of its own; no spread where no series
/// is long enough. One part after the other, twice.
pub fn spread(series: &[&[Point]]) -> Spread {
    let begun = series.iter().map(|one| first_days(one));
    let long: Vec<&[Point]> = begun.filter(|one| one.len() >= FEWEST).collect();
    let variances = long
        .iter()
        .flat_map(|one| one.iter())
        .map(|point| point.uncertainty.powi(2));
    let count = long.iter().map(|one| one.len()).sum::<usize>();
    if count == 0 {
        return Spread::NONE;
    }
    let mean = variances.sum::<f64>() / count as f64;
    let mut best = (f64::NEG_INFINITY, Spread::NONE);
    let mut all = |tried: Spread| {
        let errors = tried.errors();
        let sum: f64 = long
            .iter()
            .map(|one| log_likelihood(one, &tried, &errors))
            .sum();
        if sum > best.0 {
            best = (sum, tried);
        }
        best.1
    };
    let several = long.iter().any(|one| {
        one.windows(2)
            .any(|pair| pair[0].time.floor() == pair[1].time.floor())
    });
    let mut found = Spread::NONE;
    for _ in 0..2 {
        let from = found;
        for repeatability in TRIED {
            for walk in TRIED {
                found = all(Spread {
                    repeatability: repeatability * mean,
                    walk: 0.1 * walk * mean / MONTH,
                    ..from
                });
            }
        }
        let from = found;
        for freedom in TRIED_FREEDOM {
            found = all(Spread { freedom, ..from });
        }
        if several {
            let from = found;
            for daily in TRIED_DAILY {
                found = all(Spread {
                    daily: daily * (mean + from.repeatability),
                    ..from
                });
            }
        }
    }
    found
}

/// The points of the first days that have any.
fn first_days(points: &[Point]) -> &[Point] {
    let days = points.chunk_by(|a, b| a.time.floor() == b.time.floor());
    &points[..days.take(FIRST_DAYS).map(<[Point]>::len).sum()]
}

/// Logarithm of the density of all points after the first.
fn log_likelihood(points: &[Point], spread: &Spread, errors: &Errors) -> f64 {
    let Some((first, rest)) = points.split_first() else {
        return 0.0;
    };
    let mut level = Level::after(first, spread);
    let mut sum = 0.0;
    for point in rest {
        level = level.at(point.time, spread);
        sum += level.update(point.value, spread.variance(point), errors);
    }
    sum
}
