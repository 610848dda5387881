//! What to measure next: touches whose predictions differ most between explanations that are still possible.
//!
//! Box and Hill (1967) for two explanations of equal noise: the largest difference of the predicted deviations. Tried
//! are points of the plan at the prescribed positions met in the session, with every prescribed axis turned by half a
//! turn, and at half and double feed; each rival is fitted to what the named effect explains. Reach is checked,
//! collisions are not.

use std::f64::consts::PI;

use nalgebra::DVector;

use crate::attribution::Attribution;
use crate::candidate::Candidate;
use crate::effects::Variant;
use crate::evidence::dot;
use crate::groups::signature;
use crate::observation::{Observations, Row};
use crate::report::{Effect, NextMeasurement, NextPoint};

/// Rivals of an effect that are looked at.
const RIVALS: usize = 3;
/// Touches proposed for each.
const TOUCHES: usize = 8;
/// Points of the plan that are varied.
const POINTS: usize = 24;
/// Differences below this share of the noise part nothing.
const LEAST: f64 = 1.0;

/// Touches that part each named effect from its equals; `set` holds the candidates of the first `effects`.
pub fn plan(
    observations: &Observations,
    variants: &[Variant],
    attribution: &Attribution,
    set: &[usize],
    effects: &[Effect],
) -> Vec<NextMeasurement> {
    let Some(fit) = attribution.products.fit(set) else {
        return Vec::new();
    };
    let doubtful = effects
        .iter()
        .take(set.len())
        .any(|effect| !effect.indistinguishable_from.is_empty());
    if !doubtful {
        return Vec::new();
    }
    let imagined = Observations {
        rows: imagine(observations),
        ..observations.clone()
    };
    let mut plans = Vec::new();
    let mut start = 0;
    for (&member, effect) in set.iter().zip(effects) {
        let candidate = &attribution.candidates[member];
        let own = &fit.coefficients[start..start + candidate.block.len()];
        start += candidate.block.len();
        let seen = signature(candidate, own);
        let predicted = predict(&imagined, variants, candidate, own);
        for rival in effect.indistinguishable_from.iter().take(RIVALS) {
            let other = (0..variants.len())
                .filter(|&place| {
                    variants[place].effect == *rival && variants[place].shape.is_none()
                })
                .find_map(|place| Candidate::new(observations, variants, place, 0.0));
            let Some(other) = other else { continue };
            let coefficients: Vec<f64> = other
                .block
                .iter()
                .map(|column| dot(column, &seen))
                .collect();
            let instead = predict(&imagined, variants, &other, &coefficients);
            let points = best(&imagined, &predicted, &instead, LEAST * fit.variance.sqrt());
            if !points.is_empty() {
                plans.push(NextMeasurement {
                    separates: vec![effect.effect.clone(), rival.clone()],
                    points,
                });
            }
        }
    }
    plans
}

fn predict(
    imagined: &Observations,
    variants: &[Variant],
    candidate: &Candidate,
    coefficients: &[f64],
) -> Vec<f64> {
    let parameters = &candidate.parameters_from_block * DVector::from_column_slice(coefficients);
    let mut predicted = vec![0.0; imagined.rows.len()];
    for (column, value) in variants[candidate.variant]
        .columns(imagined, candidate.shape)
        .iter()
        .zip(parameters.iter())
    {
        crate::evidence::add_scaled(&mut predicted, *value, &column.signature);
    }
    predicted
}

/// Points of the plan under conditions that the axes can reach.
fn imagine(observations: &Observations) -> Vec<Row> {
    let prescribed = |row: &Row| -> Option<Vec<f64>> {
        let pose = row.pose.as_ref()?;
        Some(
            observations
                .prescribed
                .iter()
                .map(|&axis| pose.positions[axis])
                .collect(),
        )
    };
    let mut met: Vec<Vec<f64>> = Vec::new();
    for row in &observations.rows {
        if row.index == met.len()
            && let Some(positions) = prescribed(row)
        {
            met.push(positions);
        }
    }
    let touches = observations.touches();
    let stride = touches.div_ceil(POINTS).max(1);
    let mut imagined = Vec::new();
    for row in observations.rows.iter().take(touches).step_by(stride) {
        let Some(own) = prescribed(row) else { continue };
        let mut conditions: Vec<(Vec<f64>, f64)> =
            vec![(own.clone(), 0.5 * row.feed), (own.clone(), 2.0 * row.feed)];
        conditions.extend(
            met.iter()
                .take(6)
                .map(|positions| (positions.clone(), row.feed)),
        );
        for place in 0..own.len() {
            for turn in [PI, -PI] {
                let mut turned = own.clone();
                turned[place] += turn;
                conditions.push((turned, row.feed));
            }
        }
        imagined.extend(
            conditions
                .iter()
                .filter_map(|(positions, feed)| observations.imagined(row, positions, *feed)),
        );
    }
    imagined
}

/// The touches that differ most, each point of the plan at most twice.
fn best(imagined: &Observations, one: &[f64], other: &[f64], least: f64) -> Vec<NextPoint> {
    let mut order: Vec<usize> = (0..one.len())
        .filter(|&row| (one[row] - other[row]).abs() > least)
        .collect();
    order.sort_by(|&a, &b| {
        (one[b] - other[b])
            .abs()
            .total_cmp(&(one[a] - other[a]).abs())
            .then(a.cmp(&b))
    });
    let mut points: Vec<NextPoint> = Vec::new();
    for row in order {
        let place = &imagined.rows[row];
        if points
            .iter()
            .filter(|point| point.point_index == place.point)
            .count()
            >= 2
        {
            continue;
        }
        let Some(pose) = &place.pose else { continue };
        points.push(NextPoint {
            point_index: place.point,
            rotary_positions: imagined
                .prescribed
                .iter()
                .map(|&axis| pose.positions[axis])
                .collect(),
            feed: place.feed,
            difference: one[row] - other[row],
        });
        if points.len() == TOUCHES {
            break;
        }
    }
    points
}
