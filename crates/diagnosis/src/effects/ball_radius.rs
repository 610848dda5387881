//! `probe.ball_radius`: the effective ball is larger by dr than stored; constant pretravel counts with it.
//!
//! d = dr for every touch, whatever its direction. Typical 1–15 µm. One feed cannot part it from latency, and a part
//! cut too large looks the same unless something else measured it.

use super::{Parameter, Variant};
use crate::observation::Observations;

pub(super) fn offer(_: &Observations, variants: &mut Vec<Variant>) {
    variants.push(Variant::linear(
        "probe.ball_radius",
        vec![Parameter::new("dr", "m", 1e-3)],
        |observations| vec![observations.reading_column(|_| 1.0)],
    ));
}
