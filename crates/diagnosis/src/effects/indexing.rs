//! `axis.<A>.indexing`: a rotary axis stands off its angle by a harmonic of it.
//!
//! δq = a·sin(k·q + phase): eccentric scale (k = 1), two-per-turn gears, or the transmission of an arm's joint, whose
//! period is 12–30° of joint angle, so k is profiled up to 36 where the session visits enough angles. Typical
//! 10–500 µrad.

use machine::JointKind;

use super::{Form, Parameter, Shape, Variant};
use crate::observation::Observations;

/// Fewest angles at which it is an effect of its own.
const FEWEST: usize = 2;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        let angles = distinct_angles(observations, axis);
        if angles >= FEWEST {
            push(observations, axis, angles, variants);
        }
    }
}

/// At one angle only, a wrong angle is a location error by another name.
pub(super) fn offer_unparted(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        let angles = distinct_angles(observations, axis);
        if angles < FEWEST {
            push(observations, axis, angles, variants);
        }
    }
}

fn push(observations: &Observations, axis: usize, angles: usize, variants: &mut Vec<Variant>) {
    let joint = observations.chain.axis(axis);
    if joint.kind != JointKind::Revolute {
        return;
    }
    let highest = ((angles as f64 - 1.0) / 2.0)
        .ceil()
        .clamp(1.0, if angles > 40 { 36.0 } else { 4.0 });
    let trials: Vec<f64> = (1..=highest as usize).map(|k| k as f64).collect();
    let shape = Shape {
        name: "k",
        unit: "1",
        distinct: highest,
        trials,
        continuous: false,
    };
    variants.push(
        Variant::shaped(
            format!("axis.{}.indexing", joint.name),
            vec![
                Parameter::new("sin", "rad", 1e-3),
                Parameter::new("cos", "rad", 1e-3),
            ],
            shape,
            move |observations, k| {
                let column = |wave: fn(f64) -> f64| {
                    observations.machine_column(true, |pose, _| {
                        pose.sensitivity.axes[axis] * wave(k * pose.positions[axis])
                    })
                };
                vec![column(f64::sin), column(f64::cos)]
            },
        )
        .reported(Form::Sine),
    );
}

/// How many angles (0.05° apart) an axis visits.
pub(super) fn distinct_angles(observations: &Observations, axis: usize) -> usize {
    let mut angles: Vec<i64> = observations
        .rows
        .iter()
        .filter_map(|row| row.pose.as_ref())
        .map(|pose| {
            (pose.positions[axis].rem_euclid(std::f64::consts::TAU) * 1146.0).round() as i64
        })
        .collect();
    angles.sort_unstable();
    angles.dedup();
    angles.len()
}
