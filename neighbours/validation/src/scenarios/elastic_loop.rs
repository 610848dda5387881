//! A-elastic-loop: what springs back under the cut does not repeat, and correcting it overshoots.
//!
//! The plant's equation alone, and the turn-mill cell with and without its spring pass: a cut with unchanged offsets
//! whose measurement shows the part of the error that a correction may take off. µm on the diameter.

use metrology::cut_model::CutModel;
use probecell_msgs::Verdict;
use report::{Axis, Plot, Series, Unit};

use crate::scenarios::turn_mill::{ProbeState, Punch, make};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "A-elastic-loop",
    effect: "spring-back compensated as if it were a tool error",
    source: "share 0.035 of a depth of 0.5 mm: the first cut leaves +17.5 µm, a correction by it -16.3, an uncompensated \
             spring pass +0.6",
    run,
    sessions: Some(sessions),
};

/// κ of A.4.
const SHARE: f64 = 0.035;

/// The cell on stock that leaves 0.5 mm for every pass, with tools that are right.
fn punch(seed: u64, spring_pass: bool) -> Result<Punch, ScenarioError> {
    make(ProbeState::Calibrated, seed, &|text| {
        let text = text
            .replace("allowance_mm = 0.3", "allowance_mm = 0.5")
            .replace(
                "nominal_mm = 19.8\nstock_mm = 26.0",
                "nominal_mm = 19.8\nstock_mm = 20.8",
            )
            .replace(
                "nominal_mm = 23.5\nstock_mm = 26.0",
                "nominal_mm = 23.5\nstock_mm = 24.5",
            )
            .replace("stock_mm = 23.5", "stock_mm = 18.8")
            .replace("error_um = 20.0", "error_um = 0.0")
            .replace("gauge_error_um = 6.2", "gauge_error_um = 0.0")
            .replace("reading_residual_um = -0.2", "reading_residual_um = 0.0")
            .replace("reading_residual_um = 0.8", "reading_residual_um = 0.0")
            .replace("spring_back = 0.0", &format!("spring_back = {SHARE}"))
            .replace("cut_sd_um = 1.5", "cut_sd_um = 0.0");
        if spring_pass {
            text.replace("[compensation]\n", "[compensation]\nspring_pass = true\n")
        } else {
            text
        }
    })
}

/// Errors of D1 as the cell read them, µm, measurement by measurement, and the last verdict.
fn course(part: &Punch) -> Result<(Vec<f64>, String), ScenarioError> {
    let verdicts = part.verdicts("D1")?;
    let last = verdicts.last().map_or("none", |last| match last.verdict {
        Verdict::QUALIFIED => "qualified",
        Verdict::OVERCUT_NOT_COMPENSABLE => "overcut, not compensable",
        _ => "other",
    });
    let errors = verdicts.iter().map(|verdict| verdict.error * 1e6).collect();
    Ok((errors, last.to_owned()))
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let plant = CutModel {
        tool_error: 0.0,
        elastic_share: SHARE,
    };
    let (nominal, depth) = (19.8e-3, 0.5e-3);
    let first = plant.cut(nominal, nominal + depth);
    let compensated = plant.cut(nominal - (first - nominal), first);
    let spring = plant.cut(nominal, first);
    let micro = |size: f64| (size - nominal) * 1e6;
    let (ignored, ignored_verdict) = course(&punch(run.seed, false)?)?;
    run.done(1, 2);
    let (handled, handled_verdict) = course(&punch(run.seed, true)?)?;
    let at = |course: &[f64], index: usize| course.get(index).copied().unwrap_or(f64::NAN);
    let drawn = |name: &str, course: &[f64]| {
        let points = course.iter().enumerate();
        Series::line(
            name,
            points.map(|(i, e)| ((i + 1) as f64, e * 1e-6)).collect(),
        )
    };
    let plot = Plot::new(
        "Error of D1 from measurement to measurement",
        Axis::named("measurement", ["1", "2", "3", "4"]),
        Axis::new("error of the diameter", Unit::UM),
    )
    .with(drawn("corrected at once", &ignored))
    .with(drawn("spring pass first", &handled))
    .with(Series::level("tolerance", 10e-6))
    .with(Series::level("tolerance", -10e-6));
    Ok(Outcome {
        figures: vec![
            Figure::new(
                "compensated_um",
                "cell: corrected at once and cut again",
                "µm",
                at(&ignored, 1),
            )
            .source(-16.3)
            .rule(Rule::Near(1.5)),
            Figure::new(
                "spring_pass_um",
                "cell: cut again without a correction",
                "µm",
                at(&handled, 1),
            )
            .source(0.6)
            .rule(Rule::Near(1.5)),
            Figure::new("first_um", "cell: the first cut", "µm", at(&ignored, 0))
                .source(17.5)
                .rule(Rule::Near(1.5)),
            Figure::new(
                "plant_um",
                "equation: first cut, corrected, spring pass",
                "µm",
                [micro(first), micro(compensated), micro(spring)],
            )
            .source([17.5, -16.3, 0.6])
            .rule(Rule::Near(0.05)),
            Figure::new(
                "ignored_verdict",
                "verdict on D1 without a spring pass",
                "",
                ignored_verdict,
            )
            .rule(Rule::Equals("overcut, not compensable".into())),
            Figure::new(
                "handled_verdict",
                "verdict on D1 with a spring pass in each pass",
                "",
                handled_verdict,
            )
            .rule(Rule::Equals("qualified".into())),
            Figure::new(
                "handled_last_um",
                "error of the finished D1",
                "µm",
                handled.last().copied().unwrap_or(f64::NAN),
            )
            .rule(Rule::SizeAtMost(10.0)),
        ],
        plots: vec![plot],
        ..Outcome::default()
    })
}

/// The last measurement of the diameters where the correction was made at once: they are too small.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let part = punch(seed, false)?;
    let plan_id = part.last_plan()?;
    let name = "A-elastic-loop, corrected at once";
    Ok(vec![Recorded {
        name: "corrected_at_once",
        session: part.session(name, &plan_id, &["D1", "D2"])?,
        expected: Expected::Effects(&["process.tool_radius"], 0.2),
    }])
}
