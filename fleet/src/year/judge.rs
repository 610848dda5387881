//! What was planted against what was found.

use serde::Serialize;

use super::Planted;
use super::charts::{ewma, shewhart};
use crate::trend::hall::{Conclusions, Finding, name};
use crate::trend::series::Series;

/// Half width of a 95 % interval over the standard uncertainty.
const COVERAGE: f64 = 1.96;

/// How one method did.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Score {
    /// Planted changes that it found after their onset.
    pub found: usize,
    /// Sessions of the machine from the onset to the alarm, of those found, ascending.
    pub delays: Vec<usize>,
    /// Alarms without a planted change: on machines that have none yet.
    pub false_alarms: usize,
    /// Sessions without a planted change, over all machines.
    pub quiet_sessions: usize,
}

/// The whole card.
#[derive(Debug, Clone, Serialize)]
pub struct Card {
    /// Planted changes.
    pub planted: usize,
    /// The trends.
    pub trends: Score,
    /// Of the found ones: the interval of the onset holds it.
    pub onsets_covered: usize,
    /// Of the found ones: the 95 % interval of the size holds it.
    pub sizes_covered: usize,
    /// Of the found ones at a service: the service is named.
    pub services_named: usize,
    /// Found ones at a service.
    pub services: usize,
    /// Changes planted in a whole type that are told as common to it.
    pub common_told: usize,
    /// Changes planted in one machine that are told as common to its type.
    pub common_wrongly: usize,
    /// Shewhart chart of each series.
    pub shewhart: Score,
    /// EWMA chart of each series.
    pub ewma: Score,
}

/// Judges conclusions and charts on the same series.
pub fn judge(planted: &[Planted], series: &[Series], conclusions: &Conclusions) -> Card {
    let mut card = Card {
        planted: planted.len(),
        trends: Score::default(),
        onsets_covered: 0,
        sizes_covered: 0,
        services_named: 0,
        services: 0,
        common_told: 0,
        common_wrongly: 0,
        shewhart: Score::default(),
        ewma: Score::default(),
    };
    for one in planted {
        let own = series
            .iter()
            .find(|series| series.machine == one.machine && name(&series.quantity) == one.quantity);
        let Some(own) = own else { continue };
        let hit = |finding: &&Finding| {
            finding.machine == one.machine
                && (finding.quantity == one.quantity || finding.also.contains(&one.quantity))
                && finding.alarm >= one.onset
        };
        if let Some(found) = conclusions.findings.iter().find(hit) {
            card.trends.found += 1;
            card.trends
                .delays
                .push(sessions(own, one.onset, found.alarm));
            // The planted onset lies between two sessions: the last one before it may be told.
            let before = own
                .points
                .iter()
                .rev()
                .find(|point| point.time < found.onset_between[0]);
            let from = before.map_or(f64::NEG_INFINITY, |point| point.time);
            card.onsets_covered +=
                usize::from(from <= one.onset && one.onset <= found.onset_between[1]);
            let same = found.kind == one.kind && found.quantity == one.quantity;
            card.sizes_covered +=
                usize::from(same && (found.size[0] - one.size).abs() <= COVERAGE * found.size[1]);
            card.services += usize::from(one.at_service);
            card.services_named += usize::from(one.at_service && !found.coincides_with.is_empty());
            card.common_told += usize::from(one.common && found.common);
            card.common_wrongly += usize::from(!one.common && found.common);
        }
        let values: Vec<f64> = own.points.iter().map(|point| point.value).collect();
        for (score, alarms) in [
            (&mut card.shewhart, shewhart(&values)),
            (&mut card.ewma, ewma(&values)),
        ] {
            if let Some(alarm) = alarms
                .iter()
                .find(|alarm| own.points[**alarm].time >= one.onset)
            {
                score.found += 1;
                score
                    .delays
                    .push(sessions(own, one.onset, own.points[*alarm].time));
            }
        }
    }
    let begins = |machine: &str| {
        let own = planted.iter().filter(|one| one.machine == machine);
        own.map(|one| one.onset).fold(f64::INFINITY, f64::min)
    };
    let mut machines: Vec<&str> = series.iter().map(|one| one.machine.as_str()).collect();
    machines.sort_unstable();
    machines.dedup();
    for machine in machines {
        let begin = begins(machine);
        let own: Vec<&Series> = series.iter().filter(|one| one.machine == machine).collect();
        let quiet = |one: &Series| one.points.iter().filter(|point| point.time < begin).count();
        let most = own.iter().map(|one| quiet(one)).max().unwrap_or(0);
        let of_trends = conclusions
            .findings
            .iter()
            .filter(|finding| finding.machine == machine && finding.alarm < begin);
        card.trends.false_alarms += of_trends.count();
        card.trends.quiet_sessions += most;
        for (score, alarms) in [
            (&mut card.shewhart, shewhart as fn(&[f64]) -> Vec<usize>),
            (&mut card.ewma, ewma),
        ] {
            score.quiet_sessions += most;
            for one in &own {
                let values: Vec<f64> = one.points.iter().map(|point| point.value).collect();
                score.false_alarms += alarms(&values)
                    .iter()
                    .filter(|alarm| one.points[**alarm].time < begin)
                    .count();
            }
        }
    }
    for score in [&mut card.trends, &mut card.shewhart, &mut card.ewma] {
        score.delays.sort_unstable();
    }
    card
}

/// Sessions of a series from one time to another.
fn sessions(series: &Series, from: f64, to: f64) -> usize {
    series
        .points
        .iter()
        .filter(|point| point.time >= from && point.time <= to)
        .count()
}
