//! What a type of machine has in common and what is one machine's own: levels, and changes of the type as a whole.
//!
//! A quantity of a session is the mean of the type, what the machine has of its own, and what the session adds. Changes of the
//! whole type are watched in a series of its own: the median over the machines, each against its own beginning, without
//! those that have changed alone. The median is less uncertain than one machine, so that a fault of the type that is small on each
//! machine is seen sooner.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{FEWEST, Found, Sizes, Spread, TOGETHER, name, word};
use crate::trend::calibrate::excess;
use crate::trend::onset::refined;
use crate::trend::series::Series;
use crate::trend::{Change, Point, Quantity, Watch, spread};

/// Points of each machine against whose mean it is compared.
const FIRST: usize = 30;
/// Days over which the machines of a type are compared, as short as most of them allow.
const INTERVALS: [f64; 6] = [1.0, 2.0, 4.0, 7.0, 14.0, 30.0];
/// Share of the intervals in which enough machines must have a session.
const FILLED: f64 = 0.9;
/// Standard deviation of a median over that of the mean of normal values, sqrt(pi / 2).
const OF_MEDIAN: f64 = 1.253_314_137_315_500_3;

/// What a machine has of its own beyond its type.
#[derive(Debug, Clone, Serialize)]
pub struct Own {
    /// Machine.
    pub machine: String,
    /// Its part with its standard uncertainty.
    pub size: [f64; 2],
}

/// Levels of a quantity over the machines of a type, before their first change.
#[derive(Debug, Clone, Serialize)]
pub struct Levels {
    /// Type of the machines.
    pub machine_type: String,
    /// Effect and parameter.
    pub quantity: String,
    /// Unit.
    pub unit: String,
    /// Mean over the machines with its standard uncertainty.
    pub mean: [f64; 2],
    /// Standard deviation between machines.
    pub between_machines: f64,
    /// Standard deviation between sessions of a machine beyond their uncertainty.
    pub between_sessions: f64,
    /// What each machine has of its own.
    pub own: Vec<Own>,
}

/// A change of a quantity of a type as a whole.
#[derive(Debug, Clone, Serialize)]
pub struct TypeChange {
    /// Type of the machines.
    pub machine_type: String,
    /// Effect and parameter.
    pub quantity: String,
    /// Unit.
    pub unit: String,
    /// `step` or `drift`.
    pub kind: &'static str,
    /// Days since 1970: the most probable, and the interval that holds 95 %.
    pub onset: f64,
    /// See `onset`.
    pub onset_between: [f64; 2],
    /// Days since 1970 when it was certain.
    pub alarm: f64,
    /// Step (unit) or slope (unit per day) with its standard uncertainty, at the alarm.
    pub size: [f64; 2],
}

impl TypeChange {
    /// True for a change of a machine of this type, in this quantity and direction and at the same time.
    pub(super) fn covers(&self, found: &Found<'_>) -> bool {
        let [low, high] = found.change.between.map(|point| found.time(point));
        self.machine_type == found.series.machine_type
            && self.quantity == name(&found.series.quantity)
            && (self.size[0] > 0.0) == (found.change.size[0] > 0.0)
            && low <= self.onset_between[1] + TOGETHER
            && self.onset_between[0] - TOGETHER <= high
    }
}

/// Levels of the series of one quantity and type; none of a single machine.
pub(super) fn levels<'s>(
    alike: &[&'s Series],
    found: &[Found<'_>],
    spread: Spread,
) -> Option<Levels> {
    let first = alike.first()?;
    let level = |one: &'s Series| {
        let change = found
            .iter()
            .filter(|found| found.series.machine == one.machine)
            .map(Found::onset)
            .fold(f64::INFINITY, f64::min);
        let before: Vec<&Point> = one
            .points
            .iter()
            .filter(|point| point.time < change)
            .collect();
        let weight = |point: &&Point| 1.0 / spread.variance(point).max(f64::MIN_POSITIVE);
        let total: f64 = before.iter().map(weight).sum();
        let sum: f64 = before.iter().map(|point| weight(point) * point.value).sum();
        (total > 0.0).then(|| (one.machine.as_str(), [sum / total, total.sqrt().recip()]))
    };
    let levels: Vec<(&str, [f64; 2])> = alike.iter().copied().filter_map(level).collect();
    if levels.len() < 2 {
        return None;
    }
    let sizes: Vec<[f64; 2]> = levels.iter().map(|(_, size)| *size).collect();
    let sizes = Sizes::new(&sizes);
    Some(Levels {
        machine_type: first.machine_type.clone(),
        quantity: name(&first.quantity),
        unit: first.quantity.unit.clone(),
        mean: sizes.mean(),
        between_machines: sizes.between(),
        between_sessions: spread.repeatability.sqrt(),
        own: sizes.own(levels),
    })
}

