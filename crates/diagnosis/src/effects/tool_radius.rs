//! `process.tool_radius`: a finishing tool's radius is wrong and leaves constant material e on all it cut.
//!
//! d = e on the points of that tool. Typical 1–20 µm.

use super::{Parameter, Variant, tools};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for tool in tools(observations) {
        variants.push(
            Variant::linear(
                "process.tool_radius",
                vec![Parameter::new("e", "m", 1e-3)],
                move |observations| {
                    vec![
                        observations
                            .material_column(|row| f64::from(u8::from(row.tool == Some(tool)))),
                    ]
                },
            )
            .with_constants(&[("tool", f64::from(tool), "1")]),
        );
    }
}
