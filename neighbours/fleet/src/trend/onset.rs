//! Since when a series has changed, of what kind and by how much, from all sessions until its next change.
//!
//! The alarm comes at a point that lies far off, and its onset and size are those of few sessions. With all sessions before the next
//! change the posterior of the onset is that of a change point whose prior is even in time: between two sessions it is as
//! likely as they are far apart. A step is the difference of the level as the sessions before it give it and as those
//! after it do, backwards in time; a drift is the slope after it.
//!
//! A quick drift is a step as well in the few sessions before its alarm, and then another one. Changes that follow one another
//! become one, at the alarm of the first, where the sessions of all of them are as likely under one change: by the marginal
//! likelihood, in which each change pays for its onset ([`merged`]).

use inference::evidence::log_sum;

use super::filter::Level;
use super::watch::{Change, Kind, begun};
use super::{Point, Spread};

/// Sessions before the alarm among which the onset is sought.
const MOST: usize = 3000;
/// Days between two sessions at one time.
const SHORTEST: f64 = 1e-6;
/// Changes after one that are tried as parts of it.
const FOLLOWING: usize = 8;

/// One onset with what follows from it.
struct Onset {
    first: usize,
    kind: Kind,
    log_weight: f64,
    before: f64,
    size: [f64; 2],
    /// State after the last session.
    state: Level,
}

/// A change with the logarithm of the sum of the weights of its onsets over that of the best one.
struct Refined {
    change: Change,
    log_breadth: f64,
}

/// Changes of a series, each with onset, kind and size from all points between its neighbours, and with level and slope after the
/// last of them.
pub fn refined(points: &[Point], spread: &Spread, changes: &[Change]) -> Vec<Change> {
    let told = Told { points, spread };
    let changes = merged(&told, changes.to_vec());
    let refined = told.refined(&changes, 0, false, points.len());
    refined.into_iter().map(|one| one.change).collect()
}

/// The same changes, of which those that follow one another are one where that is as likely.
fn merged(told: &Told<'_>, mut changes: Vec<Change>) -> Vec<Change> {
    let (mut place, mut from, mut drifting) = (0, 0, false);
    while place < changes.len() {
        let end = told.points.len();
        for last in (place + 1..changes.len().min(place + 1 + FOLLOWING)).rev() {
            let to = changes
                .get(last + 1)
                .map_or(end, |next| next.onset.max(changes[last].alarm + 1));
            let of = |some: &[Change]| {
                let refined = told.refined(some, from, drifting, to);
                told.log_likelihood(&refined, [from, to], drifting)
            };
            if of(&changes[place..=place]) >= of(&changes[place..=last]) {
                changes.drain(place + 1..=last);
                break;
            }
        }
        let to = changes
            .get(place + 1)
            .map_or(end, |next| next.onset.max(changes[place].alarm + 1));
        let own = told.refined(&changes[place..=place], from, drifting, to);
        from = own[0].change.onset;
        drifting |= own[0].change.kind == Kind::Drift;
        place += 1;
    }
    changes
}

/// A series and its spread.
struct Told<'p> {
    points: &'p [Point],
    spread: &'p Spread,
}

