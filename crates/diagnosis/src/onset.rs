//! Whether the gap changes while parts are made, since which part, and why: [`inference::onset`] on the touches of each part.
//!
//! Directions are the signatures of the library's effects on the plan of the first part, each for itself. A part gives the
//! projection of its deviations on each; the stated rate of false alarms holds whatever the mean and the spread of the
//! parts are, as long as parts vary independently and normally. After an alarm the mean deviations since the onset are
//! compared with those before it, and the effects that explain the difference equally well are the cause group. Metres.

mod cause;
mod further;
mod scatter;

use std::collections::VecDeque;

use effects::{Observations, Session, SessionError, Variant, library, observe};
use inference::linear::{add_scaled, dot};
use inference::onset::Stream;
use inference::robust::{coefficients, residuals};
use metrology::statistics::{median, rms, robust_deviation};
use probecell_msgs::InspectionPoint;
use serde::{Deserialize, Serialize};

use self::scatter::Scatter;
use crate::options::Options;
use crate::report::Effect;

/// Parts kept for comparison.
const KEPT: usize = 100;
/// Parts that are compared together before the stream begins.
const FIRST: usize = 5;
/// A touch that is farther off what its point usually reads, in this clamping, than this many robust standard deviations is taken
/// for a chip.
const FAR: f64 = 5.0;
/// Largest share of the touches of a part that are: more of them have changed. One may be in any case.
const CHIPS: f64 = 0.15;
/// A signature whose plausible size stays below this rms does not show, m.
const UNOBSERVABLE: f64 = 2e-7;
/// Touches for each way in which a clamped part can sit otherwise that it takes to tell them.
const TOUCHES_EACH: usize = 3;
/// Least spread of how parts sit, over that of a touch.
const MIN_CLAMPED: f64 = 0.1;
/// Values of a nonlinear parameter that are tried.
const TRIED: usize = 12;

/// A part that was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Part {
    plan_id: String,
    /// ns since 1970, first touch.
    measured: i64,
    /// m, in the order of the plan's points; as measured, and without chips.
    measured_deviations: Vec<f64>,
    deviations: Vec<f64>,
    /// How it sits in its clamping: a factor of each of [`ChangeMonitor::clampings`]; empty before it enters the stream.
    clamped: Vec<f64>,
}

/// Parts of one plan, one after the other.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeMonitor {
    points: Vec<usize>,
    directions: Vec<Vec<f64>>,
    /// How a part that is clamped otherwise reads, over the points.
    clampings: Vec<Vec<f64>>,
    stream: Stream,
    /// Parts since this watch began, which the stream takes from the [`FIRST`] on.
    seen: u64,
    recent: VecDeque<Part>,
    /// Parts before those that the stream holds.
    before: u64,
    /// The plan of the last part.
    last: String,
}

/// The gap has changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Number of the first changed part and of the part after which that is certain, from 1, of those watched.
    pub onset: u64,
    /// See `onset`.
    pub part: u64,
    /// Plan of the first changed part.
    pub plan_id: String,
    /// Its first touch, ns since 1970.
    pub since: i64,
    /// The effect that explains the change best, with its size and all that explain it as well; none where nothing of the
    /// library explains half of it.
    pub cause: Option<Effect>,
    /// Root mean square of the change over the points, and of what the cause leaves of it, m.
    pub rms: [f64; 2],
    /// Touches of the same part that discriminate the effects of the cause's group, the most informative first; none where
    /// there is one effect only, or no touch within reach tells.
    pub further: Vec<InspectionPoint>,
}

impl ChangeMonitor {
    /// Number of parts watched.
    pub fn parts(&self) -> u64 {
        self.before + self.seen
    }

