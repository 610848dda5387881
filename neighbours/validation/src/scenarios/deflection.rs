//! A-deflection: a bar held at one end bends away from the turning tool, so a rough cut grows towards the free end.
//!
//! The turn-mill cell cuts and measures a bar of 90 mm at many heights; milling with C locked has the same error
//! everywhere. Heights mm, errors of the diameter or width µm.

use std::collections::BTreeMap;

use metrology::cut_model::LengthError;
use report::{Axis, Plot, Series, Unit};

use crate::scenarios::turn_mill::{ProbeState, Punch, make};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "A-deflection",
    effect: "the part bends under the rough cut",
    source: "rough turning grows to 35 µm at the free end, rough milling is the same at both ends, both finish within \
             ±10 µm",
    run,
    sessions: Some(sessions),
};

/// Rough milling leaves this everywhere, µm (an assumption of A.6).
const MILLED: f64 = 18.0;

/// Standard deviation of a rise between two heights, µm: each is the mean of five touches of 0.5 µm, on the diameter.
const RISE: f64 = 0.63;

/// The cell with a bar that bends, and more heights to see it.
fn bar(seed: u64) -> Result<Punch, ScenarioError> {
    make(ProbeState::Calibrated, seed, &|text| {
        let turned = |size: &str, text: String| {
            // What grows along the bar is no error of the tool, and shall not be corrected by its offset.
            let strict = format!("{{ id = \"{size}\", tolerance_mm = 0.010");
            let open = format!("{{ id = \"{size}\", tolerance_mm = 0.050");
            text.replace(&strict, &open)
        };
        let text = text
            .replace(
                "touch_heights_mm = [5.0, 17.0]",
                "touch_heights_mm = [5.0, 15.0, 25.0]",
            )
            .replace(
                "touch_heights_mm = [58.0, 70.0]",
                "touch_heights_mm = [50.0, 60.0, 70.0, 80.0, 90.0]",
            )
            .replace(", 30.0], [", ", 10.0], [")
            .replace(", 44.0]]", ", 80.0]]")
            .replace("number = 2\nerror_um = 20.0", "number = 2\nerror_um = 0.0")
            .replace(
                "number = 3\nerror_um = 20.0",
                &format!("number = 3\nerror_um = {MILLED:.1}"),
            )
            .replace("gauge_error_um = 6.2", "gauge_error_um = 0.0")
            .replace("reading_residual_um = -0.2", "reading_residual_um = 0.0")
            .replace("reading_residual_um = 0.8", "reading_residual_um = 0.0")
            .replace(
                "cut_sd_um = 1.5",
                "cut_sd_um = 0.3\ndeflection_um = [8.0, 35.0]",
            );
        turned("D1", turned("D2", text))
    })
}

/// Means of the errors of diameter or width by height (mm, µm), turned and milled.
struct Along {
    turned: Vec<(f64, f64)>,
    milled: Vec<(f64, f64)>,
}

fn along(part: &Punch, plan_id: &str) -> Result<Along, ScenarioError> {
    let (plan, deviations) = part.deviations(plan_id)?;
    let means = |turned: bool| -> Vec<(f64, f64)> {
        let mut by_height: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
        for (index, deviation) in &deviations {
            let Some(point) = plan.points.get(*index) else {
                continue;
            };
            let feature = plan.features.get(point.feature as usize);
            if feature.is_some_and(|feature| feature.id.starts_with('D') == turned) {
                let height = (point.position.z * 1e6).round() as i64;
                // A radial deviation is half of the diameter's.
                by_height.entry(height).or_default().push(2e6 * deviation);
            }
        }
        let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
        by_height
            .into_iter()
            .map(|(height, values)| (height as f64 * 1e-3, mean(values)))
            .collect()
    };
    Ok(Along {
        turned: means(true),
        milled: means(false),
    })
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let part = bar(run.seed)?;
    let rough = along(&part, "punch/rough/1")?;
    let finish = along(&part, &part.last_plan()?)?;
    let law = rough
        .turned
        .iter()
        .map(|(z, _)| Ok(LengthError::ROUGH_TURNING.at(z * 1e-3)? * 1e6))
        .collect::<Result<Vec<f64>, ScenarioError>>()?;
    let errors = |pairs: &[(f64, f64)]| -> Vec<f64> { pairs.iter().map(|pair| pair.1).collect() };
    let rises: Vec<f64> = rough
        .turned
        .windows(2)
        .map(|pair| pair[1].1 - pair[0].1)
        .collect();
    let ends = |pairs: &[(f64, f64)]| match (pairs.first(), pairs.last()) {
        (Some(first), Some(last)) => last.1 - first.1,
        _ => f64::NAN,
    };
    let finished: Vec<f64> = errors(&finish.turned)
        .into_iter()
        .chain(errors(&finish.milled))
        .collect();
    let free = rough.turned.last().map_or(f64::NAN, |last| last.1);
    let drawn = |name: &str, pairs: &[(f64, f64)]| {
        Series::points(
            name,
            pairs.iter().map(|(z, e)| (z * 1e-3, e * 1e-6)).collect(),
        )
    };
    let model = (0..=45)
        .map(|i| {
            let z = f64::from(i) * 2e-3;
            Ok((z, LengthError::ROUGH_TURNING.at(z)?))
        })
        .collect::<Result<Vec<_>, ScenarioError>>()?;
    let plot = Plot::new(
        "Error along the bar",
        Axis::new("height above the chuck", Unit::MM),
        Axis::new("error of diameter or width", Unit::UM),
    )
    .with(Series::line("cantilever, A.6, of the rough turning", model))
    .with(drawn("rough turned", &rough.turned))
    .with(drawn("rough milled", &rough.milled))
    .with(drawn("finish turned", &finish.turned))
    .with(drawn("finish milled", &finish.milled))
    .with(Series::level("tolerance", 10e-6))
    .with(Series::level("tolerance", -10e-6));
    Ok(Outcome {
        figures: vec![
            Figure::new("free_end_um", "rough turning at the free end", "µm", free)
                .source(35.0)
                .rule(Rule::Near(2.0)),
            Figure::new(
                "finish_errors_um",
                "errors after finishing, turned then milled",
                "µm",
                finished,
            )
            .rule(Rule::SizeAtMost(10.0)),
            Figure::new(
                "rough_turned_um",
                "rough turning by height; source: cantilever of A.6",
                "µm",
                errors(&rough.turned),
            )
            .source(law)
            .rule(Rule::Near(2.0)),
            Figure::new(
                "turned_rises_um",
                "rough turning: rise from height to height",
                "µm",
                rises,
            )
            .rule(Rule::AtLeast(-3.0 * RISE)),
            Figure::new(
                "milled_rise_um",
                "rough milling: free end less chuck",
                "µm",
                ends(&rough.milled),
            )
            .source(0.0)
            .rule(Rule::SizeAtMost(3.0 * RISE)),
            Figure::new(
                "turned_rise_um",
                "rough turning: free end less chuck",
                "µm",
                ends(&rough.turned),
            ),
        ],
        plots: vec![plot],
        ..Outcome::default()
    })
}

/// The first measurement of the turned bar.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let part = bar(seed)?;
    let mut session = part.session("A-deflection, rough", "punch/rough/1", &["D1", "D2"])?;
    if let Some(plan) = &mut session.plan {
        for point in &mut plan.points {
            point.overhang = point.position.z;
        }
    }
    Ok(vec![Recorded {
        name: "rough",
        session,
        expected: Expected::Effects(&["process.deflection", "process.tool_radius"], 0.2),
    }])
}
