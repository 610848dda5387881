//! What is compared of real and simulated residuals.

use effects::Observations;
use metrology::statistics::{mean, rms};
use serde::Serialize;

use super::Quantile;
use super::draws::Pair;

/// Fewest touches of a group that is compared by itself.
const FEWEST: usize = 5;
/// Parts into which the time of the session is divided.
const PARTS_OF_TIME: usize = 3;
/// Ordered residuals that a picture shows.
const QUANTILES: usize = 99;

/// A statistic of the residuals of the session, among those of simulated sessions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistic {
    /// `all`, `feature`, `direction` or `time`.
    pub dimension: &'static str,
    /// Which of them; empty for all.
    pub key: String,
    /// `rms`, `mean`, `lag-1 correlation` or `largest`.
    pub statistic: &'static str,
    /// m, or 1 for a correlation.
    pub unit: &'static str,
    /// Touches.
    pub touches: usize,
    /// Of the session, mean over the draws of the parameters.
    pub real: f64,
    /// 2.5 %, 50 % and 97.5 % of the simulated sessions.
    pub simulated: [f64; 3],
    /// Two-sided posterior predictive p, (k + 1)/(draws + 1) at least.
    pub p: f64,
    /// True where it contradicts the model.
    pub contradicts: bool,
}

/// Touches that are compared together.
struct Group {
    dimension: &'static str,
    key: String,
    /// Indices of the residuals.
    members: Vec<usize>,
}

/// Groups of the touches of a session.
pub(super) struct Groups(Vec<Group>);

impl Groups {
    /// All; each feature, direction of the normal and third of the time with enough touches, those of other touches than the
    /// groups before.
    pub(super) fn of(observations: &Observations, rows: &[usize]) -> Self {
        let mut groups = vec![Group {
            dimension: "all",
            key: String::new(),
            members: (0..rows.len()).collect(),
        }];
        let mut add = |dimension: &'static str, all: Vec<(String, Vec<usize>)>| {
            for (key, members) in all {
                if members.len() >= FEWEST && groups.iter().all(|known| known.members != members) {
                    groups.push(Group {
                        dimension,
                        key,
                        members,
                    });
                }
            }
        };
        let those = |wanted: &dyn Fn(usize) -> bool| -> Vec<usize> {
            let numbered = rows.iter().enumerate();
            numbered
                .filter(|&(_, &row)| wanted(row))
                .map(|(index, _)| index)
                .collect()
        };
        let features = observations.features.iter().enumerate();
        add(
            "feature",
            features
                .map(|(index, name)| {
                    let members = those(&|row| observations.rows[row].feature == index);
                    (name.clone(), members)
                })
                .collect(),
        );
        let mut directions = Vec::new();
        for (axis, name) in ["x", "y", "z"].iter().enumerate() {
            for (sign, letter) in [(1.0, "+"), (-1.0, "-")] {
                let members = those(&|row| observations.rows[row].faces(axis, sign));
                directions.push((format!("{letter}{name}"), members));
            }
        }
        add("direction", directions);
        let thirds = (0..PARTS_OF_TIME).map(|part| {
            let bound = |part: usize| part * rows.len() / PARTS_OF_TIME;
            let members = (bound(part)..bound(part + 1)).collect();
            (format!("{} of {PARTS_OF_TIME}", part + 1), members)
        });
        add("time", thirds.collect());
        Self(groups)
    }

    /// Number of statistics.
    pub(super) fn count(&self) -> usize {
        self.0.iter().map(|group| group.measures().count()).sum()
    }

    /// Every statistic, from real and simulated residuals draw by draw.
    pub(super) fn statistics(&self, pairs: &[Pair]) -> Vec<Statistic> {
        let measured = |group: &Group| -> Vec<Statistic> {
            let judge = |measure: &Measure| group.judge(measure, pairs);
            group.measures().map(judge).collect()
        };
        self.0.iter().flat_map(measured).collect()
    }
}

