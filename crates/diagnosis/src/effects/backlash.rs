//! `axis.<A>.backlash`: lost motion on reversal.
//!
//! δq = −½·b·sgn(speed): the slide hangs behind its drive, seen from either side. Typical 1–15 µm.

use machine::JointKind;

use super::{Parameter, Variant};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        if observations.prescribed.contains(&axis) {
            continue;
        }
        let joint = observations.chain.axis(axis);
        let unit = if joint.kind == JointKind::Revolute {
            "rad"
        } else {
            "m"
        };
        let b = vec![Parameter::new("b", unit, 2e-4)];
        variants.push(Variant::linear(
            format!("axis.{}.backlash", joint.name),
            b,
            move |observations| {
                vec![observations.machine_column(false, |pose, _| {
                    let speed = pose.speeds[axis];
                    let side = if speed == 0.0 { 0.0 } else { speed.signum() };
                    pose.sensitivity.axes[axis] * (-0.5 * side)
                })]
            },
        ));
    }
}
