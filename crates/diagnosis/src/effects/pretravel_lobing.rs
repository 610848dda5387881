//! `probe.pretravel_lobing`: the trigger's travel varies with the direction in the mount's x–y plane.
//!
//! d = sinθ·a·cos(k(φ − phase)), θ from the mount's z, φ about it, k = 3 for a kinematic seat of three rollers (k = 2, 4
//! are tried as well). Typical 0.25–5 µm.

use super::{Form, Parameter, Variant};
use crate::observation::{Observations, Row};

pub(super) fn offer(_: &Observations, variants: &mut Vec<Variant>) {
    for lobes in [3.0, 2.0, 4.0] {
        let build = move |observations: &Observations| {
            vec![
                observations.reading_column(|row| lobe(row, |phi| (lobes * phi).cos())),
                observations.reading_column(|row| lobe(row, |phi| (lobes * phi).sin())),
            ]
        };
        let parameters = vec![
            Parameter::new("cos", "m", 1e-4),
            Parameter::new("sin", "m", 1e-4),
        ];
        variants.push(
            Variant::linear("probe.pretravel_lobing", parameters, build)
                .reported(Form::Lobes(lobes))
                .with_constants(&[("lobes", lobes, "1")]),
        );
    }
}

fn lobe(row: &Row, wave: impl Fn(f64) -> f64) -> f64 {
    let Some(pose) = &row.pose else { return 0.0 };
    let [x, y, _] = pose
        .sensitivity
        .mount
        .map(|direction| direction.dot(&row.normal));
    x.hypot(y) * wave(y.atan2(x))
}
