//! `axis.<A>.scale`: true travel = reading × (1 + k).
//!
//! δq = k·q from the axis's zero. Typical 5–50 µm/m for linear axes; a rotary axis geared wrong is told apart from its
//! indexing only over many turns. The geared joints of an arm have
//! whole-numbered ratios and no scale error.

use machine::JointKind;

use super::{Parameter, Variant, is_arm};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        let joint = observations.chain.axis(axis);
        if joint.kind == JointKind::Revolute && is_arm(&observations.chain) {
            continue;
        }
        let unit = if joint.kind == JointKind::Revolute {
            "rad/rad"
        } else {
            "m/m"
        };
        let k = vec![Parameter::new("k", unit, 1e-3)];
        variants.push(Variant::linear(
            format!("axis.{}.scale", joint.name),
            k,
            move |observations| {
                vec![observations.machine_column(true, |pose, _| {
                    pose.sensitivity.axes[axis] * pose.positions[axis]
                })]
            },
        ));
    }
}
