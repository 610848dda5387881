//! `axis.<A>.angular`: roll, pitch or yaw of a slide that grows along its travel.
//!
//! A rotation k·(q − mid) about one axis of the frame, either of the moved carriage or of the guideway at rest: the
//! two differ by a bow across the axis, since the descriptions differ in the point they turn about. Typical 5–40 µrad.

use machine::JointKind;

use super::{Parameter, Variant};
use crate::observation::Observations;

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
                variants.push(
                    Variant::linear(
                        format!("axis.{}.angular", joint.name),
                        vec![Parameter::new("k", "rad/m", 1e-1)],
                        move |observations| {
                            vec![observations.machine_column(true, |pose, _| {
                                let sensitivity = &pose.sensitivity;
                                let frames = if moved {
                                    &sensitivity.motion
                                } else {
                                    &sensitivity.location
                                };
                                frames[index][component] * (pose.positions[axis] - mid)
                            })]
                        },
                    )
                    .with_constants(&[("about", about, "1"), ("mid", mid, "m")]),
                );
            }
        }
    }
}