    /// Takes the measurement of a part. `Some` where the gap has changed, at a rate of at most `rate` false alarms in 1,000
    /// parts; the watch then begins anew with the changed parts. A part that lacks a point is left
    /// out, and one that was the last already; one of another
    /// plan begins another watch.
    ///
    /// # Errors
    /// [`SessionError`] names what makes the session unusable.
    pub fn part(
        &mut self,
        session: &Session,
        options: &Options,
        rate: f64,
    ) -> Result<Option<Change>, SessionError> {
        let plan_id = session
            .plan
            .as_ref()
            .map_or("", |plan| plan.plan_id.as_str());
        if plan_id == self.last {
            return Ok(None);
        }
        plan_id.clone_into(&mut self.last);
        let observations = observe(session)?;
        let Some((points, deviations)) = by_point(&observations, session) else {
            return Ok(None);
        };
        let variants = || {
            let mut variants = library(&observations);
            variants.retain(|variant| !options.without.contains(&variant.effect));
            variants
        };
        if points != self.points {
            *self = Self {
                directions: directions(&observations, &points, &variants()),
                clampings: clampings(&observations, &points),
                points,
                last: plan_id.to_owned(),
                ..Self::default()
            };
        }
        let stamps = session.events.iter().map(|event| &event.header.stamp);
        let nanoseconds = stamps.map(|at| at.nanos());
        self.push(Part {
            plan_id: self.last.clone(),
            measured: nanoseconds.min().unwrap_or(0),
            measured_deviations: deviations,
            deviations: Vec::new(),
            clamped: Vec::new(),
        });
        let Some(alarm) = self.stream.evidence().filter(|one| one.is_alarm(rate)) else {
            return Ok(None);
        };
        let first = (self.seen - self.recent.len() as u64) as usize;
        let since = (alarm.onset as usize)
            .saturating_sub(first)
            .clamp(1, self.recent.len() - 1);
        let change = self.change(session, &observations, &variants(), since, options);
        let parts = self.parts();
        let changed: Vec<Part> = self.recent.drain(since..).collect();
        *self = Self {
            points: std::mem::take(&mut self.points),
            directions: std::mem::take(&mut self.directions),
            clampings: std::mem::take(&mut self.clampings),
            before: parts - changed.len() as u64,
            last: std::mem::take(&mut self.last),
            ..Self::default()
        };
        for part in changed {
            self.push(part);
        }
        Ok(Some(change))
    }

    /// Adds a part to the recent ones and, chips taken out, to the stream.
    fn push(&mut self, part: Part) {
        self.recent.push_back(part);
        if self.recent.len() > KEPT {
            self.recent.pop_front();
        }
        self.seen += 1;
        let count = self.recent.len();
        if count < FIRST {
            return;
        }
        let middles: Vec<f64> = (0..self.points.len())
            .map(|point| {
                let all = self
                    .recent
                    .iter()
                    .map(|part| part.measured_deviations[point]);
                median(&all.collect::<Vec<f64>>())
            })
            .collect();
        let entering = if self.stream.count() == 0 {
            0
        } else {
            count - 1
        };
        let usual: Vec<Vec<f64>> = (self.recent.iter())
            .map(|part| less(&part.measured_deviations, &middles))
            .collect();
        let mut sits = Sits::new(&self.clampings);
        if entering == 0 {
            for (part, off) in self.recent.iter_mut().zip(&usual) {
                part.clamped = sits.of(off);
            }
        }
        let others = self
            .recent
            .iter()
            .zip(&usual)
            .take(count - usize::from(entering > 0));
        sits.learn(others.map(|(part, off)| (part.clamped.as_slice(), off.as_slice())));
        for (part, off) in self.recent.iter_mut().zip(&usual).skip(entering) {
            part.clamped = sits.of(off);
        }
        let left: Vec<Vec<f64>> = (self.recent.iter().zip(&usual))
            .map(|(part, off)| residuals(&self.clampings, &part.clamped, off))
            .collect();
        let spreads = spreads(&left);
        for index in entering..count {
            let before = index.checked_sub(1).map(|before| left[before].as_slice());
            let chips = chips(&left[index], before, &spreads);
            let part = &mut self.recent[index];
            part.deviations.clone_from(&part.measured_deviations);
            for point in chips {
                part.deviations[point] -= left[index][point];
            }
            let along = |direction: &Vec<f64>| dot(direction, &part.deviations);
            let estimates: Vec<f64> = self.directions.iter().map(along).collect();
            self.stream.push(&estimates);
        }
    }

