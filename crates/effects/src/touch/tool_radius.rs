//! `process.tool_radius`: a finishing tool's radius is wrong and leaves constant material e on all it cut.
//!
//! d = e on the points of that tool. Typical 1–20 µm.

use inference::discrepancy::Covariate;
use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Subject};
use crate::library::{Parameter, Variant, tools};
use crate::observation::Observations;

pub(super) struct ToolRadius;

impl Effect for ToolRadius {
    fn id(&self) -> &'static str {
        "process.tool_radius"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "radius of the finishing tool wrong: constant material left".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "correct the radius or wear offset of the tool"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            covariates: &[
                Covariate::CutLength,
                Covariate::ToolHeight,
                Covariate::Overhang,
            ],
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
    vec![Parameter::new("e", "m", 1e-3)]
}

fn way(tool: u32) -> Variant {
    Variant::linear("process.tool_radius", parameters(), move |rows| {
        vec![rows.material_column(|row| f64::from(u8::from(row.tool == Some(tool))))]
    })
    .with_constants(&[("tool", f64::from(tool), "1")])
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn only_what_the_tool_cut_is_large() {
        predicts(
            "process.tool_radius",
            &[("e", 5e-6, "m"), ("tool", 2.0, "1")],
            |seen| if seen.row.tool == Some(2) { 5e-6 } else { 0.0 },
        );
    }
}
