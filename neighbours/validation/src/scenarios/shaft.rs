//! C-shaft: a good shaft on a good machine; the published summary is met again and nothing is blamed.
//!
//! `docs/source_systems.md, C.5`: Ø280, 220 mm, 12 points, eight repeats, first point zeroed. The source gives no
//! single readings: the shaft here is one with its mean and largest value (an assumption). mm in figures.

use metrology::separation::without_line;
use metrology::slip::{SlipRules, find_slips};
use nalgebra::Vector3;
use probecell_msgs::InspectionFeature;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use report::{Axis, Plot, Series, Unit};

use crate::scenarios::separation::LATHE;
use crate::scenarios::touches::{Touch, plan, planned, round, session};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "C-shaft",
    effect: "nothing: a straight shaft, as the source measured it",
    source: "shaft of 280 mm over 220 mm: largest deviation 0.040, mean 0.007, limit ±0.050 mm",
    run,
    sessions: Some(sessions),
};

const POSITIONS: usize = 12;
const REPEATS: usize = 8;
const SPACING: f64 = 20e-3;
const RADIUS: f64 = 140e-3;
/// Largest deviation and mean of the source, m.
const LARGEST: f64 = 0.040e-3;
const MEAN: f64 = 0.007e-3;
const LIMIT: f64 = 0.050;
/// Standard deviation of a reading, m.
const NOISE: f64 = 1e-6;

/// Deviations from the first point: largest at the free end, with the stated mean.
fn form() -> Vec<f64> {
    let at = |power: f64| -> Vec<f64> {
        (0..POSITIONS)
            .map(|i| LARGEST * (i as f64 / (POSITIONS - 1) as f64).powf(power))
            .collect()
    };
    // The higher the power, the smaller the mean.
    let (mut low, mut high) = (0.5, 20.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if at(middle).iter().sum::<f64>() / POSITIONS as f64 > MEAN {
            low = middle;
        } else {
            high = middle;
        }
    }
    at(f64::midpoint(low, high))
}

/// Readings of every repeat, as they come: the zero is anywhere.
fn readings(random: &mut impl Rng) -> Vec<Vec<f64>> {
    let form = form();
    let zero: f64 = random.random_range(-0.1e-3..0.1e-3);
    (0..REPEATS)
        .map(|_| {
            let noisy = |f: &f64| zero + f + NOISE * random.sample::<f64, _>(StandardNormal);
            form.iter().map(noisy).collect()
        })
        .collect()
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let mut random = Pcg64::seed_from_u64(run.seed);
    let repeats = readings(&mut random);
    let found = find_slips(&repeats, &SlipRules::default())?;
    let zeroed: Vec<f64> = found.medians.iter().map(|m| m - found.medians[0]).collect();
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs())) * 1e3;
    let mean = zeroed.iter().sum::<f64>() / POSITIONS as f64 * 1e3;
    let straight = without_line(&zeroed);
    let flagged = (found.transient.len() + found.persistent.len()) as f64;
    let drawn = |name: &str, values: &[f64]| {
        let points = values.iter().enumerate();
        Series::line(
            name,
            points.map(|(i, v)| (i as f64 * SPACING, *v)).collect(),
        )
    };
    let plot = Plot::new(
        "Shaft, medians of eight repeats",
        Axis::new("place along the shaft", Unit::MM),
        Axis::new("deviation", Unit::UM),
    )
    .with(drawn("first point zero", &zeroed))
    .with(drawn("line taken off", &straight))
    .with(Series::level("limit", LIMIT * 1e-3))
    .with(Series::level("limit", -LIMIT * 1e-3));
    Ok(Outcome {
        figures: vec![
            Figure::new("max_mm", "largest deviation from the first point", "mm", largest(&zeroed))
                .source(0.040)
                .rule(Rule::Near(0.005)),
            Figure::new("mean_mm", "mean deviation from the first point", "mm", mean)
                .source(0.007)
                .rule(Rule::Near(0.005)),
            Figure::new("limit_mm", "largest deviation against the limit", "mm", largest(&zeroed))
                .source(LIMIT)
                .rule(Rule::AtMost(LIMIT)),
            Figure::new("flagged", "readings and positions flagged as slip", "", flagged)
                .rule(Rule::Equals(0.0.into())),
            Figure::new("straightness_mm", "largest deviation after the line is taken off", "mm", largest(&straight)),
        ],
        plots: vec![plot],
        remarks: vec![
            "The source publishes no single readings; the shaft is one with its mean and largest value. With the first \
             point as zero the mean depends on one reading: the line-removed value stands beside it."
                .to_owned(),
        ],
        ..Outcome::default()
    })
}

/// The shaft measured against its known form.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let mut random = Pcg64::seed_from_u64(seed);
    let form = form();
    let points = form
        .iter()
        .enumerate()
        .map(|(i, f)| planned([RADIUS + f, 0.0, i as f64 * SPACING], Vector3::x()))
        .collect();
    let feature = round("shaft", InspectionFeature::CYLINDER, RADIUS);
    let plan = plan("shaft", [0.0; 3], 3e-3, vec![feature], points);
    let touches: Vec<Touch> = (0..REPEATS * POSITIONS)
        .map(|count| Touch {
            point: count % POSITIONS,
            deviation: NOISE * random.sample::<f64, _>(StandardNormal),
        })
        .collect();
    Ok(vec![Recorded {
        name: "known_form",
        session: session("C-shaft, known form", LATHE, plan, &touches)?,
        expected: Expected::NoGap,
    }])
}
