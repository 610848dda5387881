//! Since when a series has changed, of what kind and by how much, from all sessions until its next change.
//!
//! The alarm comes at a point that lies far off, and its onset and size are those of few sessions. With all sessions before the next
//! change the posterior of the onset is that of a change point whose prior is even in time: between two sessions it is as
//! likely as they are far apart. A step is the difference of the level as the sessions before it give it and as those
//! after it do, backwards in time; a drift is the slope after it.

use inference::evidence::log_sum;

use super::filter::Level;
use super::watch::{Change, Kind, begun};
use super::{Point, Spread};

/// Sessions before the alarm among which the onset is sought.
const MOST: usize = 3000;

/// One onset with what follows from it.
struct Onset {
    first: usize,
    kind: Kind,
    log_weight: f64,
    before: f64,
    size: [f64; 2],
}

/// Changes of a series, each with onset, kind and size from all points between its neighbours.
pub fn refined(points: &[Point], spread: &Spread, changes: &[Change]) -> Vec<Change> {
    let mut refined: Vec<Change> = Vec::new();
    for (number, change) in changes.iter().enumerate() {
        let from = refined.last().map_or(0, |before| before.onset);
        let next = changes.get(number + 1);
        let to = next.map_or(points.len(), |next| next.onset.max(change.alarm + 1));
        let drifting = refined
            .last()
            .is_some_and(|before| before.kind == Kind::Drift);
        refined.push(one(points, spread, change, [from, to], drifting));
    }
    refined
}

/// The change with its alarm, of the points in a range.
fn one(
    points: &[Point],
    spread: &Spread,
    change: &Change,
    [from, to]: [usize; 2],
    drifting: bool,
) -> Change {
    let onsets = onsets(points, spread, change.alarm, [from, to], drifting);
    let total = log_sum(onsets.iter().map(|onset| onset.log_weight));
    if onsets.is_empty() || !total.is_finite() {
        return change.clone();
    }
    let share = |onset: &Onset| (onset.log_weight - total).exp();
    let drift = |onset: &&Onset| onset.kind == Kind::Drift;
    let kind = if onsets.iter().filter(drift).map(share).sum::<f64>() > 0.5 {
        Kind::Drift
    } else {
        Kind::Step
    };
    let quantile = |probability: f64| {
        let mut sum = 0.0;
        let reached = onsets.iter().find(|onset| {
            sum += share(onset);
            sum >= probability
        });
        reached
            .or(onsets.last())
            .map_or(change.onset, |onset| onset.first)
    };
    let own = || onsets.iter().filter(|onset| onset.kind == kind);
    let weight: f64 = own().map(share).sum();
    let mean =
        |of: &dyn Fn(&Onset) -> f64| own().map(|one| share(one) * of(one)).sum::<f64>() / weight;
    let size = mean(&|one| one.size[0]);
    let variance = mean(&|one| one.size[1] + (one.size[0] - size).powi(2));
    let best = own().max_by(|a, b| a.log_weight.total_cmp(&b.log_weight));
    Change {
        kind,
        onset: best.map_or(change.onset, |one| one.first),
        between: [quantile(0.025), quantile(0.975)],
        before: best.map_or(change.before, |one| one.before),
        size: [size, variance.max(0.0).sqrt()],
        ..change.clone()
    }
}

/// All onsets in the range up to the alarm, by time.
fn onsets(
    points: &[Point],
    spread: &Spread,
    alarm: usize,
    [from, to]: [usize; 2],
    drifting: bool,
) -> Vec<Onset> {
    let errors = spread.errors();
    let variance = |point: &Point| spread.variance(point).max(f64::MIN_POSITIVE);
    // The level after each point, from the last one backwards: a walk is the same both ways. Its day is left out.
    let mut after: Vec<Option<[f64; 2]>> = vec![None; to - from];
    let mut level: Option<Level> = None;
    for place in (from..to).rev() {
        let mirrored = Point {
            time: -points[place].time,
            ..points[place]
        };
        let own = match level {
            None => Level::after(&mirrored, spread),
            Some(level) => {
                let mut level = level.at(mirrored.time, spread);
                level.update(mirrored.value, variance(&mirrored), &errors);
                level
            }
        };
        after[place - from] = Some([own.level, own.covariance[0]]);
        level = Some(own);
    }
    let mut level = Level::after(&points[from], spread);
    if drifting {
        let [_, (_, begun)] = begun(&level, variance(&points[from]));
        level = begun;
    }
    let mut found = Vec::new();
    let mut log_before = 0.0;
    for first in from + 1..=alarm.min(to - 1) {
        let point = &points[first];
        let predicted = level.at(point.time, spread);
        if first + MOST > alarm {
            let gap = (point.time - points[first - 1].time).max(1e-6).ln();
            for (kind, mut state) in begun(&predicted, variance(point)) {
                let mut log_after = 0.0;
                for (place, point) in points[first..to].iter().enumerate() {
                    if place > 0 {
                        state = state.at(point.time, spread);
                    }
                    log_after += state.update(point.value, variance(point), &errors);
                }
                let size = match (kind, after[first - from]) {
                    (Kind::Step, Some([level, u2])) => {
                        [level - predicted.level, u2 + predicted.covariance[0]]
                    }
                    _ => [state.slope, state.covariance[2]],
                };
                found.push(Onset {
                    first,
                    kind,
                    log_weight: gap + log_before + log_after,
                    before: predicted.level,
                    size,
                });
            }
        }
        level = predicted;
        log_before += level.update(point.value, variance(point), &errors);
    }
    found
}
