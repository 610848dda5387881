//! `process.deflection`: tool or part bends under the cut, the more the farther from the clamping.
//!
//! d = tip·(overhang/length)^m with length the largest overhang; m = 3 for a cantilever loaded at the tool (domain
//! specification A.6), 2 for a chuck that tilts; the exponent is profiled. As a beam loaded at its free end,
//! d ~ u²(3 − u)/2 with u = overhang/(free length), tip again at the largest overhang. Typical 5–60 µm.

use super::{Parameter, Shape, Variant, linspace, logspace, tools};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    let overhangs = observations.rows.iter().map(|row| row.overhang);
    let (low, high) = overhangs.fold((f64::INFINITY, 0.0_f64), |(low, high), at| {
        (low.min(at), high.max(at))
    });
    if high - low < 1e-6 {
        return;
    }
    let tools = tools(observations);
    let mut choices: Vec<Option<u32>> = vec![None];
    if tools.len() > 1 {
        choices.extend(tools.into_iter().map(Some));
    }
    for choice in choices {
        let build = move |observations: &Observations, exponent: f64| {
            vec![observations.material_column(|row| match choice {
                Some(tool) if row.tool != Some(tool) => 0.0,
                _ if row.tool.is_none() => 0.0,
                _ => (row.overhang / high).max(0.0).powf(exponent),
            })]
        };
        let mut constants = vec![("length", high, "m")];
        constants.extend(choice.map(|tool| ("tool", f64::from(tool), "1")));
        let tip = || vec![Parameter::new("tip", "m", 5e-4)];
        variants.push(
            Variant::linear("process.deflection", tip(), move |observations| {
                build(observations, 3.0)
            })
            .with_constants(&constants),
        );
        let shape = Shape {
            name: "exponent",
            unit: "1",
            trials: linspace(1.5, 4.0, 6),
            continuous: true,
            distinct: 3.0,
        };
        variants.push(
            Variant::shaped("process.deflection", tip(), shape, build).with_constants(&constants),
        );
        let free = Shape {
            name: "free_length",
            unit: "m",
            trials: logspace(high, 4.0 * high, 5),
            continuous: true,
            distinct: 2.0,
        };
        let beam = move |observations: &Observations, length: f64| {
            vec![observations.material_column(|row| match choice {
                Some(tool) if row.tool != Some(tool) => 0.0,
                _ if row.tool.is_none() => 0.0,
                _ => {
                    let bent = |u: f64| 0.5 * u * u * (3.0 - u);
                    bent(row.overhang.max(0.0) / length) / bent(high / length)
                }
            })]
        };
        variants.push(
            Variant::shaped("process.deflection", tip(), free, beam)
                .with_constants(&constants)
                .weighing(0.5),
        );
    }
}
