//! `process.tool_wear`: a tool wears, and the material it leaves grows with the path it has cut.
//!
//! d = rate·(cut length) on the points of that tool. Typical 1–20 µm over its work.

use super::{Parameter, Variant, tools};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for tool in tools(observations) {
        variants.push(
            Variant::linear(
                "process.tool_wear",
                vec![Parameter::new("rate", "m/m", 1e-3)],
                move |observations| {
                    vec![observations.material_column(|row| {
                        if row.tool == Some(tool) {
                            row.cut_length
                        } else {
                            0.0
                        }
                    })]
                },
            )
            .with_constants(&[("tool", f64::from(tool), "1")]),
        );
    }
}
