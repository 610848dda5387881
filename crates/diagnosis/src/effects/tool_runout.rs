//! `process.tool_runout`: the effective radius varies along the tool's height.
//!
//! Leaning and bent: d = a − tilt·h + 4·bow·h(h − 1), h the height over the highest used (sign of tilt as in E.2 of the
//! domain specification, where the radius grows towards the tip). With flutes on a helix
//! (domain specification E.2) it is periodic in the height: d = a + s·sin(2πz/period) + c·cos(2πz/period).
//! Typical 1–20 µm.

use super::{Parameter, Shape, Variant, linspace, tools};
use crate::observation::{Observations, Row};

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for tool in tools(observations) {
        let heights = observations
            .rows
            .iter()
            .filter(|row| row.tool == Some(tool))
            .map(|row| row.tool_height);
        let (low, high) = heights.fold((f64::INFINITY, 0.0_f64), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        if high - low < 1e-6 {
            continue;
        }
        let constants = [("tool", f64::from(tool), "1"), ("height", high, "m")];
        let on = move |row: &Row, value: f64| if row.tool == Some(tool) { value } else { 0.0 };
        let named = |names: &[&str]| {
            names
                .iter()
                .map(|&name| Parameter::new(name, "m", 2e-4))
                .collect::<Vec<_>>()
        };
        let bend = move |observations: &Observations| {
            let height = |row: &Row| row.tool_height / high;
            vec![
                observations.material_column(|row| on(row, -height(row))),
                observations
                    .material_column(|row| on(row, 4.0 * height(row) * (height(row) - 1.0))),
            ]
        };
        variants.push(
            Variant::linear("process.tool_runout", named(&["tilt", "bow"]), bend)
                .with_constants(&constants),
        );
        variants.push(
            Variant::linear(
                "process.tool_runout",
                named(&["a", "tilt", "bow"]),
                move |observations| {
                    let mut columns = vec![observations.material_column(|row| on(row, 1.0))];
                    columns.extend(bend(observations));
                    columns
                },
            )
            .with_constants(&constants),
        );
        let turns = linspace(0.5, 4.0, 29);
        let shape = Shape {
            name: "period",
            unit: "m",
            trials: turns
                .iter()
                .rev()
                .map(|turns| (high - low) / turns)
                .collect(),
            continuous: true,
            distinct: 8.0,
        };
        variants.push(
            Variant::shaped(
                "process.tool_runout",
                named(&["a", "sin", "cos"]),
                shape,
                move |observations, period| {
                    let angle = move |row: &Row| std::f64::consts::TAU * row.tool_height / period;
                    vec![
                        observations.material_column(|row| on(row, 1.0)),
                        observations.material_column(|row| on(row, angle(row).sin())),
                        observations.material_column(|row| on(row, angle(row).cos())),
                    ]
                },
            )
            .with_constants(&constants),
        );
    }
}
