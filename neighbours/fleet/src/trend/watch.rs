//! The watch of one series.

use inference::evidence::log_sum;
use metrology::statistics::normal_quantile;

use super::Point;
use super::errors::Errors;
use super::filter::Level;
use super::spread::Spread;

/// Sessions before which the level is not known well enough to see a change.
const FEWEST: usize = 5;
/// Onsets that are kept: those with the largest likelihood; to leave some out only makes an alarm later.
const KEPT: usize = 60;
/// A step of this many standard deviations of a point is looked for.
const STEP: f64 = 4.0;
/// A slope that makes as many standard deviations of a point in this many days is looked for.
const DAYS: f64 = 60.0;

/// How a series has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// At once.
    Step,
    /// Steadily.
    Drift,
}

/// A series has changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// How.
    pub kind: Kind,
    /// Index of the point after which it is certain.
    pub alarm: usize,
    /// Index of the first changed point: the most probable, and the interval that holds 95 %.
    pub onset: usize,
    /// See `onset`.
    pub between: [usize; 2],
    /// Level before the onset.
    pub before: f64,
    /// Level and slope at the alarm; of a refined change after the last point of its range.
    pub after: Level,
    /// Step (unit of the series) or slope (per day) with its standard uncertainty.
    pub size: [f64; 2],
    /// Natural logarithm of the statistic at the alarm.
    pub log_statistic: f64,
}

/// The states in which a level that has been `unchanged` so far may go on from a point on: a step shows in the level, a drift in
/// the slope. Variance is that of a point.
pub(super) fn begun(unchanged: &Level, variance: f64) -> [(Kind, Level); 2] {
    let step = STEP * STEP * variance;
    [
        (Kind::Step, unchanged.loosened(step, 0.0)),
        (Kind::Drift, unchanged.loosened(0.0, step / (DAYS * DAYS))),
    ]
}

/// One onset.
#[derive(Debug, Clone)]
struct Onset {
    kind: Kind,
    first: usize,
    /// Level before it, and its variance.
    before: [f64; 2],
    state: Level,
    /// Logarithm of the likelihood ratio against no change.
    log_ratio: f64,
}

/// The watch of one series with a stated rate of false alarms.
#[derive(Debug, Clone)]
pub struct Watch {
    spread: Spread,
    errors: Errors,
    log_limit: f64,
    count: usize,
    /// Points since the watch began anew.
    own: usize,
    level: Option<Level>,
    onsets: Vec<Onset>,
}

impl Watch {
    /// A watch that alarms when the statistic exceeds `limit`. Series without a change reach it after `limit` sessions in the mean, or
    /// later ([`super::calibrate`]).
    pub fn new(spread: Spread, limit: f64) -> Self {
        Self {
            spread,
            errors: spread.errors(),
            log_limit: limit.max(1.0).ln(),
            count: 0,
            own: 0,
            level: None,
            onsets: Vec::new(),
        }
    }

    /// The level as it is now; `None` before the first point.
    pub fn level(&self) -> Option<&Level> {
        self.level.as_ref()
    }

    /// Takes the next point, whose time is not before the last one's.
    pub fn push(&mut self, point: &Point) -> Option<Change> {
        let number = self.count;
        self.count += 1;
        self.own += 1;
        let variance = self.spread.variance(point).max(f64::MIN_POSITIVE);
        let Some(mut level) = self.level else {
            self.level = Some(Level::after(point, &self.spread));
            return None;
        };
        level = level.at(point.time, &self.spread);
        let predicted = level;
        let unchanged = level.update(point.value, variance, &self.errors);
        self.level = Some(level);
        if self.own <= FEWEST {
            return None;
        }
        for (kind, state) in begun(&predicted, variance) {
            self.onsets.push(Onset {
                kind,
                first: number,
                before: [predicted.level, predicted.covariance[0]],
                state,
                log_ratio: -std::f64::consts::LN_2,
            });
        }
        for onset in &mut self.onsets {
            if onset.first < number {
                onset.state = onset.state.at(point.time, &self.spread);
            }
            onset.log_ratio += onset.state.update(point.value, variance, &self.errors) - unchanged;
        }
        if self.onsets.len() > KEPT {
            self.onsets
                .sort_by(|a, b| b.log_ratio.total_cmp(&a.log_ratio));
            // The youngest have not had their chance.
            let young = number.saturating_sub(KEPT / 4);
            let mut place = 0;
            self.onsets.retain(|onset| {
                place += 1;
                place <= KEPT / 2 || onset.first >= young
            });
        }
        let log_statistic = log_sum(self.onsets.iter().map(|onset| onset.log_ratio));
        if log_statistic < self.log_limit {
            return None;
        }
        let change = self.change(number, log_statistic);
        self.level = Some(change.after);
        self.onsets.clear();
        self.own = FEWEST.min(number - change.onset + 1);
        Some(change)
    }

    fn change(&self, number: usize, log_statistic: f64) -> Change {
        let share = |onset: &Onset| (onset.log_ratio - log_statistic).exp();
        let of = |kind: Kind| self.onsets.iter().filter(move |onset| onset.kind == kind);
        let kind = if of(Kind::Drift).map(share).sum::<f64>() > 0.5 {
            Kind::Drift
        } else {
            Kind::Step
        };
        let mut own: Vec<(usize, f64)> =
            of(kind).map(|onset| (onset.first, share(onset))).collect();
        own.sort_by_key(|(first, _)| *first);
        let total: f64 = own.iter().map(|(_, share)| share).sum();
        let quantile = |probability: f64| {
            let mut sum = 0.0;
            let reached = own.iter().find(|(_, share)| {
                sum += share / total;
                sum >= probability
            });
            reached.or(own.last()).map_or(number, |(first, _)| *first)
        };
        let best = of(kind).max_by(|a, b| a.log_ratio.total_cmp(&b.log_ratio));
        let (onset, before, after) = best
            .map_or((number, [0.0; 2], Level::first(0.0, 0.0, 0.0)), |best| {
                (best.first, best.before, best.state)
            });
        let size = match kind {
            Kind::Step => [
                after.level - before[0],
                (after.covariance[0] + before[1]).sqrt(),
            ],
            Kind::Drift => [after.slope, after.covariance[2].sqrt()],
        };
        Change {
            kind,
            alarm: number,
            onset,
            between: [quantile(0.025), quantile(0.975)],
            before: before[0],
            after,
            size,
            log_statistic,
        }
    }
}

/// Half width of a 95 % interval over the standard uncertainty.
pub fn quantile95() -> f64 {
    normal_quantile(0.975)
}
