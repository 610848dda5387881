//! B-profile: the systematic error of a milled profile, measured on the first part and taken off the second.
//!
//! 300 simulated pairs of parts. The correction is the deterministic part of the measured deviations, as the project
//! corrects by default; correcting with the raw deviations stands beside it. mm.

use metrology::profile::simulated::{POINTS, Systematic};
use metrology::profile::{ProfileDeviation, Spline, corrected_points, tool_path};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use report::{Axis, Plot, Series, Table, Unit};

use super::{BEFORE, Case, Evaluation, Pair, along};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "B-profile",
    effect: "systematic error along a free-form profile",
    source: "form 0.2712 to 0.0288 mm (89.4 %), mean -0.0607 to +0.0014 mm, best fit 0.0260 mm (corrected misprint)",
    run,
    sessions: Some(sessions),
};

const RUNS: usize = 300;
/// Limits of the register: form at the datum and after best fit, mm; least reduction, %; size of the mean, mm.
const FORM: f64 = 0.042;
const FITTED_FORM: f64 = 0.033;
const REDUCTION: f64 = 84.0;
const MEAN: f64 = 0.003;
/// Share of the runs that has to keep them, %.
const SHARE: f64 = 99.0;
/// Radius of the cutter, m.
const CUTTER: f64 = 6e-3;

/// A size of a part, m.
type Size = fn(&Evaluation) -> f64;

fn reduction(form: f64) -> f64 {
    100.0 * (1.0 - form / BEFORE.form())
}

/// Mean over runs, mm.
fn mean_mm(runs: &[Evaluation], of: impl Fn(&Evaluation) -> f64) -> f64 {
    runs.iter().map(of).sum::<f64>() / runs.len() as f64 * 1e3
}

/// Share of runs, %.
fn share(runs: &[Evaluation], keeps: impl Fn(&Evaluation) -> bool) -> f64 {
    100.0 * runs.iter().filter(|run| keeps(run)).count() as f64 / runs.len() as f64
}

fn keeps_form(run: &Evaluation) -> bool {
    run.datum.form() * 1e3 <= FORM
}

fn keeps_fit(run: &Evaluation) -> bool {
    run.fitted.form() * 1e3 <= FITTED_FORM
}

fn keeps_reduction(run: &Evaluation) -> bool {
    reduction(run.datum.form()) >= REDUCTION
}

fn keeps_mean(run: &Evaluation) -> bool {
    run.datum.mean.abs() * 1e3 <= MEAN
}

fn keeps_all(run: &Evaluation) -> bool {
    keeps_form(run) && keeps_fit(run) && keeps_reduction(run) && keeps_mean(run)
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let case = Case::new()?;
    let mut random = Pcg64::seed_from_u64(run.seed);
    let (mut raw, mut corrected) = (Vec::with_capacity(RUNS), Vec::with_capacity(RUNS));
    let mut shown = None;
    for count in 0..RUNS {
        let pair = Pair::draw(&case, &mut random)?;
        raw.push(case.evaluate(&pair.raw)?);
        corrected.push(case.evaluate(&pair.deterministic)?);
        shown.get_or_insert(pair);
        run.done(count + 1, RUNS);
    }
    let first = match &shown {
        Some(pair) => ProfileDeviation::of(&pair.measured)?,
        None => BEFORE,
    };
    let form = mean_mm(&corrected, |run| run.datum.form());
    let mut figures = vec![
        Figure::new(
            "form_before_mm",
            "form of the first part",
            "mm",
            first.form() * 1e3,
        )
        .source(0.2712)
        .rule(Rule::Near(5e-5)),
        Figure::new(
            "form_after_mm",
            "form of the second part at the datum, mean",
            "mm",
            form,
        )
        .source(0.0288)
        .rule(Rule::AtMost(FORM)),
        Figure::new(
            "form_after_fit_mm",
            "form of the second part after best fit, mean",
            "mm",
            mean_mm(&corrected, |run| run.fitted.form()),
        )
        .source(0.0260)
        .rule(Rule::AtMost(FITTED_FORM)),
        Figure::new(
            "reduction_percent",
            "reduction of the form at the datum",
            "%",
            reduction(form * 1e-3),
        )
        .source(89.4)
        .rule(Rule::AtLeast(REDUCTION)),
        Figure::new(
            "mean_before_mm",
            "mean deviation of the first part",
            "mm",
            first.mean * 1e3,
        )
        .source(-0.0607)
        .rule(Rule::Near(5e-5)),
        Figure::new(
            "mean_after_mm",
            "mean deviation of the second part",
            "mm",
            mean_mm(&corrected, |run| run.datum.mean),
        )
        .source(0.0014)
        .rule(Rule::SizeAtMost(MEAN)),
    ];
    for (key, title, keeps) in [
        (
            "share_form_percent",
            "runs with form at the datum of at most 0.042 mm",
            keeps_form as fn(&Evaluation) -> bool,
        ),
        (
            "share_fit_percent",
            "runs with form after best fit of at most 0.033 mm",
            keeps_fit,
        ),
        (
            "share_reduction_percent",
            "runs with a reduction of at least 84 %",
            keeps_reduction,
        ),
        (
            "share_mean_percent",
            "runs with a mean within ±0.003 mm",
            keeps_mean,
        ),
    ] {
        figures.push(
            Figure::new(key, title, "%", share(&corrected, keeps)).rule(Rule::AtLeast(SHARE)),
        );
    }
    figures.extend(raw_figures(&raw));
    figures.extend(recorded_figures()?);
    let (curve_figures, path) = curve_figures(&case)?;
    figures.extend(curve_figures);
    Ok(Outcome {
        figures,
        plots: shown
            .iter()
            .flat_map(|pair| [plot(&case, pair), after_plot(&case, pair)])
            .chain([path])
            .collect(),
        tables: vec![table(&raw, &corrected)],
        remarks: vec![
            "The rule's 99 % is judged on the default correction, the deterministic part. With the raw deviations the \
             noise of the first measurement is cut into the second part; two such noises of 3 µm and the stated shift \
             give the source's means, and a form above 0.042 mm in about one run of twenty: mean 0.034, deviation 0.003 \
             and 99 % below 0.042 mm do not belong to one distribution."
                .to_owned(),
            "Column 2 of the source's table needs min -0.0124 (its abstract), not -0.0101; column 3 a form of 0.0260, \
             not 0.0196 (92.8 % as printed)."
                .to_owned(),
        ],
    })
}

