//! `process.tool_runout`: the effective radius varies along the tool's height.
//!
//! Leaning and bent: d = a − tilt·h + 4·bow·h(h − 1), h the height over the highest used (sign of tilt as in
//! `docs/source_systems.md, E.2`, where the radius grows towards the tip). With flutes on a helix
//! (`docs/source_systems.md, E.2`) it is periodic in the height: d = a + s·sin(2πz/period) + c·cos(2πz/period).
//! Typical 1–20 µm.

use inference::discrepancy::Covariate;
use machine::Chain;

use crate::effect::{ActsOn, Constants, Definition, Effect, Instance, Subject};
use crate::observation::{Observations, Row};
use crate::variant::{Parameter, Shape, Variant, linspace, tools};

pub(super) struct ToolRunout;

impl Effect for ToolRunout {
    fn definition(&self) -> Definition {
        Definition {
            id: "process.tool_runout",
            name: "tool run-out: effective radius varies along the tool",
            remedy: "clean holder and collet, and clamp the tool again; check its run-out",
            parameters: &[],
            acts_on: ActsOn::of(Subject::Cutting).covariates(&[Covariate::ToolHeight]),
        }
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        PARAMETERS.map(parameter).into()
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let mut variants = Vec::new();
        for tool in tools(rows) {
            let cut = rows.rows.iter().filter(|row| row.tool == Some(tool));
            let heights = cut.map(|row| row.tool_height);
            let (low, high) = heights.fold((f64::INFINITY, 0.0_f64), |(low, high), at| {
                (low.min(at), high.max(at))
            });
            if high - low >= SHORTEST {
                let turns = linspace(0.5, 4.0, 29).into_iter().rev();
                variants.extend(of_tool(
                    tool,
                    high,
                    turns.map(|turns| (high - low) / turns).collect(),
                ));
            }
        }
        variants
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, constants: &Constants<'_>) -> Vec<Variant> {
        let tool = constants.tool().unwrap_or(1);
        of_tool(tool, constants.get("height", HEIGHT), Vec::new()).into()
    }
}

/// Heights that differ by less do not determine the run-out, m.
const SHORTEST: f64 = 1e-6;
/// Greatest height along the tool where a declaration names none, m.
const HEIGHT: f64 = 0.1;
/// All linear parameters.
const PARAMETERS: [&str; 5] = ["a", "tilt", "bow", "sin", "cos"];

fn parameter(name: &'static str) -> Parameter {
    Parameter::new(name, "m", 2e-4)
}

/// Bent without and with a constant, and a wave, over a tool that is used up to the height `high`.
fn of_tool(tool: u32, high: f64, periods: Vec<f64>) -> [Variant; 3] {
    let constants = [("tool", f64::from(tool), "1"), ("height", high, "m")];
    let on = move |row: &Row, value: f64| if row.tool == Some(tool) { value } else { 0.0 };
    let bend = move |rows: &Observations| {
        let height = |row: &Row| row.tool_height / high;
        vec![
            rows.material_column(|row| on(row, -height(row))),
            rows.material_column(|row| on(row, 4.0 * height(row) * (height(row) - 1.0))),
        ]
    };
    let with_constant = move |rows: &Observations| {
        let mut columns = vec![rows.material_column(|row| on(row, 1.0))];
        columns.extend(bend(rows));
        columns
    };
    let shape = Shape {
        name: "period",
        unit: "m",
        trials: periods,
        continuous: true,
        distinct: 8.0,
    };
    let wave = move |rows: &Observations, period: f64| {
        let angle = move |row: &Row| std::f64::consts::TAU * row.tool_height / period;
        vec![
            rows.material_column(|row| on(row, 1.0)),
            rows.material_column(|row| on(row, angle(row).sin())),
            rows.material_column(|row| on(row, angle(row).cos())),
        ]
    };
    let id = "process.tool_runout";
    let named = |names: &[&'static str]| names.iter().copied().map(parameter).collect();
    [
        Variant::linear(id, named(&["tilt", "bow"]), bend),
        Variant::linear(id, named(&["a", "tilt", "bow"]), with_constant),
        Variant::shaped(id, named(&["a", "sin", "cos"]), shape, wave),
    ]
    .map(|variant| variant.with_constants(&constants))
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn a_leaning_tool_cuts_less_at_its_shank() {
        predicts(
            "process.tool_runout",
            &[
                ("tilt", 4e-6, "m"),
                ("bow", 1e-6, "m"),
                ("tool", 1.0, "1"),
                ("height", 0.03, "m"),
            ],
            |seen| {
                let h = seen.row.tool_height / 0.03;
                let on = if seen.row.tool == Some(1) { 1.0 } else { 0.0 };
                on * (-4e-6 * h + 4e-6 * h * (h - 1.0))
            },
        );
    }

    #[test]
    fn flutes_on_a_helix_leave_a_wave() {
        predicts(
            "process.tool_runout",
            &[
                ("a", 1e-6, "m"),
                ("sin", 2e-6, "m"),
                ("cos", 0.0, "m"),
                ("period", 0.01, "m"),
                ("tool", 1.0, "1"),
                ("height", 0.03, "m"),
            ],
            |seen| {
                let on = if seen.row.tool == Some(1) { 1.0 } else { 0.0 };
                let turn = std::f64::consts::TAU * seen.row.tool_height / 0.01;
                on * (1e-6 + 2e-6 * turn.sin())
            },
        );
    }
}
