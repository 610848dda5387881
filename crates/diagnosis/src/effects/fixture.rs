//! `fixture.shift` and `fixture.tilt`: the clamped part sits off its nominal pose.
//!
//! d = n·t and d = n·(ε × p), in the part frame, about its origin. Typical 5–100 µm and 20–200 µrad. A part cut in this
//! clamping lies where it was cut: neither can show.

use super::{Parameter, Variant};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    if observations.cut_here {
        return;
    }
    let shift = ["x", "y", "z"]
        .map(|name| Parameter::new(name, "m", 1e-3))
        .into();
    variants.push(Variant::linear("fixture.shift", shift, |observations| {
        [0, 1, 2]
            .map(|k| observations.machine_column(false, |pose, _| pose.sensitivity.part[k]))
            .into()
    }));
    let tilt = ["a", "b", "c"]
        .map(|name| Parameter::new(name, "rad", 1e-3))
        .into();
    variants.push(Variant::linear("fixture.tilt", tilt, |observations| {
        [3, 4, 5]
            .map(|k| observations.machine_column(false, |pose, _| pose.sensitivity.part[k]))
            .into()
    }));
}
