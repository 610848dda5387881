//! `process.deflection`: tool or part bends under the cut, the more the farther from the clamping.
//!
//! d = tip·(overhang/length)^m with length the largest overhang; m = 3 for a cantilever loaded at the tool
//! (`docs/source_systems.md, A.6`), 2 for a chuck that tilts; the exponent is profiled. As a beam loaded at its free
//! end, d ~ u²(3 − u)/2 with u = overhang/(free length), tip again at the largest overhang. Typical 5–60 µm.

use inference::discrepancy::Covariate;
use machine::Chain;

use crate::effect::{ActsOn, Constants, Definition, Effect, Instance, Subject};
use crate::observation::{Observations, Row};
use crate::variant::{Shape, Variant, linspace, logspace, tools};

pub(super) struct Deflection;

impl Effect for Deflection {
    fn definition(&self) -> Definition {
        Definition {
            id: "process.deflection",
            name: "deflection of tool or part under the cut",
            remedy: "take a lighter finishing cut or a spring pass, shorten the overhang, or support the part",
            parameters: &[("tip", "m", 5e-4)],
            acts_on: ActsOn::of(Subject::Cutting).covariates(&[Covariate::Overhang]),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let overhangs = rows.rows.iter().map(|row| row.overhang);
        let (low, high) = overhangs.fold((f64::INFINITY, 0.0_f64), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        if high - low < SHORTEST {
            return Vec::new();
        }
        let tools = tools(rows);
        let mut choices: Vec<Option<u32>> = vec![None];
        if tools.len() > 1 {
            choices.extend(tools.into_iter().map(Some));
        }
        choices
            .into_iter()
            .flat_map(|tool| variants(tool, high))
            .collect()
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, constants: &Constants<'_>) -> Vec<Variant> {
        let length = constants.get("length", LENGTH);
        variants(constants.tool(), length).into()
    }
}

/// Overhangs that differ by less do not determine the deflection, m.
const SHORTEST: f64 = 1e-6;
/// Longest overhang where a declaration names none, m.
const LENGTH: f64 = 0.1;

/// What any tool, or one of them, leaves over overhangs up to `high`: the third power, any power, and a beam.
fn variants(tool: Option<u32>, high: f64) -> [Variant; 3] {
    let parameters = || Deflection.definition().parameters();
    let on = move |row: &Row| row.tool.is_some() && (tool.is_none() || row.tool == tool);
    let power = move |rows: &Observations, exponent: f64| {
        vec![rows.material_column(|row| {
            if on(row) {
                (row.overhang / high).max(0.0).powf(exponent)
            } else {
                0.0
            }
        })]
    };
    let beam = move |rows: &Observations, length: f64| {
        let bent = |u: f64| 0.5 * u * u * (3.0 - u);
        vec![rows.material_column(|row| {
            if on(row) {
                bent(row.overhang.max(0.0) / length) / bent(high / length)
            } else {
                0.0
            }
        })]
    };
    let exponent = Shape {
        name: "exponent",
        unit: "1",
        trials: linspace(1.5, 4.0, 6),
        continuous: true,
        distinct: 3.0,
    };
    let free_length = Shape {
        name: "free_length",
        unit: "m",
        trials: logspace(high, 4.0 * high, 5),
        continuous: true,
        distinct: 2.0,
    };
    let mut constants = vec![("length", high, "m")];
    constants.extend(tool.map(|tool| ("tool", f64::from(tool), "1")));
    let id = "process.deflection";
    [
        Variant::linear(id, parameters(), move |rows| power(rows, 3.0)),
        Variant::shaped(id, parameters(), exponent, power),
        Variant::shaped(id, parameters(), free_length, beam).with_prior_weight(0.5),
    ]
    .map(|variant| variant.with_constants(&constants))
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn a_cantilever_bends_with_the_third_power() {
        predicts(
            "process.deflection",
            &[("tip", 2e-5, "m"), ("length", 0.1, "m")],
            |seen| 2e-5 * (seen.row.overhang / 0.1).powi(3),
        );
    }

    #[test]
    fn a_beam_bends_as_its_free_length_says() {
        predicts(
            "process.deflection",
            &[
                ("tip", 2e-5, "m"),
                ("free_length", 0.2, "m"),
                ("length", 0.1, "m"),
                ("tool", 2.0, "1"),
            ],
            |seen| {
                let bent = |u: f64| u * u * (3.0 - u);
                let on = if seen.row.tool == Some(2) { 2e-5 } else { 0.0 };
                on * bent(seen.row.overhang / 0.2) / bent(0.5)
            },
        );
    }
}