impl Told<'_> {
    /// Each change from the points between its neighbours, `from` the first point to that before `to`; true where the series drifts
    /// already.
    fn refined(
        &self,
        changes: &[Change],
        mut from: usize,
        mut drifting: bool,
        to: usize,
    ) -> Vec<Refined> {
        let mut refined = Vec::with_capacity(changes.len());
        for (number, change) in changes.iter().enumerate() {
            let next = changes.get(number + 1);
            let to = next.map_or(to, |next| next.onset.max(change.alarm + 1));
            let one = self.one(change, [from, to], drifting);
            from = one.change.onset;
            drifting |= one.change.kind == Kind::Drift;
            refined.push(one);
        }
        refined
    }

    /// The change with its alarm, of the points in a range.
    fn one(&self, change: &Change, range: [usize; 2], drifting: bool) -> Refined {
        let onsets = self.onsets(change.alarm, range, drifting);
        let total = log_sum(onsets.iter().map(|onset| onset.log_weight));
        if onsets.is_empty() || !total.is_finite() {
            return Refined {
                change: change.clone(),
                log_breadth: 0.0,
            };
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
        let mean = |of: &dyn Fn(&Onset) -> f64| {
            own().map(|one| share(one) * of(one)).sum::<f64>() / weight
        };
        let size = mean(&|one| one.size[0]);
        let variance = mean(&|one| one.size[1] + (one.size[0] - size).powi(2));
        let best = own().max_by(|a, b| a.log_weight.total_cmp(&b.log_weight));
        let [level, slope] = [mean(&|one| one.state.level), mean(&|one| one.state.slope)];
        let after = Level {
            level,
            slope,
            covariance: [
                mean(&|one| one.state.covariance[0] + (one.state.level - level).powi(2)),
                mean(&|one| {
                    let off = (one.state.level - level) * (one.state.slope - slope);
                    one.state.covariance[1] + off
                }),
                mean(&|one| one.state.covariance[2] + (one.state.slope - slope).powi(2)),
            ],
            ..best.map_or(change.after, |one| one.state)
        };
        let refined = Change {
            kind,
            onset: best.map_or(change.onset, |one| one.first),
            between: [quantile(0.025), quantile(0.975)],
            before: best.map_or(change.before, |one| one.before),
            after,
            size: [size, variance.max(0.0).sqrt()],
            ..change.clone()
        };
        Refined {
            change: refined,
            log_breadth: best.map_or(0.0, |one| total - one.log_weight),
        }
    }

    /// Logarithm of the marginal likelihood of the points in a range under these changes: that at their onsets, and for each the
    /// breadth of its onset over that of all times of the range and both kinds.
    fn log_likelihood(
        &self,
        changes: &[Refined],
        [from, to]: [usize; 2],
        mut drifting: bool,
    ) -> f64 {
        let errors = self.spread.errors();
        let span = self.points[to - 1].time - self.points[from].time;
        let mut sum = 0.0;
        let mut level = self.first(&self.points[from], drifting);
        let mut left = changes.iter().peekable();
        for place in from + 1..to {
            let point = &self.points[place];
            level = level.at(point.time, self.spread);
            if let Some(Refined {
                change,
                log_breadth,
            }) = left.next_if(|one| one.change.onset <= place)
            {
                let both = self.begun(&level, point, drifting);
                let begun = both.into_iter().find(|(kind, _)| *kind == change.kind);
                level = begun.map_or(level, |(_, begun)| begun);
                drifting |= change.kind == Kind::Drift;
                let prior = self.gap(place) - span.max(SHORTEST).ln() - std::f64::consts::LN_2;
                sum += prior + log_breadth;
            }
            sum += level.update(point.value, self.variance(point), &errors);
        }
        sum
    }

    fn variance(&self, point: &Point) -> f64 {
        self.spread.variance(point).max(f64::MIN_POSITIVE)
    }

    /// Logarithm of the days before a point.
    fn gap(&self, place: usize) -> f64 {
        let days = self.points[place].time - self.points[place - 1].time;
        days.max(SHORTEST).ln()
    }

    /// The level after a first point, which may have a slope already.
    fn first(&self, point: &Point, drifting: bool) -> Level {
        let level = Level::after(point, self.spread);
        if drifting {
            let [_, (_, begun)] = begun(&level, self.variance(point));
            return begun;
        }
        level
    }

    /// The states in which a level may go on from a point on; where it drifts already the drift may end with a step, or be another.
    fn begun(&self, level: &Level, point: &Point, drifting: bool) -> [(Kind, Level); 2] {
        let variance = self.variance(point);
        let [step, drift] = begun(level, variance);
        if drifting {
            let [both, _] = begun(&drift.1, variance);
            return [both, drift];
        }
        [step, drift]
    }

    /// All onsets in the range up to the alarm, by time.
    fn onsets(&self, alarm: usize, [from, to]: [usize; 2], drifting: bool) -> Vec<Onset> {
        let Self { points, spread } = *self;
        let errors = spread.errors();
        let variance = |point: &Point| self.variance(point);
        // The level after each point, from the last one backwards: a walk is the same both ways. Its day is left out.
        let mut after: Vec<Option<[f64; 2]>> = vec![None; to - from];
        let mut level: Option<Level> = None;
        for place in (from..to).rev() {
            let mirrored = Point {
                time: -points[place].time,
                ..points[place]
            };
            let own = match level {
                None => self.first(&mirrored, drifting),
                Some(level) => {
                    let mut level = level.at(mirrored.time, spread);
                    level.update(mirrored.value, variance(&mirrored), &errors);
                    level
                }
            };
            after[place - from] = Some([own.level, own.covariance[0]]);
            level = Some(own);
        }
        let mut level = self.first(&self.points[from], drifting);
        let mut found = Vec::new();
        let mut log_before = 0.0;
        for first in from + 1..=alarm.min(to - 1) {
            let point = &points[first];
            let predicted = level.at(point.time, spread);
            if first + MOST > alarm {
                let gap = self.gap(first);
                for (kind, mut state) in self.begun(&predicted, point, drifting) {
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
                        state,
                    });
                }
            }
            level = predicted;
            log_before += level.update(point.value, variance(point), &errors);
        }
        found
    }
}
