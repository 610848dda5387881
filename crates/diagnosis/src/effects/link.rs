//! `link.E<c>0<A>`: a constant location error of an axis's frame, ISO 230-1 names, squareness included.
//!
//! It acts right after the joint's origin, before its motion; the chain differentiates it. Typical 10–80 µrad and
//! 5–50 µm; eight of them describe a five-axis machine, the others repeat what these or stylus and fixture say.

use machine::JointKind;

use super::{Parameter, Variant};
use crate::observation::Observations;

/// The spindle's own angle: a location error there is a stylus error by another name.
const SPINDLE: &str = "S";

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    let mut order = observations.chain.axes().to_vec();
    order.sort_by_key(|&index| {
        let joint = &observations.chain.joints()[index];
        (joint.name == SPINDLE, joint.kind != JointKind::Revolute)
    });
    for (component, letter) in ["A", "B", "C", "X", "Y", "Z"].into_iter().enumerate() {
        let (component, unit, plausible) = if component < 3 {
            (component + 3, "rad", 1e-3)
        } else {
            (component - 3, "m", 1e-3)
        };
        for &index in &order {
            let effect = format!("link.E{letter}0{}", observations.chain.joints()[index].name);
            let e = vec![Parameter::new("e", unit, plausible)];
            variants.push(Variant::linear(effect, e, move |observations| {
                vec![
                    observations.machine_column(true, |pose, _| {
                        pose.sensitivity.location[index][component]
                    }),
                ]
            }));
        }
    }
}
