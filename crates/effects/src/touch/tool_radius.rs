//! `process.tool_radius`: a finishing tool's radius is wrong and leaves constant material e on all it cut.
//!
//! d = e on the points of that tool. Typical 1–20 µm.

use inference::discrepancy::Covariate;
use machine::Chain;

use crate::effect::{ActsOn, Constants, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::variant::{Variant, tools};

pub(super) struct ToolRadius;

impl Effect for ToolRadius {
    fn definition(&self) -> Definition {
        Definition {
            id: "process.tool_radius",
            name: "radius of the finishing tool wrong: constant material left",
            remedy: "correct the radius or wear offset of the tool",
            parameters: &[("e", "m", 1e-3)],
            acts_on: ActsOn::of(Subject::Cutting).covariates(&[
                Covariate::CutLength,
                Covariate::ToolHeight,
                Covariate::Overhang,
            ]),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        tools(rows).into_iter().map(variant).collect()
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, constants: &Constants<'_>) -> Vec<Variant> {
        vec![variant(constants.tool().unwrap_or(1))]
    }
}

fn variant(tool: u32) -> Variant {
    Variant::linear(
        "process.tool_radius",
        ToolRadius.definition().parameters(),
        move |rows| vec![rows.material_column(|row| f64::from(u8::from(row.tool == Some(tool))))],
    )
    .with_constants(&[("tool", f64::from(tool), "1")])
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn only_what_the_tool_cut_is_large() {
        predicts(
            "process.tool_radius",
            &[("e", 5e-6, "m"), ("tool", 2.0, "1")],
            |seen| if seen.row.tool == Some(2) { 5e-6 } else { 0.0 },
        );
    }
}
