//! `axis.<A>.angular`: roll, pitch or yaw of a slide that grows along its travel.
//!
//! A rotation k·(q − mid) about one axis of the frame, either of the moved carriage (`moved` 1) or of the guideway at
//! rest: the two differ by a bow across the axis, since the descriptions differ in the point they turn about. Where the rotation
//! vanishes is a convention of who describes the machine: in the middle of the travel used or at the axis's zero.
//! Typical 5–40 µrad.

use machine::JointKind;

use super::{Parameter, Variant};
use crate::observation::Observations;

/// How probable it is that the rotation vanishes at the axis's zero and not in the middle of the travel used.
const FROM_ZERO: f64 = 0.2;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        let joint = observations.chain.axis(axis);
        let (low, high) = observations.travel(axis);
        if joint.kind != JointKind::Prismatic || high - low < 1e-4 {
            continue;
        }
        let mid = 0.5 * (high + low);
        let index = observations.chain.axes()[axis];
        for (component, about) in [(3, 0.0), (4, 1.0), (5, 2.0)] {
            for moved in [true, false] {
                if !moved && joint.axis[component - 3].abs() > 0.7 {
                    continue;
                }
                let turn = move |observations: &Observations, by: &dyn Fn(f64) -> f64| {
                    observations.machine_column(true, |pose, _| {
                        let sensitivity = &pose.sensitivity;
                        let frames = if moved {
                            &sensitivity.motion
                        } else {
                            &sensitivity.location
                        };
                        frames[index][component] * by(pose.positions[axis] - mid)
                    })
                };
                let effect = format!("axis.{}.angular", joint.name);
                let carriage = f64::from(u8::from(moved));
                let constants = |mid: f64| {
                    [
                        ("about", about, "1"),
                        ("moved", carriage, "1"),
                        ("mid", mid, "m"),
                    ]
                };
                let k = || Parameter::new("k", "rad/m", 3e-3);
                variants.push(
                    Variant::linear(effect.clone(), vec![k()], move |observations| {
                        vec![turn(observations, &|from_mid| from_mid)]
                    })
                    .with_constants(&constants(mid)),
                );
                variants.push(
                    Variant::linear(effect, vec![k()], move |observations| {
                        vec![turn(observations, &|from_mid| from_mid + mid)]
                    })
                    .with_constants(&constants(0.0))
                    .weighing(FROM_ZERO),
                );
            }
        }
    }
}