/// Means with raw correction against B.5.
fn raw_figures(raw: &[Evaluation]) -> Vec<Figure> {
    let near = |key: &'static str, title: &str, ours: f64, source: f64| {
        Figure::new(
            key,
            format!("corrected with raw deviations: {title}"),
            "mm",
            ours,
        )
        .source(source)
        .rule(Rule::NearShare(0.05))
    };
    vec![
        near(
            "raw_form_mm",
            "form at the datum",
            mean_mm(raw, |run| run.datum.form()),
            0.034,
        ),
        near(
            "raw_height_mm",
            "height at the datum",
            mean_mm(raw, |run| run.datum.height()),
            0.031,
        ),
        near(
            "raw_fit_form_mm",
            "form after best fit",
            mean_mm(raw, |run| run.fitted.form()),
            0.0244,
        ),
        near(
            "raw_fit_height_mm",
            "height after best fit",
            mean_mm(raw, |run| run.fitted.height()),
            0.0228,
        ),
        Figure::new(
            "raw_share_percent",
            "corrected with raw deviations: runs that keep all four limits",
            "%",
            share(raw, keeps_all),
        ),
    ]
}

/// The recorded table B.2 with its corrections.
fn recorded_figures() -> Result<Vec<Figure>, ScenarioError> {
    let column = |mean: f64, min: f64, max: f64| ProfileDeviation {
        mean: mean * 1e-3,
        min: min * 1e-3,
        max: max * 1e-3,
    };
    let (datum, fitted) = (
        column(0.0014, -0.0124, 0.0144),
        column(0.0014, -0.0098, 0.0130),
    );
    let found = Systematic::solve(&BEFORE, &[0.0; POINTS])?;
    let forms = [BEFORE.form(), datum.form(), fitted.form()].map(|form| form * 1e3);
    let heights = [BEFORE.height(), datum.height(), fitted.height()].map(|height| height * 1e3);
    Ok(vec![
        Figure::new(
            "recorded_forms_mm",
            "recorded table: form before, at the datum, best fit",
            "mm",
            forms,
        )
        .source([0.2712, 0.0288, 0.0260])
        .rule(Rule::Near(1e-9)),
        Figure::new(
            "recorded_heights_mm",
            "recorded table: height before, at the datum, best fit",
            "mm",
            heights,
        )
        .source([0.1429, 0.0268, 0.0228])
        .rule(Rule::Near(1e-9)),
        Figure::new(
            "recorded_reductions_percent",
            "recorded table: reduction at the datum, best fit",
            "%",
            [reduction(datum.form()), reduction(fitted.form())],
        )
        .source([89.4, 90.4])
        .rule(Rule::Near(0.05)),
        Figure::new(
            "systematic",
            "knee (points), offset and amplitude (mm) that give column 1",
            "",
            [found.knee, found.offset * 1e3, found.amplitude * 1e3],
        )
        .source([91.6162, -0.005583, 0.130122])
        .rule(Rule::Near(5e-5)),
    ])
}