impl Group {
    /// What is compared of it.
    fn measures(&self) -> impl Iterator<Item = &'static Measure> {
        let overall = self.dimension == "all";
        let more = if overall { OVERALL } else { &[] };
        MEASURES.iter().chain(more)
    }

    fn judge(&self, measure: &Measure, pairs: &[Pair]) -> Statistic {
        let of = |values: &[f64]| {
            let picked: Vec<f64> = self.members.iter().map(|&index| values[index]).collect();
            (measure.of)(&picked)
        };
        let values: Vec<(f64, f64)> = (pairs.iter())
            .map(|(real, simulated)| (of(real), of(simulated)))
            .collect();
        let (real, mut simulated): (Vec<f64>, Vec<f64>) = values.iter().copied().unzip();
        simulated.sort_by(f64::total_cmp);
        Statistic {
            dimension: self.dimension,
            key: self.key.clone(),
            statistic: measure.name,
            unit: measure.unit,
            touches: self.members.len(),
            real: mean(&real),
            simulated: [0.025, 0.5, 0.975].map(|share| at(&simulated, share)),
            p: two_sided(&values),
            contradicts: false,
        }
    }
}

/// A number of the residuals of a group.
struct Measure {
    name: &'static str,
    unit: &'static str,
    of: fn(&[f64]) -> f64,
}

impl Measure {
    const fn new(name: &'static str, unit: &'static str, of: fn(&[f64]) -> f64) -> Self {
        Self { name, unit, of }
    }
}

/// Of every group.
const MEASURES: &[Measure] = &[
    Measure::new("rms", "m", rms),
    Measure::new("mean", "m", mean),
];
/// Of all touches together as well.
const OVERALL: &[Measure] = &[
    Measure::new("lag-1 correlation", "1", lag1),
    Measure::new("largest", "m", largest),
];

/// Twice the smaller tail: the share of draws in which the simulated value is at least, or at most, the real one.
fn two_sided(values: &[(f64, f64)]) -> f64 {
    let share = |count: usize| (count as f64 + 1.0) / (values.len() as f64 + 1.0);
    let above = values
        .iter()
        .filter(|(real, simulated)| simulated >= real)
        .count();
    let below = values
        .iter()
        .filter(|(real, simulated)| simulated <= real)
        .count();
    (2.0 * share(above.min(below))).min(1.0)
}

fn lag1(values: &[f64]) -> f64 {
    let along: f64 = values.windows(2).map(|pair| pair[0] * pair[1]).sum();
    along
        / values
            .iter()
            .map(|value| value * value)
            .sum::<f64>()
            .max(f64::MIN_POSITIVE)
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| value.abs().max(most))
}

/// The value below which this share of the ordered values lies.
fn at(ordered: &[f64], share: f64) -> f64 {
    let last = ordered.len().saturating_sub(1);
    ordered
        .get((share * last as f64).round() as usize)
        .copied()
        .unwrap_or(f64::NAN)
}

/// Quantiles of the residuals: the real ones beside those of the simulated sessions.
pub(super) fn quantiles(pairs: &[Pair]) -> Vec<Quantile> {
    let ordered = |values: &[f64]| {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        values
    };
    let all: Vec<(Vec<f64>, Vec<f64>)> = (pairs.iter())
        .map(|(real, simulated)| (ordered(real), ordered(simulated)))
        .collect();
    let quantile = |number: usize| {
        let share = (number + 1) as f64 / (QUANTILES + 1) as f64;
        let real: Vec<f64> = all.iter().map(|(real, _)| at(real, share)).collect();
        let mut simulated: Vec<f64> = all
            .iter()
            .map(|(_, simulated)| at(simulated, share))
            .collect();
        simulated.sort_by(f64::total_cmp);
        Quantile {
            share,
            real: mean(&real),
            simulated: [0.025, 0.5, 0.975].map(|share| at(&simulated, share)),
        }
    };
    (0..QUANTILES).map(quantile).collect()
}
