//! `axis.<A>.error_motion`: the axis of rotation wanders sideways, harmonic in its angle.
//!
//! Radial run-out in the frame at rest: along one direction across the axis, e = a·sin(k·q + phase), or on a circle with
//! or against the turn. k is profiled from 1 to 3 where enough angles are visited. Typical 1–10 µm; at least six angles
//! part it from the axis's location. The bearings of an arm run true to micrometres, while its links err by hundreds and
//! look the same: there it is not offered.

use machine::JointKind;
use nalgebra::Vector3;

use super::indexing::distinct_angles;
use super::{Form, Parameter, Shape, Variant, is_arm};
use crate::observation::{Observations, Pose};

/// Fewest angles at which it is an effect of its own.
const FEWEST: usize = 3;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    offer_where(observations, variants, |angles| angles >= FEWEST);
}

/// At one or two angles, a run-out is a location error by another name.
pub(super) fn offer_unparted(observations: &Observations, variants: &mut Vec<Variant>) {
    offer_where(observations, variants, |angles| angles < FEWEST);
}

fn offer_where(
    observations: &Observations,
    variants: &mut Vec<Variant>,
    enough: impl Fn(usize) -> bool,
) {
    if is_arm(&observations.chain) {
        return;
    }
    for axis in 0..observations.chain.axes().len() {
        let joint = observations.chain.axis(axis);
        let angles = distinct_angles(observations, axis);
        if joint.kind != JointKind::Revolute || !enough(angles) {
            continue;
        }
        let highest = ((angles as f64 - 1.0) / 2.0).ceil().clamp(1.0, 3.0);
        let trials: Vec<f64> = (1..=highest as usize).map(|k| k as f64).collect();
        let shape = Shape {
            name: "k",
            unit: "1",
            distinct: highest,
            trials,
            continuous: false,
        };
        let index = observations.chain.axes()[axis];
        let across: Vec<usize> = (0..3)
            .filter(|&component| joint.axis[component].abs() < 0.7)
            .collect();
        let [u, v] = across[..] else { continue };
        let effect = format!("axis.{}.error_motion", joint.name);
        let pair = || {
            vec![
                Parameter::new("sin", "m", 1e-4),
                Parameter::new("cos", "m", 1e-4),
            ]
        };
        for component in [u, v] {
            let variant = Variant::shaped(
                effect.clone(),
                pair(),
                shape.clone(),
                move |observations, k| {
                    let column = |wave: fn(f64) -> f64| {
                        observations.machine_column(true, |pose, _| {
                            pose.sensitivity.location[index][component]
                                * wave(k * pose.positions[axis])
                        })
                    };
                    vec![column(f64::sin), column(f64::cos)]
                },
            );
            variants.push(variant.reported(Form::Sine).with_constants(&[(
                "along",
                component as f64,
                "1",
            )]));
        }
        for sense in [1.0, -1.0] {
            let variant = Variant::shaped(
                effect.clone(),
                pair(),
                shape.clone(),
                move |observations, k| {
                    let circle = move |pose: &Pose, ahead: f64| -> Vector3<f64> {
                        let angle = k * pose.positions[axis] + ahead;
                        let frame = &pose.sensitivity.location[index];
                        frame[u] * angle.sin() - frame[v] * (sense * angle.cos())
                    };
                    [0.0, std::f64::consts::FRAC_PI_2]
                        .map(|ahead| {
                            observations.machine_column(true, |pose, _| circle(pose, ahead))
                        })
                        .into()
                },
            );
            variants.push(
                variant
                    .reported(Form::Sine)
                    .with_constants(&[("sense", sense, "1")]),
            );
        }
    }
}
