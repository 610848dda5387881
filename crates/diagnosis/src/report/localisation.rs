//! Localises the energy of deviations and residuals by feature, direction, time, region and axis.
//!
//! Shares of the sum of squares; intervals in m, rad or s from the start of the session.

use crate::report::Place;
use effects::observation::{Observations, Row};
use inference::discrepancy::Kind;
use inference::posterior::ModelPosterior;

/// An interval of a coordinate holds this share of the energy.
const MOST: f64 = 0.8;
/// Shares under this are not listed.
const LEAST: f64 = 0.15;

/// Shares of the energy of `values` (one per row) over every dimension, largest first.
pub(crate) fn shares(observations: &Observations, values: &[f64], active: &[bool]) -> Vec<Place> {
    let energy: Vec<f64> = values
        .iter()
        .zip(active)
        .map(|(value, &used)| if used { value * value } else { 0.0 })
        .collect();
    let total: f64 = energy.iter().sum();
    if total <= 0.0 {
        return Vec::new();
    }
    let mut places = Vec::new();
    for (index, name) in observations.features.iter().enumerate() {
        let share = of(observations, &energy, |row| row.feature == index) / total;
        places.push(place("feature", name.clone(), None, share));
    }
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        for (sign, letter) in [(1.0, '+'), (-1.0, '-')] {
            let share = of(observations, &energy, |row| row.faces(axis, sign)) / total;
            places.push(place("direction", format!("{letter}{name}"), None, share));
        }
        let at = |row: &Row| row.position[axis];
        places.extend(interval(
            observations,
            &energy,
            "region",
            format!("part {name}"),
            at,
            0.5,
        ));
    }
    for axis in 0..observations.chain.axes().len() {
        let at = |row: &Row| row.pose.as_ref().map_or(0.0, |pose| pose.positions[axis]);
        let name = observations.chain.axis(axis).name.clone();
        places.extend(interval(observations, &energy, "axis", name, at, 0.5));
    }
    places.extend(interval(
        observations,
        &energy,
        "time",
        "s".to_owned(),
        |row| row.time,
        0.5,
    ));
    places.retain(|place| place.share >= LEAST);
    places.sort_by(|a, b| b.share.total_cmp(&a.share));
    places
}

/// Localises a part of the deviations; never empty.
pub(crate) fn of_part(observations: &Observations, values: &[f64], active: &[bool]) -> Vec<Place> {
    let mut places = shares(observations, values, active);
    if places.is_empty() {
        places.push(place("region", "everywhere".to_owned(), None, 1.0));
    }
    places
}

/// Localises a discrepancy: `values` is its part of the deviations.
pub(crate) fn of_discrepancy(
    observations: &Observations,
    kind: &Kind,
    values: &[f64],
    probability: f64,
) -> Vec<Place> {
    let energy: Vec<f64> = values.iter().map(|value| value * value).collect();
    let coordinate = |dimension: &str, key: String, at: &dyn Fn(&Row) -> f64| {
        interval(observations, &energy, dimension, key, at, 1.0)
            .into_iter()
            .map(|place| Place {
                share: probability,
                ..place
            })
    };
    match kind {
        Kind::Axis(axis) | Kind::AxisRange(axis) => {
            let name = observations.chain.axis(*axis).name.clone();
            let at = |row: &Row| row.pose.as_ref().map_or(0.0, |pose| pose.positions[*axis]);
            let mut places: Vec<Place> = coordinate("axis", name.clone(), &at).collect();
            places.extend(coordinate("region", name, &at));
            places
        }
        Kind::Time => coordinate("time", "s".to_owned(), &|row| row.time).collect(),
        Kind::Region => ["x", "y", "z"]
            .iter()
            .enumerate()
            .flat_map(|(axis, name)| {
                coordinate("region", format!("part {name}"), &|row: &Row| {
                    row.position[axis]
                })
                .collect::<Vec<_>>()
            })
            .collect(),
        Kind::Direction => named(observations, &energy, "direction", probability),
        Kind::Feature => named(observations, &energy, "feature", probability),
        Kind::Noise => Vec::new(),
        Kind::Switching => {
            let states = place("component", "two states".to_owned(), None, probability);
            std::iter::once(states)
                .chain(coordinate("time", "s".to_owned(), &|row| row.time))
                .collect()
        }
        Kind::Index => vec![place("component", "index".to_owned(), None, probability)],
        Kind::Covariate(covariate) => {
            let key = covariate.name().to_owned();
            vec![place("component", key, None, probability)]
        }
    }
}

/// The discrepancy's part of the deviations, per row, for the best model with one.
pub(crate) fn discrepancy_part(
    attribution: &ModelPosterior,
    model: usize,
) -> Option<(Kind, Vec<f64>)> {
    let model = &attribution.models[model];
    let (index, _) = model.discrepancy?;
    let part = attribution.discrepancy_part(model)?;
    Some((attribution.discrepancies[index].kind.clone(), part))
}

fn named(
    observations: &Observations,
    energy: &[f64],
    dimension: &str,
    probability: f64,
) -> Vec<Place> {
    let values: Vec<f64> = energy.iter().map(|value| value.sqrt()).collect();
    let all = vec![true; values.len()];
    let mut places: Vec<Place> = shares(observations, &values, &all)
        .into_iter()
        .filter(|place| place.dimension == dimension)
        .take(2)
        .collect();
    if places.is_empty() {
        places.push(place(dimension, "all".to_owned(), None, 1.0));
    }
    for place in &mut places {
        place.share *= probability;
    }
    places
}

fn of(observations: &Observations, energy: &[f64], inside: impl Fn(&Row) -> bool) -> f64 {
    observations
        .rows
        .iter()
        .zip(energy)
        .filter(|(row, _)| inside(row))
        .map(|(_, energy)| energy)
        .sum()
}

fn place(dimension: &str, key: String, interval: Option<(f64, f64)>, share: f64) -> Place {
    Place {
        dimension: dimension.to_owned(),
        key,
        from: interval.map(|(from, _)| from),
        to: interval.map(|(_, to)| to),
        share,
    }
}

/// The shortest interval with most of the energy, if it is at most `longest` of the range.
fn interval(
    observations: &Observations,
    energy: &[f64],
    dimension: &str,
    key: String,
    at: impl Fn(&Row) -> f64,
    longest: f64,
) -> Option<Place> {
    let mut points: Vec<(f64, f64)> = observations
        .rows
        .iter()
        .zip(energy)
        .filter(|(row, _)| row.pose.is_some())
        .map(|(row, &energy)| (at(row), energy))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = points.iter().map(|(_, energy)| energy).sum();
    let range = points.last()?.0 - points.first()?.0;
    if total <= 0.0 || range <= 1e-6 {
        return None;
    }
    let (mut first, mut inside) = (0, 0.0);
    let mut best: Option<(f64, f64, f64)> = None;
    for last in 0..points.len() {
        inside += points[last].1;
        while inside - points[first].1 >= MOST * total {
            inside -= points[first].1;
            first += 1;
        }
        let length = points[last].0 - points[first].0;
        if inside >= MOST * total && best.is_none_or(|(from, to, _)| length < to - from) {
            best = Some((points[first].0, points[last].0, inside / total));
        }
    }
    let (from, to, share) = best?;
    (to - from <= longest * range).then(|| place(dimension, key, Some((from, to)), share))
}