/// The series of a type.
pub(super) struct OfType {
    pub(super) machine_type: String,
    quantity: Quantity,
    pub(super) points: Vec<Point>,
}

/// The median over the machines of a type, each against the mean of its first points, until it changes alone (one machine
/// that has moved away shifts the median as well, by half a rank); none of fewer than three machines, or where too few have
/// sessions at the same time.
pub(super) fn series_of_type(
    alike: &[&Series],
    found: &[Found<'_>],
    spread: Spread,
) -> Option<OfType> {
    let first = alike.first()?;
    let fewest = FEWEST.max(alike.len().div_ceil(2));
    if alike.len() < fewest {
        return None;
    }
    let unchanged = |one: &Series| {
        let alone = found
            .iter()
            .filter(|found| found.series.machine == one.machine && !found.common)
            .map(|found| found.change.onset);
        one.points[..alone.min().unwrap_or(one.points.len())].to_vec()
    };
    let alike: Vec<Vec<Point>> = alike.iter().map(|one| unchanged(one)).collect();
    let points = INTERVALS
        .iter()
        .find_map(|days| medians(&alike, spread, *days, fewest))?;
    Some(OfType {
        machine_type: first.machine_type.clone(),
        quantity: first.quantity.clone(),
        points,
    })
}

/// Medians over intervals of so many days; none where less than [`FILLED`] of the intervals hold enough machines.
fn medians(alike: &[Vec<Point>], spread: Spread, days: f64, fewest: usize) -> Option<Vec<Point>> {
    // By interval: of each machine the sum of its values, of their variances, and their number; times.
    let mut intervals: BTreeMap<i64, Vec<Point>> = BTreeMap::new();
    for one in alike {
        let begun = &one[..one.len().min(FIRST)];
        if begun.is_empty() {
            continue;
        }
        let values: Vec<f64> = begun.iter().map(|point| point.value).collect();
        let base = metrology::statistics::mean(&values);
        let of_base = begun
            .iter()
            .map(|point| spread.variance(point))
            .sum::<f64>()
            / (begun.len() as f64).powi(2);
        let interval = |point: &Point| (point.time / days).floor() as i64;
        for own in one.chunk_by(|a, b| interval(a) == interval(b)) {
            let count = own.len() as f64;
            let mean = |of: &dyn Fn(&Point) -> f64| own.iter().map(of).sum::<f64>() / count;
            let variance = mean(&|point| spread.variance(point)) / count + of_base;
            intervals.entry(interval(&own[0])).or_default().push(Point {
                time: mean(&|point| point.time),
                value: mean(&|point| point.value) - base,
                uncertainty: variance.sqrt(),
            });
        }
    }
    let span = intervals.last_key_value()?.0 - intervals.first_key_value()?.0 + 1;
    let mut points = Vec::new();
    for machines in intervals.into_values().filter(|own| own.len() >= fewest) {
        let count = machines.len() as f64;
        let values: Vec<f64> = machines.iter().map(|point| point.value).collect();
        let variance = machines
            .iter()
            .map(|point| point.uncertainty.powi(2))
            .sum::<f64>()
            / count;
        points.push(Point {
            time: machines
                .iter()
                .map(|point| point.time)
                .fold(f64::NEG_INFINITY, f64::max),
            value: metrology::statistics::median(&values),
            uncertainty: OF_MEDIAN * (variance / count).sqrt(),
        });
    }
    (points.len() as f64 >= FILLED * span as f64).then_some(points)
}

/// Changes of the series of a type, with one false alarm in so many of its points in the mean.
pub(super) fn type_changes(of_type: &OfType, points: f64) -> Vec<TypeChange> {
    let series = &of_type.points;
    let spread = spread(&[series]);
    let mut watch = Watch::new(spread, points / excess(&[series], &spread));
    let changes: Vec<Change> = series
        .iter()
        .filter_map(|point| watch.push(point))
        .collect();
    let time = |point: usize| series[point].time;
    let told = |change: Change| TypeChange {
        machine_type: of_type.machine_type.clone(),
        quantity: name(&of_type.quantity),
        unit: of_type.quantity.unit.clone(),
        kind: word(change.kind),
        onset: time(change.onset),
        onset_between: [
            time(change.between[0].saturating_sub(1)),
            time(change.between[1]),
        ],
        alarm: time(change.alarm),
        size: change.size,
    };
    refined(series, &spread, &changes)
        .into_iter()
        .map(told)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    /// Twelve machines, each with a level of its own, all of whose levels grow by a hundredth of a point's deviation a day from
    /// day 150 on; one machine steps alone on day 60.
    fn hall(drift: f64) -> Vec<Series> {
        let mut random = Pcg64Mcg::seed_from_u64(11);
        (0..12)
            .map(|number| {
                let own = 5.0 * random.sample::<f64, _>(StandardNormal);
                let point = |day: usize| {
                    let time = day as f64 + 0.05 * f64::from(number);
                    let step = if number == 4 && day >= 60 { 6.0 } else { 0.0 };
                    Point {
                        time,
                        value: own
                            + step
                            + drift * (time - 150.0).max(0.0)
                            + random.sample::<f64, _>(StandardNormal),
                        uncertainty: 1.0,
                    }
                };
                Series {
                    machine: format!("mill_{number}"),
                    machine_type: "mill".to_owned(),
                    quantity: Quantity {
                        effect: "axis.X.scale".to_owned(),
                        parameter: "k".to_owned(),
                        unit: "1".to_owned(),
                    },
                    points: (0..365).map(point).collect(),
                }
            })
            .collect()
    }

    #[test]
    fn a_fault_of_the_type_is_told_from_that_of_one_machine_and_seen_sooner() {
        let options = super::super::Options {
            false_alarms: 0.1,
            limits: [].into(),
        };
        let drifting = super::super::conclude(&hall(0.01), &BTreeMap::new(), &options);
        let [of_type] = drifting.types.as_slice() else {
            panic!("{:?}", drifting.types);
        };
        assert!(
            of_type.kind == "drift" && of_type.alarm >= 150.0,
            "{of_type:?}"
        );
        let alone = drifting
            .findings
            .iter()
            .find(|found| found.machine == "mill_4" && found.alarm < 100.0);
        assert!(alone.is_some_and(|found| found.kind == "step" && !found.common));
        let first = |machine: &str| {
            drifting
                .findings
                .iter()
                .filter(|found| found.machine == machine && found.alarm > 150.0)
                .map(|found| found.alarm)
                .fold(f64::INFINITY, f64::min)
        };
        let mut alarms: Vec<f64> = (0..12)
            .map(|number| first(&format!("mill_{number}")))
            .collect();
        alarms.sort_by(f64::total_cmp);
        assert!(of_type.alarm < alarms[6], "{of_type:?} {alarms:?}");
        let quiet = super::super::conclude(&hall(0.0), &BTreeMap::new(), &options);
        assert!(
            quiet.types.is_empty() && quiet.common.is_empty(),
            "{:?}",
            quiet.types
        );
        // Levels between machines were drawn with a standard deviation of 5.
        let [levels] = quiet.levels.as_slice() else {
            panic!("{:?}", quiet.levels);
        };
        assert!(
            (levels.between_machines - 5.0).abs() < 3.0 * 5.0 / 22.0_f64.sqrt(),
            "{levels:?}"
        );
        assert_eq!(levels.own.len(), 12);
    }
}
