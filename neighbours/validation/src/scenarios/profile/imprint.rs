//! B-noise-imprint: correcting with everything measured cuts the noise of the measurement into the next part.
//!
//! mm in figures.

use metrology::autocorrelation::moran;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use report::{Axis, Plot, Series, Unit};

use super::{Case, Pair, along};
use crate::scenarios::{Figure, Outcome, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "B-noise-imprint",
    effect: "the noise of the first measurement is commanded",
    source: "height after best fit 0.0228 mm with the raw deviations, 0.0187 with their deterministic part",
    run,
    sessions: None,
};

/// Pairs of parts; the register asks for at least 50.
const RUNS: usize = 60;

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let case = Case::new()?;
    let mut random = Pcg64::seed_from_u64(run.seed);
    let (mut raw, mut clean, mut better, mut squares) = (0.0, 0.0, 0, 0.0);
    let mut orders = Vec::with_capacity(RUNS);
    let mut left_random = 0;
    let mut shown = None;
    for count in 0..RUNS {
        let pair = Pair::draw(&case, &mut random)?;
        let heights = [&pair.raw, &pair.deterministic]
            .map(|deviations| Ok::<f64, ScenarioError>(case.evaluate(deviations)?.fitted.height()));
        let [with_raw, with_clean] = heights;
        let (with_raw, with_clean) = (with_raw?, with_clean?);
        raw += with_raw / RUNS as f64 * 1e3;
        clean += with_clean / RUNS as f64 * 1e3;
        better += usize::from(with_clean < with_raw);
        let miss = pair.parts.deterministic.iter().zip(&pair.system);
        squares += miss.map(|(d, t)| (d - t).powi(2)).sum::<f64>() / pair.system.len() as f64;
        orders.push(pair.parts.control_points as f64);
        left_random += usize::from(moran(&pair.parts.random).is_some_and(|m| m.is_random()));
        shown.get_or_insert(pair);
        run.done(count + 1, RUNS);
    }
    orders.sort_by(f64::total_cmp);
    let percent = |count: usize| 100.0 * count as f64 / RUNS as f64;
    let plots = shown.map(|pair| {
        Plot::new(
            "Second part of the first run",
            Axis::new("length along the profile", Unit::MM),
            Axis::new("deviation", Unit::UM),
        )
        .with(Series::line("raw correction", along(&case, &pair.raw)))
        .with(Series::line(
            "deterministic part",
            along(&case, &pair.deterministic),
        ))
        .with_size(720, 360)
    });
    Ok(Outcome {
        figures: vec![
            Figure::new(
                "height_raw_mm",
                "height after best fit, raw correction, mean",
                "mm",
                raw,
            )
            .source(0.0228)
            .rule(Rule::NearShare(0.05)),
            Figure::new(
                "height_deterministic_mm",
                "height after best fit, deterministic part, mean",
                "mm",
                clean,
            )
            .source(0.0187)
            .rule(Rule::NearShare(0.05)),
            Figure::new("height_ratio", "the second over the first", "", clean / raw)
                .source(0.0187 / 0.0228)
                .rule(Rule::Below(1.0)),
            Figure::new("runs", "pairs of parts", "", RUNS as f64).rule(Rule::AtLeast(50.0)),
            Figure::new(
                "better_percent",
                "pairs in which the deterministic part is the better correction",
                "%",
                percent(better),
            ),
            Figure::new(
                "deterministic_error_um",
                "root mean square error of the deterministic part",
                "µm",
                (squares / RUNS as f64).sqrt() * 1e6,
            )
            .source(1.25)
            .rule(Rule::NearShare(0.15)),
            Figure::new(
                "control_points",
                "control points of the regression, median",
                "",
                orders[RUNS / 2],
            )
            .source(15.0)
            .rule(Rule::Near(3.0)),
            Figure::new(
                "rest_random_percent",
                "rests that Moran's I alone finds random",
                "%",
                percent(left_random),
            ),
        ],
        plots: plots.into_iter().collect(),
        ..Outcome::default()
    })
}