    /// What has changed between the parts before and since a place among the recent ones.
    fn change(
        &self,
        session: &Session,
        observations: &Observations,
        variants: &[Variant],
        since: usize,
        options: &Options,
    ) -> Change {
        let mean = |parts: &[&Part]| {
            let mut mean = vec![0.0; self.points.len()];
            for part in parts {
                add_scaled(&mut mean, 1.0 / parts.len() as f64, &part.deviations);
            }
            mean
        };
        let all: Vec<&Part> = self.recent.iter().collect();
        let (before, after) = all.split_at(since);
        let (mean_before, mean_after) = (mean(before), mean(after));
        let mut difference = mean_after.clone();
        add_scaled(&mut difference, -1.0, &mean_before);
        let off = |parts: &[&Part], mean: &[f64]| -> Vec<Vec<f64>> {
            let of = |part: &&Part| {
                part.deviations
                    .iter()
                    .zip(mean)
                    .map(|(a, b)| a - b)
                    .collect()
            };
            parts.iter().map(of).collect()
        };
        let mut scatter = off(before, &mean_before);
        scatter.extend(off(after, &mean_after));
        let means = 1.0 / before.len() as f64 + 1.0 / after.len() as f64;
        let freedom = scatter.len().saturating_sub(2).max(1) as f64;
        let scatter = Scatter::new(&scatter, freedom, means);
        let cause = cause::cause(observations, &self.points, variants, &difference, &scatter);
        let further = match (&session.plan, &cause) {
            (Some(plan), Some(cause)) if cause.group.len() > 1 => {
                let change = further::Change {
                    observations,
                    points: &self.points,
                    difference: &difference,
                };
                change.discriminated(plan, variants, cause, options.next)
            }
            _ => Vec::new(),
        };
        let size = rms(&difference);
        let first = &self.recent[since];
        Change {
            onset: self.parts() - (after.len() as u64) + 1,
            part: self.parts(),
            plan_id: first.plan_id.clone(),
            since: first.measured,
            rms: [size, cause.as_ref().map_or(size, |cause| cause.rms_after)],
            cause,
            further,
        }
    }
}

/// How parts sit in their clampings.
struct Sits<'a> {
    clampings: &'a [Vec<f64>],
    /// Of a touch, m, and of each factor from part to part; where they are known.
    spreads: Option<(f64, Vec<f64>)>,
}

impl<'a> Sits<'a> {
    fn new(clampings: &'a [Vec<f64>]) -> Self {
        Self {
            clampings,
            spreads: None,
        }
    }

    /// Takes the spreads from parts: their factors, and how far they are off what is usual, m.
    fn learn<'p>(&mut self, parts: impl Iterator<Item = (&'p [f64], &'p [f64])>) {
        let (factors, left): (Vec<&[f64]>, Vec<Vec<f64>>) = parts
            .map(|(factors, off)| (factors, residuals(self.clampings, factors, off)))
            .unzip();
        let touch = median(&spreads(&left));
        let of_factor = |(number, column): (usize, &Vec<f64>)| {
            let all: Vec<f64> = factors.iter().map(|factors| factors[number]).collect();
            robust_deviation(&all, 0.0).max(MIN_CLAMPED * touch / rms(column))
        };
        let each = self.clampings.iter().enumerate().map(of_factor).collect();
        self.spreads = (touch > 0.0).then_some((touch, each));
    }

    /// The factors of a part that is so far off what is usual, m; touches that are wild do not count, and other parts say what is
    /// usual.
    fn of(&self, off: &[f64]) -> Vec<f64> {
        let mut columns = self.clampings.to_vec();
        let mut off = off.to_vec();
        if let Some((touch, spreads)) = &self.spreads {
            for (number, column) in columns.iter_mut().enumerate() {
                let usual = spreads.iter().enumerate();
                column.extend(usual.map(
                    |(other, spread)| {
                        if other == number { touch / spread } else { 0.0 }
                    },
                ));
            }
            off.resize(off.len() + spreads.len(), 0.0);
        }
        coefficients(&columns, &off).unwrap_or_else(|_| vec![0.0; self.clampings.len()])
    }
}

fn less(values: &[f64], others: &[f64]) -> Vec<f64> {
    let pairs = values.iter().zip(others);
    pairs.map(|(value, other)| value - other).collect()
}

/// Robust standard deviation of each touch from part to part.
fn spreads(left: &[Vec<f64>]) -> Vec<f64> {
    let of_point = |point: usize| {
        let all: Vec<f64> = left.iter().map(|part| part[point]).collect();
        robust_deviation(&all, median(&all))
    };
    (0..left.first().map_or(0, Vec::len))
        .map(of_point)
        .collect()
}

