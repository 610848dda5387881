//! Conclusions on all machines of a lake: what changed where, what a type of machine has in common, what was done then.

mod common;
mod hierarchy;
mod text;

use std::collections::BTreeMap;

use serde::Serialize;

use common::{Sizes, in_common};
pub use hierarchy::{Levels, Own, TypeChange};

use super::calibrate::excess;
use super::onset::refined;
use super::series::{Done, Series};
use super::watch::{Change, Kind, Watch};
use super::{Point, Quantity, Spread, crossing, spread};
use crate::lake::Lake;

/// Days between the onsets of machines that are taken for one cause.
const TOGETHER: f64 = 14.0;
/// Fewest machines that have something in common; of large types it is half of them.
const FEWEST: usize = 3;

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Options {
    /// False alarms of a machine in 1,000 of its sessions, over all of its series.
    pub false_alarms: f64,
    /// Limits of quantities, `effect.parameter`, in their unit.
    pub limits: BTreeMap<String, f64>,
}

/// A change of a quantity of a machine.
#[derive(Debug, Clone, Serialize)]
pub struct Finding {
    /// Machine.
    pub machine: String,
    /// Its type.
    pub machine_type: String,
    /// Effect and parameter.
    pub quantity: String,
    /// Unit of the quantity.
    pub unit: String,
    /// `step` or `drift`.
    pub kind: &'static str,
    /// Days since 1970 of the first changed session, as it is most probable.
    pub onset: f64,
    /// From the last session that may be unchanged to the first one that must be changed: the interval holds the change with 95 %.
    pub onset_between: [f64; 2],
    /// Days since 1970 of the session after which it was certain.
    pub alarm: f64,
    /// Step (unit) or slope (unit per day) and its standard uncertainty, from all sessions until the next change.
    pub size: [f64; 2],
    /// Level before the onset, unit.
    pub before: f64,
    /// Level and slope now with their standard uncertainties, from all sessions since the last change of the series.
    pub now: [[f64; 2]; 2],
    /// Days from the last session until it leaves its limit: earliest, expected, latest (2.5 %, 50 %, 97.5 %); absent without a
    /// limit, an end `null` where it is not within ten years.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves_limit_in: Option<[Option<f64>; 3]>,
    /// True: half of the machines of the type have changed alike ([`Conclusions::common`]), or the type as a whole
    /// ([`Conclusions::types`]).
    pub common: bool,
    /// What was done to the machine between the last unchanged and the first changed session.
    pub coincides_with: Vec<String>,
    /// Number of events that would lie there by chance.
    pub by_chance: f64,
    /// Other quantities of the machine that changed then, less clearly: an effect shows in others that resemble it.
    pub also: Vec<String>,
    /// Natural logarithm of the Shiryaev–Roberts statistic at the alarm.
    pub log_statistic: f64,
}

/// A change that the machines of a type have in common.
#[derive(Debug, Clone, Serialize)]
pub struct Common {
    /// Type of the machines.
    pub machine_type: String,
    /// Effect and parameter.
    pub quantity: String,
    /// Unit.
    pub unit: String,
    /// `step` or `drift`.
    pub kind: &'static str,
    /// Days since 1970: median of the machines' onsets.
    pub onset: f64,
    /// Machines that changed.
    pub machines: Vec<String>,
    /// Machines of the type.
    pub of: usize,
    /// Common size with its standard uncertainty.
    pub size: [f64; 2],
    /// Standard deviation of the sizes between machines beyond their uncertainty, median.
    pub between_machines: f64,
    /// What each machine has of its own: its size less the common one.
    pub own: Vec<Own>,
}

/// Conclusions on a lake.
#[derive(Debug, Clone, Serialize)]
pub struct Conclusions {
    /// Machines that were watched.
    pub machines: usize,
    /// Series that were watched.
    pub series: usize,
    /// Points of all series.
    pub points: usize,
    /// False alarms of a machine in 1,000 sessions, at most, in the mean.
    pub false_alarms_per_1000_sessions: f64,
    /// Changes by machine and time.
    pub findings: Vec<Finding>,
    /// Changes that the machines of a type have in common, each found on its machine.
    pub common: Vec<Common>,
    /// Points of the series of types.
    pub type_points: usize,
    /// Changes of the series of types: sooner than on each machine where they are small.
    pub types: Vec<TypeChange>,
    /// Levels by type and machine before any change.
    pub levels: Vec<Levels>,
}