/// The curve itself and the path that would be cut.
fn curve_figures(case: &Case) -> Result<(Vec<Figure>, Plot), ScenarioError> {
    let deviations = Systematic::solve(&BEFORE, &[0.0; POINTS])?.deviations();
    let corrected =
        Spline::interpolate(&corrected_points(&case.points, &case.normals, &deviations)?)?;
    let commanded = case
        .points
        .iter()
        .zip(&deviations)
        .map(|(point, deviation)| (corrected.closest(point).distance - deviation).abs());
    let worst = commanded.fold(0.0, f64::max);
    let path = tool_path(&corrected, CUTTER, POINTS)?;
    let places = |points: &[nalgebra::Vector2<f64>]| points.iter().map(|p| (p.x, p.y)).collect();
    let plot = Plot::new(
        "Profile and path",
        Axis::new("x", Unit::MM),
        Axis::new("y", Unit::MM),
    )
    .with(Series::line("nominal", places(&case.points)))
    .with(Series::line("path of the cutter's centre", places(&path)))
    .with_same_scale();
    let figures = vec![
        Figure::new(
            "length_mm",
            "length of the nominal curve",
            "mm",
            case.curve.length() * 1e3,
        )
        .source(213.64)
        .rule(Rule::Near(5e-4)),
        Figure::new(
            "interpolation_error_um",
            "corrected curve: commanded offset less measured deviation",
            "µm",
            worst * 1e6,
        )
        .source(0.006)
        .rule(Rule::AtMost(0.02)),
    ];
    Ok((figures, plot))
}

fn plot(case: &Case, pair: &Pair) -> Plot {
    Plot::new(
        "Deviations of the first run",
        Axis::new("length along the profile", Unit::MM),
        Axis::new("deviation", Unit::UM),
    )
    .with(Series::points("first part", along(case, &pair.measured)))
    .with(Series::line(
        "its deterministic part",
        along(case, &pair.parts.deterministic),
    ))
    .with(Series::line(
        "process without noise",
        along(case, &pair.system),
    ))
    .with(Series::points(
        "second part",
        along(case, &pair.deterministic),
    ))
    .with_size(720, 360)
}

/// The second part, where the first one's scale hides it.
fn after_plot(case: &Case, pair: &Pair) -> Plot {
    Plot::new(
        "Second part of the first run, at the datum",
        Axis::new("length along the profile", Unit::MM),
        Axis::new("deviation", Unit::UM),
    )
    .with(Series::points(
        "corrected with the deterministic part",
        along(case, &pair.deterministic),
    ))
    .with(Series::points(
        "corrected with the raw deviations",
        along(case, &pair.raw),
    ))
    .with(Series::level("half the form that is allowed", 21e-6))
    .with(Series::level("half the form that is allowed", -21e-6))
    .with_size(720, 320)
}

fn table(raw: &[Evaluation], corrected: &[Evaluation]) -> Table {
    let mut table = Table::new(
        "Second part in mm, means of 300 runs",
        &["", "source", "raw correction", "deterministic part"],
    );
    let rows: [(&str, f64, Size); 5] = [
        ("mean", 0.0014, |run| run.datum.mean),
        ("height at the datum", 0.0268, |run| run.datum.height()),
        ("form at the datum", 0.0288, |run| run.datum.form()),
        ("height after best fit", 0.0228, |run| run.fitted.height()),
        ("form after best fit", 0.0260, |run| run.fitted.form()),
    ];
    for (name, source, of) in rows {
        table.row(vec![
            name.to_owned(),
            format!("{source:.4}"),
            format!("{:.4}", mean_mm(raw, of)),
            format!("{:.4}", mean_mm(corrected, of)),
        ]);
    }
    table
}

/// The first part, whose error along the profile is no effect of the vocabulary and must not become one; and the second,
/// which is left with a constant and lies off.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let case = Case::new()?;
    let pair = Pair::draw(&case, &mut Pcg64::seed_from_u64(seed))?;
    Ok(vec![
        Recorded {
            name: "first_part",
            session: case.session("B-profile, first part", &pair.measured)?,
            expected: Expected::Unknown,
        },
        Recorded {
            name: "second_part",
            session: case.session("B-profile, second part", &pair.deterministic)?,
            expected: Expected::Effects(&["fixture.shift"], 0.8),
        },
    ])
}
