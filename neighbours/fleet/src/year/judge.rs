//! What was planted against what was found.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Planted;
use super::charts::Chart;
use crate::trend::hall::{Conclusions, Finding, name};
use crate::trend::series::Series;
use crate::trend::watch::quantile95;

/// How one method did.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Score {
    /// Planted changes that it found after their onset.
    pub found: usize,
    /// Sessions of the machine from the onset to the alarm, of those found, ascending.
    pub delays: Vec<usize>,
    /// Alarms on machines before anything was planted there.
    pub false_alarms: usize,
    /// Sessions before anything was planted, over all machines.
    pub quiet_sessions: usize,
}

/// How often a stated interval held the truth.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Coverage {
    /// Intervals that held it.
    pub held: usize,
    /// Intervals.
    pub of: usize,
}

impl Coverage {
    fn count(&mut self, held: bool) {
        self.of += 1;
        self.held += usize::from(held);
    }
}

/// A change of a whole type.
#[derive(Debug, Clone, Serialize)]
pub struct OfType {
    /// Type of the machines.
    pub machine_type: String,
    /// Effect and parameter.
    pub quantity: String,
    /// Days from the onset until the type's own series alarmed; none where it did not.
    pub type_days: Option<f64>,
    /// Days until the first and the median machine alarmed; none where fewer did.
    pub machine_days: [Option<f64>; 2],
}

/// The whole card.
#[derive(Debug, Clone, Serialize)]
pub struct Card {
    /// Planted changes, by machine.
    pub planted: usize,
    /// The trends.
    pub trends: Score,
    /// Findings on machines with a planted change, after it, of quantities in which none was planted.
    pub other_findings: usize,
    /// Intervals of the onset, 95 %.
    pub onsets: Coverage,
    /// Intervals of the size, 95 %, of those told as what they are, a step or a drift.
    pub sizes: Coverage,
    /// Of each of them: quantity, kind, and by how many standard uncertainties the size is off.
    pub sizes_off: Vec<(String, String, f64)>,
    /// Found ones at a service: the service is named.
    pub services: Coverage,
    /// Found ones that were planted in a whole type: told as common to it.
    pub common: Coverage,
    /// Found ones that were planted in one machine: told as its own.
    pub own: Coverage,
    /// Intervals of what a machine has of its own in a common change, 95 %.
    pub own_parts: Coverage,
    /// Changes of whole types, by the type's series and by machine.
    pub types: Vec<OfType>,
    /// Changes of a type's series that were not planted.
    pub type_false_alarms: usize,
    /// Points of the series of types.
    pub type_points: usize,
    /// Control charts of each series: at their usual limits, and at those of the stated rate of the trends.
    pub charts: BTreeMap<&'static str, Score>,
}

/// Judges conclusions and charts on the same series.
pub fn judge(planted: &[Planted], series: &[Series], conclusions: &Conclusions) -> Card {
    let mut card = Card {
        planted: planted.len(),
        trends: Score::default(),
        other_findings: 0,
        onsets: Coverage::default(),
        sizes: Coverage::default(),
        sizes_off: Vec::new(),
        services: Coverage::default(),
        common: Coverage::default(),
        own: Coverage::default(),
        own_parts: Coverage::default(),
        types: of_types(planted, series, conclusions),
        type_false_alarms: type_false_alarms(planted, series, conclusions),
        type_points: conclusions.type_points,
        charts: BTreeMap::new(),
    };
    for one in planted {
        let own = series_of(series, one);
        let finding = conclusions.findings.iter().find(|found| hits(found, one));
        if let (Some(own), Some(found)) = (own, finding) {
            card.trends.found += 1;
            card.trends
                .delays
                .push(sessions(own, one.onset, found.alarm));
            card.intervals(one, own, found, conclusions);
        }
    }
    for machine in machines(series) {
        let begin = begins(planted, machine);
        card.trends.quiet_sessions += quiet_sessions(series, machine, begin);
        let expected = |found: &Finding| {
            planted.iter().any(|one| {
                one.machine == machine
                    && (one.quantity == found.quantity || found.also.contains(&one.quantity))
            })
        };
        for found in conclusions
            .findings
            .iter()
            .filter(|found| found.machine == machine)
        {
            card.trends.false_alarms += usize::from(found.alarm < begin);
            card.other_findings += usize::from(found.alarm >= begin && !expected(found));
        }
    }
    card.trends.delays.sort_unstable();
    let rate = conclusions.false_alarms_per_1000_sessions;
    for (names, same_rate) in [
        (["Shewhart, 3 σ", "EWMA, L = 2.962"], false),
        (["Shewhart, stated rate", "EWMA, stated rate"], true),
    ] {
        for (name, chart) in names.into_iter().zip(Chart::USUAL) {
            let wanted = same_rate.then_some(1000.0 / rate);
            card.charts
                .insert(name, chart_score(planted, series, chart, wanted));
        }
    }
    card
}

impl Card {
    /// Counts the intervals of a planted change that was found.
    fn intervals(
        &mut self,
        one: &Planted,
        own: &Series,
        found: &Finding,
        conclusions: &Conclusions,
    ) {
        let [from, to] = found.onset_between;
        self.onsets.count(from <= one.onset && one.onset <= to);
        if found.kind == one.kind && found.quantity == one.quantity {
            let off = (found.size[0] - one.size) / found.size[1].max(f64::MIN_POSITIVE);
            self.sizes.count(off.abs() <= quantile95());
            self.sizes_off.push((
                one.quantity.clone(),
                one.kind.clone(),
                (off * 100.0).round() / 100.0,
            ));
        }
        if one.at_service {
            self.services.count(!found.coincides_with.is_empty());
        }
        if one.common {
            self.common.count(found.common);
            let common = conclusions.common.iter().find(|common| {
                common.machine_type == own.machine_type && common.quantity == one.quantity
            });
            let part = common
                .and_then(|common| common.own.iter().find(|part| part.machine == one.machine));
            if let Some(part) = part {
                let off = (part.size[0] - one.own_size).abs();
                self.own_parts.count(off <= quantile95() * part.size[1]);
            }
        } else {
            self.own.count(!found.common);
        }
    }
}