/// What is kept in a lake for the dashboard (`probecell dashboard --lake DIR`).
#[derive(Serialize)]
struct Kept<'c> {
    /// `probecell/trends`.
    schema: &'static str,
    version: u32,
    conclusions: &'c Conclusions,
    series: Vec<Daily<'c>>,
}

/// A series by days: of each day that has sessions its time (days since 1970), mean weighted by uncertainty, and standard
/// uncertainty of the mean.
#[derive(Serialize)]
struct Daily<'c> {
    machine: &'c str,
    effect: &'c str,
    parameter: &'c str,
    unit: &'c str,
    days: Vec<[f64; 3]>,
}

impl Conclusions {
    /// Keeps the conclusions in a lake, with the series that they are of, as `trends.json`.
    ///
    /// # Errors
    /// The lake is a copy behind a URL, or cannot be written.
    pub fn keep(&self, lake: &Lake, series: &[Series]) -> anyhow::Result<()> {
        let daily = |one: &'_ Series| by_day(&one.points);
        let kept = Kept {
            schema: "probecell/trends",
            version: 1,
            conclusions: self,
            series: (series.iter())
                .map(|one| Daily {
                    machine: &one.machine,
                    effect: &one.quantity.effect,
                    parameter: &one.quantity.parameter,
                    unit: &one.quantity.unit,
                    days: daily(one),
                })
                .collect(),
        };
        lake.keep("trends.json", &serde_json::to_vec(&kept)?)
    }
}

fn by_day(points: &[Point]) -> Vec<[f64; 3]> {
    let of_one_day = |a: &Point, b: &Point| a.time.floor() == b.time.floor();
    let mean = |points: &[Point]| {
        // Readings whose noise is zero, or not known, by the differences of few weigh alike.
        let exact = points.iter().any(|one| !(one.uncertainty > 0.0));
        let weight = |one: &Point| if exact { 1.0 } else { one.uncertainty.powi(-2) };
        let whole: f64 = points.iter().map(weight).sum();
        let mean = |of: fn(&Point) -> f64| {
            points.iter().map(|one| weight(one) * of(one)).sum::<f64>() / whole
        };
        let uncertainty = if exact { 0.0 } else { whole.sqrt().recip() };
        [mean(|one| one.time), mean(|one| one.value), uncertainty]
    };
    points.chunk_by(of_one_day).map(mean).collect()
}

/// A change with what it belongs to.
struct Found<'s> {
    series: &'s Series,
    spread: Spread,
    change: Change,
    last: super::Level,
    common: bool,
}

impl Found<'_> {
    fn time(&self, point: usize) -> f64 {
        self.series.points[point].time
    }

    fn onset(&self) -> f64 {
        self.time(self.change.onset)
    }

    /// From the last session that may be unchanged to the first that must be changed.
    fn window(&self) -> [f64; 2] {
        let [low, high] = self.change.between;
        [self.time(low.saturating_sub(1)), self.time(high)]
    }
}

/// Watches all series.
pub fn conclude(
    series: &[Series],
    events: &BTreeMap<String, Vec<Done>>,
    options: &Options,
) -> Conclusions {
    let mut by_kind: BTreeMap<(&str, &Quantity), Vec<&Series>> = BTreeMap::new();
    let mut of_machine: BTreeMap<&str, usize> = BTreeMap::new();
    for one in series {
        by_kind
            .entry((&one.machine_type, &one.quantity))
            .or_default()
            .push(one);
        *of_machine.entry(&one.machine).or_default() += 1;
    }
    let (mut common, mut levels, mut of_types) = (Vec::new(), Vec::new(), Vec::new());
    let mut type_points = 0;
    let mut all: Vec<Found<'_>> = Vec::new();
    let kinds: Vec<&Vec<&Series>> = by_kind.values().collect();
    let watched = crate::parallel::map(&kinds, |alike| {
        let points: Vec<&[super::Point]> = alike.iter().map(|one| one.points.as_slice()).collect();
        let spread = spread(&points);
        let excess = excess(&points, &spread);
        let mut found = Vec::new();
        for one in *alike {
            let sessions = of_machine[one.machine.as_str()] as f64 * 1000.0 / options.false_alarms;
            found.extend(changes(one, spread, sessions / excess));
        }
        (spread, found)
    });
    for (alike, (spread, mut found)) in kinds.into_iter().zip(watched) {
        common.extend(in_common(&mut found, alike.len()));
        levels.extend(hierarchy::levels(alike, &found, spread));
        if let Some(of_type) = hierarchy::series_of_type(alike, &found, spread) {
            type_points += of_type.points.len();
            of_types.push(of_type);
        }
        all.extend(found);
    }
    let mut types = Vec::new();
    for one in &of_types {
        let others = of_types
            .iter()
            .filter(|other| other.machine_type == one.machine_type);
        let points = others.count() as f64 * 1000.0 / options.false_alarms;
        types.extend(hierarchy::type_changes(one, points));
    }
    for found in &mut all {
        found.common |= types.iter().any(|change| change.covers(found));
    }
    Conclusions {
        machines: of_machine.len(),
        series: series.len(),
        points: series.iter().map(|one| one.points.len()).sum(),
        false_alarms_per_1000_sessions: options.false_alarms,
        findings: merged(all, events, options),
        common,
        type_points,
        types,
        levels,
    }
}

