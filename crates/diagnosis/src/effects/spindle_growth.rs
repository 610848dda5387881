//! `thermal.spindle_growth`: the tool side grows along the mount's z as the spindle warms, first-order in time.
//!
//! e = g·(1 − exp(−t/tau))·z of the mount. Typical 10–80 µm with 1–40 min. Over a short session it is a drift.

use super::{Parameter, Shape, Variant, logspace};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    let span = observations.span();
    if span <= 0.0 {
        return;
    }
    let shape = Shape {
        name: "tau",
        unit: "s",
        trials: logspace(span / 40.0, span * 2.0, 14),
        continuous: true,
        distinct: 6.0,
    };
    variants.push(Variant::shaped(
        "thermal.spindle_growth",
        vec![Parameter::new("g", "m", 1e-3)],
        shape,
        |observations, tau| {
            vec![observations.machine_column(false, |pose, row| {
                pose.sensitivity.mount[2] * -(-row.time / tau).exp_m1()
            })]
        },
    ));
}
