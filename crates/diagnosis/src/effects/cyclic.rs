//! `axis.<A>.cyclic`: a linear axis errs with the pitch of its screw or scale.
//!
//! δq = a·sin(2πq/period + phase), the period profiled over 1–40 mm. Typical 0.5–5 µm. Points spaced by a pitch cannot
//! see it.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use machine::JointKind;

use super::{Form, Parameter, Shape, Variant, linspace};
use crate::observation::Observations;

/// Longest and shortest period that a screw or a scale has, m.
const PERIODS: (f64, f64) = (0.04, 0.001);
/// Fewest places that a wave is told from: through a few of them goes a wave of almost any period.
const FEWEST: usize = 12;
/// Places closer than this are one, m: a quarter of the shortest period.
const APART: f64 = 2.5e-4;
/// Steps after which a wave is computed anew in a sweep.
const RENEWED: usize = 64;
/// Trials in one resolvable step of the frequency.
const OVERSAMPLED: f64 = 4.0;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        let joint = observations.chain.axis(axis);
        let (low, high) = observations.travel(axis);
        let range = high - low;
        if joint.kind != JointKind::Prismatic
            || range < 2.0 * PERIODS.1
            || distinct_places(observations, axis) < FEWEST
        {
            continue;
        }
        let slowest = (1.0 / PERIODS.0).max(0.5 / range);
        let steps = (1.0 / PERIODS.1 - slowest) * range;
        let trials = linspace(
            slowest,
            1.0 / PERIODS.1,
            ((steps * OVERSAMPLED) as usize).clamp(2, 4000),
        );
        let shape = Shape {
            name: "period",
            unit: "m",
            trials: trials
                .iter()
                .rev()
                .map(|frequency| 1.0 / frequency)
                .collect(),
            continuous: true,
            distinct: steps.max(1.0),
        };
        variants.push(
            Variant::shaped(
                format!("axis.{}.cyclic", joint.name),
                vec![
                    Parameter::new("sin", "m", 5e-5),
                    Parameter::new("cos", "m", 5e-5),
                ],
                shape,
                move |observations, period| {
                    let column = |wave: fn(f64) -> f64| {
                        observations.machine_column(true, |pose, _| {
                            pose.sensitivity.axes[axis] * wave(TAU * pose.positions[axis] / period)
                        })
                    };
                    vec![column(f64::sin), column(f64::cos)]
                },
            )
            .reported(Form::Sine)
            .swept(move |observations, periods| sweep(observations, axis, periods)),
        );
    }
}

/// How many places an axis visits.
fn distinct_places(observations: &Observations, axis: usize) -> usize {
    let poses = observations.rows.iter().filter_map(|row| row.pose.as_ref());
    let places: BTreeSet<i64> = poses
        .map(|pose| (pose.positions[axis] / APART).round() as i64)
        .collect();
    places.len()
}

/// One position of the axis in a row: how strongly the row sees it, and the waves at the frequency in turn.
struct Seen {
    row: usize,
    weight: f64,
    wave: (f64, f64),
    step: (f64, f64),
}

/// Sine and cosine at all periods, whose frequencies are evenly spaced: each wave follows from the one before by turning
/// it on, and is set anew now and then.
fn sweep(observations: &Observations, axis: usize, periods: &[f64]) -> Vec<Vec<Vec<f64>>> {
    let rows = observations.rows.len();
    let frequency = |place: usize| 1.0 / periods[place];
    let spacing = if periods.len() > 1 {
        (frequency(periods.len() - 1) - frequency(0)) / (periods.len() - 1) as f64
    } else {
        0.0
    };
    let mut seen: Vec<Seen> = Vec::new();
    let mut positions: Vec<f64> = Vec::new();
    for (row, of) in observations.rows.iter().enumerate() {
        for (pose, sign) in [(&of.pose, -1.0), (&of.cut, 1.0)] {
            if let Some(pose) = pose {
                let position = pose.positions[axis];
                positions.push(position);
                seen.push(Seen {
                    row,
                    weight: sign * of.normal.dot(&pose.sensitivity.axes[axis]),
                    wave: (0.0, 1.0),
                    step: (TAU * spacing * position).sin_cos(),
                });
            }
        }
    }
    let mut all = Vec::with_capacity(periods.len());
    for place in 0..periods.len() {
        let (mut sine, mut cosine) = (vec![0.0; rows], vec![0.0; rows]);
        for (one, position) in seen.iter_mut().zip(&positions) {
            let (s, c) = one.wave;
            one.wave = if place % RENEWED == 0 {
                (TAU * position * frequency(place)).sin_cos()
            } else {
                let (turn_s, turn_c) = one.step;
                (s * turn_c + c * turn_s, c * turn_c - s * turn_s)
            };
            sine[one.row] += one.weight * one.wave.0;
            cosine[one.row] += one.weight * one.wave.1;
        }
        all.push(vec![sine, cosine]);
    }
    all
}