fn changes(series: &Series, spread: Spread, limit: f64) -> Vec<Found<'_>> {
    let mut watch = Watch::new(spread, limit);
    let found: Vec<Change> = series
        .points
        .iter()
        .filter_map(|point| watch.push(point))
        .collect();
    let refined = refined(&series.points, &spread, &found);
    let Some(last) = refined.last().map(|change| change.after) else {
        return Vec::new();
    };
    let of = |change: Change| Found {
        series,
        spread,
        last,
        change,
        common: false,
    };
    refined.into_iter().map(of).collect()
}

/// One finding for the changes of a machine that may have begun together: the clearest, and what else changed.
fn merged(
    mut all: Vec<Found<'_>>,
    events: &BTreeMap<String, Vec<Done>>,
    options: &Options,
) -> Vec<Finding> {
    all.sort_by(|a, b| b.change.log_statistic.total_cmp(&a.change.log_statistic));
    let mut findings: Vec<(Finding, [f64; 2])> = Vec::new();
    for found in &all {
        let window = found.window();
        let own = name(&found.series.quantity);
        let same = findings.iter_mut().find(|(finding, other)| {
            finding.machine == found.series.machine
                && finding.quantity != own
                && window[0] <= other[1]
                && other[0] <= window[1]
        });
        if let Some((finding, _)) = same {
            if !finding.also.contains(&own) {
                finding.also.push(own);
            }
            continue;
        }
        findings.push((
            finding(found, events.get(&found.series.machine), options),
            window,
        ));
    }
    let mut findings: Vec<Finding> = findings.into_iter().map(|(finding, _)| finding).collect();
    findings.sort_by(|a, b| a.machine.cmp(&b.machine).then(a.onset.total_cmp(&b.onset)));
    findings
}

fn finding(found: &Found<'_>, events: Option<&Vec<Done>>, options: &Options) -> Finding {
    let Found {
        series,
        spread,
        change,
        last,
        common,
    } = found;
    let quantity = name(&series.quantity);
    let window = found.window();
    let events = events.map_or(&[][..], Vec::as_slice);
    let within = events
        .iter()
        .filter(|event| event.time > window[0] && event.time <= window[1]);
    let span = series.points.last().map_or(0.0, |point| point.time) - series.points[0].time;
    let leaves = options.limits.get(&quantity).map(|limit| {
        let crossing = crossing(last, spread, *limit);
        [crossing.earliest, crossing.expected, crossing.latest]
            .map(|days| days.is_finite().then_some(days))
    });
    let text = |event: &Done| {
        format!("{}: {}", event.kind, event.text)
            .trim_end_matches(": ")
            .to_owned()
    };
    Finding {
        machine: series.machine.clone(),
        machine_type: series.machine_type.clone(),
        quantity,
        unit: series.quantity.unit.clone(),
        kind: word(change.kind),
        onset: found.onset(),
        onset_between: window,
        alarm: found.time(change.alarm),
        size: change.size,
        before: change.before,
        now: [
            [last.level, last.covariance[0].max(0.0).sqrt()],
            [last.slope, last.covariance[2].max(0.0).sqrt()],
        ],
        leaves_limit_in: leaves,
        common: *common,
        coincides_with: within.map(text).collect(),
        by_chance: events.len() as f64 * (window[1] - window[0]) / span.max(f64::MIN_POSITIVE),
        also: Vec::new(),
        log_statistic: change.log_statistic,
    }
}

/// `effect.parameter`.
pub fn name(quantity: &Quantity) -> String {
    format!("{}.{}", quantity.effect, quantity.parameter)
}

fn word(kind: Kind) -> &'static str {
    match kind {
        Kind::Step => "step",
        Kind::Drift => "drift",
    }
}
