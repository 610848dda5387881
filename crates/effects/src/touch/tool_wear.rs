//! `process.tool_wear`: a tool wears, and the material it leaves grows with the path it has cut.
//!
//! d = rate·(cut length) on the points of that tool. Typical 1–20 µm over its work.

use inference::discrepancy::Covariate;
use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Subject};
use crate::library::{Parameter, Variant, tools};
use crate::observation::Observations;

pub(super) struct ToolWear;

impl Effect for ToolWear {
    fn id(&self) -> &'static str {
        "process.tool_wear"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "tool wear: material left grows with the length cut".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "correct the wear offset of the tool, or change it earlier"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            covariates: &[Covariate::CutLength],
            ..ActsOn::of(Subject::Cutting)
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        tools(rows).into_iter().map(way).collect()
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, constants: &Constants<'_>) -> Vec<Variant> {
        vec![way(constants.tool().unwrap_or(1))]
    }
}

fn parameters() -> Vec<Parameter> {
    vec![Parameter::new("rate", "m/m", 1e-3)]
}

fn way(tool: u32) -> Variant {
    Variant::linear("process.tool_wear", parameters(), move |rows| {
        vec![rows.material_column(|row| {
            if row.tool == Some(tool) {
                row.cut_length
            } else {
                0.0
            }
        })]
    })
    .with_constants(&[("tool", f64::from(tool), "1")])
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

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