/// Touches of a part that met a chip, by what is `left` of each, m, and how that spreads at its point and over the part. What the
/// part `before` shows at the same point as well, as large, has changed.
fn chips(left: &[f64], before: Option<&[f64]>, spreads: &[f64]) -> Vec<usize> {
    let own = robust_deviation(left, median(left));
    let is_chip = |point: &usize| {
        let far = FAR * spreads[*point].max(own);
        let remains = before.is_some_and(|before| (left[*point] - before[*point]).abs() <= far);
        left[*point].abs() > far && !remains
    };
    let chips: Vec<usize> = (0..left.len()).filter(is_chip).collect();
    if chips.len() <= ((CHIPS * left.len() as f64) as usize).max(1) {
        chips
    } else {
        Vec::new()
    }
}

/// How a part that is moved or turned in its clamping reads, and one whose readings are all off alike; the last alone where the plan
/// has few points.
fn clampings(observations: &Observations, points: &[usize]) -> Vec<Vec<f64>> {
    let alike = vec![1.0; points.len()];
    let rigid = library(observations)
        .into_iter()
        .filter(|one| ["fixture.shift", "fixture.tilt"].contains(&one.effect.as_str()))
        .flat_map(|one| columns(observations, points, &one, 0.0));
    let all: Vec<Vec<f64>> = std::iter::once(alike.clone()).chain(rigid).collect();
    if points.len() < TOUCHES_EACH * all.len() {
        return vec![alike];
    }
    all
}

/// Points of the plan that were touched, ascending, and their mean deviations; `None` where one was not.
fn by_point(observations: &Observations, session: &Session) -> Option<(Vec<usize>, Vec<f64>)> {
    let points = session.plan.as_ref()?.points.len();
    let mut sums = vec![(0.0, 0_u32); points];
    for (row, deviation) in observations.rows.iter().zip(&observations.deviations) {
        if row.pose.is_some() {
            let sum = sums.get_mut(row.point)?;
            *sum = (sum.0 + deviation, sum.1 + 1);
        }
    }
    let is_whole = points > 0 && sums.iter().all(|(_, touches)| *touches > 0);
    let means = sums.iter().map(|(sum, touches)| sum / f64::from(*touches));
    is_whole.then(|| ((0..points).collect(), means.collect()))
}

/// The columns of a variant over points instead of rows.
fn columns(
    observations: &Observations,
    points: &[usize],
    variant: &Variant,
    shape: f64,
) -> Vec<Vec<f64>> {
    let of_point = |column: &[f64], point: &usize| {
        let rows = observations.rows.iter().zip(column);
        let own: Vec<f64> = rows
            .filter(|(row, _)| row.pose.is_some() && row.point == *point)
            .map(|(_, value)| *value)
            .collect();
        own.iter().sum::<f64>() / own.len().max(1) as f64
    };
    let columns = variant.columns(observations, shape);
    columns
        .iter()
        .map(|column| {
            points
                .iter()
                .map(|point| of_point(&column.signature, point))
                .collect()
        })
        .collect()
}

/// Values of its nonlinear parameter that are tried; one where it has none.
fn shapes(variant: &Variant) -> Vec<f64> {
    let Some(shape) = &variant.shape else {
        return vec![0.0];
    };
    let step = shape.trials.len().div_ceil(TRIED).max(1);
    shape.trials.iter().copied().step_by(step).collect()
}

/// A unit vector for each way in which an effect can show, each once.
fn directions(
    observations: &Observations,
    points: &[usize],
    variants: &[Variant],
) -> Vec<Vec<f64>> {
    let mut directions: Vec<Vec<f64>> = Vec::new();
    for variant in variants {
        let shapes = shapes(variant);
        let shape = shapes.get(shapes.len() / 2).copied().unwrap_or(0.0);
        let columns = columns(observations, points, variant, shape);
        for (column, parameter) in columns.into_iter().zip(&variant.parameters) {
            let length = dot(&column, &column).sqrt();
            if rms(&column) * parameter.plausible < UNOBSERVABLE {
                continue;
            }
            let unit: Vec<f64> = column.iter().map(|value| value / length).collect();
            if directions
                .iter()
                .all(|known| dot(known, &unit).abs() < 0.999)
            {
                directions.push(unit);
            }
        }
    }
    directions
}
