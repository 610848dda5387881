//! `process.tool_wear`: a tool wears, and the material it leaves grows with the path it has cut.
//!
//! d = rate·(cut length) on the points of that tool. Typical 1–20 µm over its work.

use inference::discrepancy::Covariate;
use machine::Chain;

use crate::effect::{ActsOn, Constants, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::variant::{Variant, tools};

pub(super) struct ToolWear;

impl Effect for ToolWear {
    fn definition(&self) -> Definition {
        Definition {
            id: "process.tool_wear",
            name: "tool wear: material left grows with the length cut",
            remedy: "correct the wear offset of the tool, or change it earlier",
            parameters: &[("rate", "m/m", 1e-3)],
            acts_on: ActsOn::of(Subject::Cutting).covariates(&[Covariate::CutLength]),
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
        "process.tool_wear",
        ToolWear.definition().parameters(),
        move |rows| {
            vec![rows.material_column(|row| {
                if row.tool == Some(tool) {
                    row.cut_length
                } else {
                    0.0
                }
            })]
        },
    )
    .with_constants(&[("tool", f64::from(tool), "1")])
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn material_grows_with_the_path_cut() {
        predicts(
            "process.tool_wear",
            &[("rate", 1e-6, "m/m"), ("tool", 1.0, "1")],
            |seen| {
                if seen.row.tool == Some(1) {
                    1e-6 * seen.row.cut_length
                } else {
                    0.0
                }
            },
        );
    }
}
