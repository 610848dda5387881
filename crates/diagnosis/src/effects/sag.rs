//! `drive.compliance` of an arm: joints yield to the weight they carry.
//!
//! A revolute axis that lies across gravity (foundation −z) turns by c·torque; without masses in the description the
//! torque of an outstretched arm is taken as the horizontal lever from the joint to the ball (and, for the first such
//! joint, also to the next), in N m per unit weight. Arms only: slides of a machine tool do not carry their load so.

use machine::{JointKind, Side};
use nalgebra::Vector3;

use super::{Parameter, Variant};
use crate::observation::{Observations, Pose};

/// Fewest revolute axes in the tool branch that make an arm.
const ARM: usize = 5;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    let chain = &observations.chain;
    let turning: Vec<usize> = (0..chain.axes().len())
        .filter(|&axis| chain.axis(axis).kind == JointKind::Revolute)
        .filter(|&axis| chain.carries(chain.axes()[axis], Side::Tool))
        .collect();
    if turning.len() < ARM {
        return;
    }
    let parameters = turning
        .iter()
        .map(|&axis| {
            Parameter::new(
                format!("{}_per_lever", chain.axis(axis).name),
                "rad/m",
                1e-1,
            )
        })
        .collect();
    variants.push(Variant::linear(
        "drive.compliance",
        parameters,
        move |observations| {
            turning
                .iter()
                .map(|&axis| {
                    observations.machine_column(true, |pose, _| {
                        pose.sensitivity.axes[axis] * lever(pose, axis)
                    })
                })
                .collect()
        },
    ));
}

/// Vertical drop of the ball per radian of the axis: the lever of a weight at the ball.
fn lever(pose: &Pose, axis: usize) -> f64 {
    let up: Vector3<f64> = pose.sensitivity.foundation[2];
    -pose.sensitivity.axes[axis].dot(&up)
}
