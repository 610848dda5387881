//! `axis.<A>.lag`: the position read leads the true one by speed × time.
//!
//! δq = −tau·q̇. Typical 0–20 µm at probing feed.

use super::{Parameter, Variant};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        if observations.prescribed.contains(&axis) {
            continue;
        }
        let effect = format!("axis.{}.lag", observations.chain.axis(axis).name);
        variants.push(Variant::linear(
            effect,
            vec![Parameter::new("tau", "s", 0.03)],
            move |observations| {
                vec![observations.machine_column(false, |pose, _| {
                    pose.sensitivity.axes[axis] * -pose.speeds[axis]
                })]
            },
        ));
    }
}
