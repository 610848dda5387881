//! `probe.stylus_offset` and `probe.stylus_length`: the ball centre off its place in the probe mount.
//!
//! d = −n·R(mount)·(dx, dy, 0) or (0, 0, dz). Typical 2–50 µm; seen twice with the spindle turned by 180°, the offset
//! parts from a shifted fixture.

use super::{Parameter, Variant};
use crate::observation::Observations;

pub(super) fn offer(_: &Observations, variants: &mut Vec<Variant>) {
    variants.push(Variant::linear(
        "probe.stylus_offset",
        vec![
            Parameter::new("dx", "m", 3e-4),
            Parameter::new("dy", "m", 3e-4),
        ],
        |observations| {
            [0, 1]
                .map(|k| observations.machine_column(false, |pose, _| pose.sensitivity.mount[k]))
                .into()
        },
    ));
    variants.push(Variant::linear(
        "probe.stylus_length",
        vec![Parameter::new("dz", "m", 3e-4)],
        |observations| {
            vec![observations.machine_column(false, |pose, _| pose.sensitivity.mount[2])]
        },
    ));
}
