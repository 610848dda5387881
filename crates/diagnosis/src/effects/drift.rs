//! `thermal.drift`: a slow linear drift between part and probe.
//!
//! The part moves by rate·t in its frame: d = n·rate·t. Typical 1–10 µm/h; taken in order of position, it is a tilt.

use super::{Parameter, Variant};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    if observations.span() <= 0.0 {
        return;
    }
    variants.push(Variant::linear(
        "thermal.drift",
        ["rate_x", "rate_y", "rate_z"]
            .map(|name| Parameter::new(name, "m/s", 1e-6))
            .into(),
        |observations| {
            [0, 1, 2]
                .map(|k| {
                    observations
                        .machine_column(false, |pose, row| pose.sensitivity.part[k] * row.time)
                })
                .into()
        },
    ));
}
