//! `drive.compliance` of an arm: joints yield to the weight they carry.
//!
//! Each revolute axis of the tool branch turns by c·torque, the torque of the weights beyond it (masses of the robot
//! description; a unit mass at the ball where there are none), gravity along −z of the foundation. Arms only: slides of a machine tool do not carry their load so.

use machine::{Chain, JointKind, Side};
use nalgebra::{Isometry3, Point3, Vector3};

use super::{Parameter, Variant, is_arm};
use crate::observation::{Observations, Pose};

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    let chain = &observations.chain;
    if !is_arm(chain) {
        return;
    }
    let turning: Vec<usize> = (0..chain.axes().len())
        .filter(|&axis| chain.axis(axis).kind == JointKind::Revolute)
        .filter(|&axis| chain.carries(chain.axes()[axis], Side::Tool))
        .collect();
    let parameters = turning
        .iter()
        .map(|&axis| Parameter::new(chain.axis(axis).name.clone(), "rad/(N m)", 1e-3))
        .collect();
    variants.push(Variant::linear(
        "drive.compliance",
        parameters,
        move |observations| {
            let of = |pose: &Pose| torques(&observations.chain, pose, &turning);
            let loads: Vec<Vec<f64>> = observations
                .rows
                .iter()
                .map(|row| row.pose.as_ref().map(of).unwrap_or_default())
                .collect();
            (0..turning.len())
                .map(|place| {
                    let axis = turning[place];
                    let mut column = observations.machine_column(false, |_, _| Vector3::zeros());
                    for (next, (row, load)) in observations.rows.iter().zip(&loads).enumerate() {
                        if let (Some(pose), Some(load)) = (&row.pose, load.get(place)) {
                            let shift = pose.sensitivity.axes[axis] * *load;
                            column.signature[next] = -row.normal.dot(&shift);
                            column.shifts[next] = shift;
                        }
                    }
                    column
                })
                .collect()
        },
    ));
}

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.80665;

/// Torque of the weights beyond each turning axis about it, N m; of a unit mass at the ball without masses.
fn torques(chain: &Chain, pose: &Pose, turning: &[usize]) -> Vec<f64> {
    let mut frame = Isometry3::identity();
    let mut axes: Vec<(usize, Vector3<f64>, Vector3<f64>)> = Vec::new();
    let mut weights: Vec<(f64, Vector3<f64>)> = Vec::new();
    for &index in chain.branch(Side::Tool) {
        let joint = &chain.joints()[index];
        frame *= joint.origin;
        let place = chain.axes().iter().position(|&moving| moving == index);
        axes.push((
            index,
            frame.translation.vector,
            frame.rotation * joint.axis.into_inner(),
        ));
        frame *= joint.motion(place.map_or(0.0, |place| pose.positions[place]));
        weights.push((
            joint.mass,
            (frame * Point3::from(joint.centre_of_mass)).coords,
        ));
    }
    if weights.iter().all(|(mass, _)| *mass <= 0.0) {
        let up: Vector3<f64> = pose.sensitivity.foundation[2];
        return turning
            .iter()
            .map(|&axis| -pose.sensitivity.axes[axis].dot(&up) * GRAVITY)
            .collect();
    }
    let about = |&axis: &usize| {
        let first = axes
            .iter()
            .position(|(index, _, _)| *index == chain.axes()[axis])
            .unwrap_or(0);
        let (_, origin, direction) = axes[first];
        let pull = |(mass, centre): &(f64, Vector3<f64>)| {
            -mass * GRAVITY * direction.cross(&(centre - origin)).z
        };
        weights[first..].iter().map(pull).sum()
    };
    turning.iter().map(about).collect()
}
