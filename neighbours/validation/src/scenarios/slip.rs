//! C-slip: the drive slips and moves the tool post; exactly that reading or position is flagged.
//!
//! The bore of `docs/source_systems.md, C.5`: 11 points every 100 mm, five repeats. mm in figures.

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
    name: "C-slip",
    effect: "the tool post jumps",
    source: "bore of 1.8 m: within ±1 mm, but 5 mm at 300 mm, attributed to slip of the drive",
    run,
    sessions: Some(sessions),
};

const POSITIONS: usize = 11;
const REPEATS: usize = 5;
/// The position at 300 mm.
const SLIPPED: usize = 3;
const SPACING: f64 = 100e-3;
/// m.
const JUMP: f64 = 5e-3;
const NOISE: f64 = 0.05e-3;
const RADIUS: f64 = 0.9;
const RUNS: usize = 1000;

/// Form of a bore within ±0.4 mm, and the readings of every repeat.
fn bore(random: &mut impl Rng) -> (Vec<f64>, Vec<Vec<f64>>) {
    let form: Vec<f64> = (0..POSITIONS)
        .map(|_| random.random_range(-0.4e-3..0.4e-3))
        .collect();
    let repeats = (0..REPEATS)
        .map(|_| {
            let noisy = |f: &f64| f + NOISE * random.sample::<f64, _>(StandardNormal);
            form.iter().map(noisy).collect()
        })
        .collect();
    (form, repeats)
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let mut random = Pcg64::seed_from_u64(run.seed);
    let rules = SlipRules::default();
    let (mut transient, mut persistent, mut clean) = (0, 0, 0);
    let (mut rest, mut jumps) = (0.0_f64, Vec::new());
    let mut shown = None;
    for count in 0..RUNS {
        let (_, good) = bore(&mut random);
        let nothing = find_slips(&good, &rules)?;
        clean += usize::from(nothing.transient.is_empty() && nothing.persistent.is_empty());
        let repeat = random.random_range(0..REPEATS);
        let mut once = good.clone();
        once[repeat][SLIPPED] += JUMP;
        let found = find_slips(&once, &rules)?;
        let exact = matches!(found.transient[..], [(r, SLIPPED, _)] if r == repeat);
        transient += usize::from(exact && found.persistent.is_empty());
        let mut always = good;
        for readings in &mut always {
            readings[SLIPPED] += JUMP;
        }
        let found = find_slips(&always, &rules)?;
        let exact = matches!(found.persistent[..], [(SLIPPED, _)]);
        persistent += usize::from(exact && found.transient.is_empty());
        jumps.extend(found.persistent.iter().map(|(_, jump)| *jump));
        rest = found.sound().fold(rest, |worst, (_, m)| worst.max(m.abs()));
        shown.get_or_insert((always, found));
        run.done(count + 1, RUNS);
    }
    let percent = |count: usize| 100.0 * count as f64 / RUNS as f64;
    let jump = jumps.iter().sum::<f64>() / jumps.len() as f64;
    let all = Rule::AtLeast(100.0);
    Ok(Outcome {
        figures: vec![
            Figure::new(
                "persistent_exact_percent",
                "jump in every repeat: exactly that position flagged",
                "%",
                percent(persistent),
            )
            .rule(all.clone()),
            Figure::new(
                "transient_exact_percent",
                "jump in one repeat: exactly that reading flagged",
                "%",
                percent(transient),
            )
            .rule(all.clone()),
            Figure::new(
                "clean_percent",
                "no jump: nothing flagged",
                "%",
                percent(clean),
            )
            .rule(all),
            Figure::new("jump_mm", "size of the jump, mean", "mm", jump * 1e3)
                .source(5.0)
                .rule(Rule::Near(0.5)),
            Figure::new(
                "rest_mm",
                "largest of the positions that are not flagged",
                "mm",
                rest * 1e3,
            )
            .source(1.0)
            .rule(Rule::AtMost(1.0)),
        ],
        plots: shown
            .map(|(repeats, found)| plot(&repeats, &found))
            .into_iter()
            .collect(),
        ..Outcome::default()
    })
}

fn plot(repeats: &[Vec<f64>], found: &metrology::slip::Slips) -> Plot {
    let at = |p: usize| p as f64 * SPACING;
    let readings = repeats
        .iter()
        .flat_map(|repeat| repeat.iter().enumerate().map(|(p, v)| (at(p), *v)));
    let flagged = found
        .persistent
        .iter()
        .map(|(p, _)| (at(*p), found.medians[*p]));
    Plot::new(
        "Bore with a jump at 300 mm",
        Axis::new("depth", Unit::MM),
        Axis::new("deviation", Unit::MM),
    )
    .with(Series::points("readings", readings.collect()))
    .with(Series::points("flagged", flagged.collect()))
    .with(Series::level("limit", 1e-3))
    .with(Series::level("limit", -1e-3))
}

/// Five repeats of a bore of known form; in the third the tool post slips at 300 mm and stays where it is.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let mut random = Pcg64::seed_from_u64(seed);
    let (form, repeats) = bore(&mut random);
    let begin = 2 * POSITIONS + SLIPPED;
    let one = |name: &'static str, jump: f64, expected| -> Result<Recorded, ScenarioError> {
        // A bore's material in excess lies inwards; the form is known, so the plan follows it.
        let points = form
            .iter()
            .enumerate()
            .map(|(p, f)| planned([RADIUS - f, 0.0, p as f64 * SPACING], -Vector3::x()))
            .collect();
        let feature = round("bore", InspectionFeature::BORE, RADIUS);
        let plan = plan("bore", [0.0; 3], 3e-3, vec![feature], points);
        let touches: Vec<Touch> = repeats
            .iter()
            .flat_map(|repeat| repeat.iter().enumerate())
            .enumerate()
            .map(|(count, (point, reading))| Touch {
                point,
                deviation: reading - form[point] + if count >= begin { jump } else { 0.0 },
            })
            .collect();
        Ok(Recorded {
            name,
            session: session(&format!("C-slip, {name}"), LATHE, plan, &touches)?,
            expected,
        })
    };
    Ok(vec![
        one("slipped", JUMP, Expected::Effects(&["process.slip"], 0.1))?,
        one("held", 0.0, Expected::NoGap)?,
    ])
}