/// True for a finding of a planted change.
fn hits(found: &Finding, one: &Planted) -> bool {
    found.machine == one.machine
        && (found.quantity == one.quantity || found.also.contains(&one.quantity))
        && found.alarm >= one.onset
}

fn series_of<'s>(series: &'s [Series], one: &Planted) -> Option<&'s Series> {
    series
        .iter()
        .find(|series| series.machine == one.machine && name(&series.quantity) == one.quantity)
}

fn machines(series: &[Series]) -> Vec<&str> {
    let mut machines: Vec<&str> = series.iter().map(|one| one.machine.as_str()).collect();
    machines.sort_unstable();
    machines.dedup();
    machines
}

/// When the first change of a machine begins.
fn begins(planted: &[Planted], machine: &str) -> f64 {
    let own = planted.iter().filter(|one| one.machine == machine);
    own.map(|one| one.onset).fold(f64::INFINITY, f64::min)
}

/// Sessions of a machine before a time: those of its longest series.
fn quiet_sessions(series: &[Series], machine: &str, before: f64) -> usize {
    let own = series.iter().filter(|one| one.machine == machine);
    own.map(|one| {
        one.points
            .iter()
            .filter(|point| point.time < before)
            .count()
    })
    .max()
    .unwrap_or(0)
}

/// How a chart of each series does; with limits at which a machine has a false alarm in `wanted` sessions, over all of its series.
fn chart_score(planted: &[Planted], series: &[Series], chart: Chart, wanted: Option<f64>) -> Score {
    let mut score = Score::default();
    for machine in machines(series) {
        let own: Vec<&Series> = series.iter().filter(|one| one.machine == machine).collect();
        let chart = wanted.map_or(chart, |sessions| {
            chart.with_run_length(sessions * own.len() as f64)
        });
        let begin = begins(planted, machine);
        score.quiet_sessions += quiet_sessions(series, machine, begin);
        for one in own {
            let values: Vec<f64> = one.points.iter().map(|point| point.value).collect();
            let alarms: Vec<f64> = chart
                .alarms(&values)
                .into_iter()
                .map(|place| one.points[place].time)
                .collect();
            score.false_alarms += alarms.iter().filter(|time| **time < begin).count();
            let mine = planted.iter().filter(|planted| {
                planted.machine == machine && planted.quantity == name(&one.quantity)
            });
            for planted in mine {
                if let Some(alarm) = alarms.iter().find(|time| **time >= planted.onset) {
                    score.found += 1;
                    score.delays.push(sessions(one, planted.onset, *alarm));
                }
            }
        }
    }
    score.delays.sort_unstable();
    score
}

/// Types and quantities in which a common change was planted, with its onset.
fn common_of<'s>(planted: &[Planted], series: &'s [Series]) -> Vec<(&'s str, String, f64)> {
    let mut found: Vec<(&str, String, f64)> = planted
        .iter()
        .filter(|one| one.common)
        .filter_map(|one| {
            let own = series_of(series, one)?;
            Some((own.machine_type.as_str(), one.quantity.clone(), one.onset))
        })
        .collect();
    found.sort_by(|a, b| a.0.cmp(b.0).then(a.1.cmp(&b.1)).then(a.2.total_cmp(&b.2)));
    found.dedup();
    found
}

fn of_types(planted: &[Planted], series: &[Series], conclusions: &Conclusions) -> Vec<OfType> {
    let one = |(machine_type, quantity, onset): (&str, String, f64)| {
        let of_type = conclusions.types.iter().find(|change| {
            change.machine_type == machine_type
                && change.quantity == quantity
                && change.alarm >= onset
        });
        let mut alarms: Vec<f64> = planted
            .iter()
            .filter(|one| one.common && one.quantity == quantity && one.onset == onset)
            .filter_map(|one| conclusions.findings.iter().find(|found| hits(found, one)))
            .map(|found| found.alarm - onset)
            .collect();
        let machines = planted
            .iter()
            .filter(|one| one.common && one.quantity == quantity && one.onset == onset)
            .count();
        alarms.sort_by(f64::total_cmp);
        OfType {
            machine_type: machine_type.to_owned(),
            type_days: of_type.map(|change| change.alarm - onset),
            machine_days: [0, machines / 2].map(|place| alarms.get(place).copied()),
            quantity,
        }
    };
    common_of(planted, series).into_iter().map(one).collect()
}

fn type_false_alarms(planted: &[Planted], series: &[Series], conclusions: &Conclusions) -> usize {
    let common = common_of(planted, series);
    let wrong = |change: &&crate::trend::hall::TypeChange| {
        !common.iter().any(|(machine_type, quantity, onset)| {
            change.machine_type == *machine_type
                && change.quantity == *quantity
                && change.alarm >= *onset
        })
    };
    conclusions.types.iter().filter(wrong).count()
}

/// Sessions of a series from one time to another.
fn sessions(series: &Series, from: f64, to: f64) -> usize {
    series
        .points
        .iter()
        .filter(|point| point.time >= from && point.time <= to)
        .count()
}
