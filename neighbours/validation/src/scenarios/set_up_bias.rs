//! E-setup-bias: a set-up offset of the planar test passes for radius of the tool; both faces of a rib tell it apart.
//!
//! µm. Bias = mean over the heights of the identified less the true radius error.

use machining::flank::RadiusProfile;
use machining::flank::runout::test_heights;
use machining::flank::simulated::{FlankCase, measured_places};
use machining::flank::{RuledPart, Runout};
use metrology::statistics::rms;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use report::{Axis, Plot, Series, Unit};

use crate::scenarios::flank::{Parts, Rib, SEEDS, Told, case};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "E-setup-bias",
    effect: "the rib of the planar test sits off by a constant on the measuring machine",
    source: "bias of the radius errors 6.4 from one face, 0.24 µm from two; rms prediction error from one face 7.0 (S \
             piece) and 6.6 µm (cone)",
    run,
    sessions: Some(sessions),
};

fn bias(case: &FlankCase, profile: &RadiusProfile) -> f64 {
    let errors = profile.heights().iter().zip(profile.errors());
    let sum: f64 = errors
        .map(|(&height, error)| error - case.tool.radius_error(height))
        .sum();
    sum / profile.heights().len() as f64
}

fn miss(
    case: &FlankCase,
    part: &impl RuledPart,
    profile: &RadiusProfile,
    random: &mut Pcg64,
) -> Result<f64, ScenarioError> {
    let places = measured_places(part);
    let measured = case.measured(part, part, &places, random)?;
    let predicted = case.predicted(part, part, Some(profile), &places)?;
    let errors: Vec<f64> = measured.iter().zip(predicted).map(|(m, p)| m - p).collect();
    Ok(rms(&errors))
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let case = case()?;
    let parts = Parts::of(&case)?;
    let (mut one, mut two) = (Vec::new(), Vec::new());
    let mut misses = [0.0; 2];
    for place in 0..SEEDS {
        let mut random = Pcg64::seed_from_u64(run.seed.wrapping_add(place));
        let told = Told::by(&case.planar_test(&mut random)?)?;
        one.push(bias(&case, &told.one_face).abs());
        two.push(bias(&case, &told.two_faces).abs());
        misses[0] += miss(&case, &parts.s, &told.one_face, &mut random)? / SEEDS as f64;
        misses[1] += miss(&case, &parts.cone, &told.one_face, &mut random)? / SEEDS as f64;
        run.done(place as usize + 1, SEEDS as usize);
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let points = |values: &[f64]| {
        let seeds = (1..=values.len()).map(|seed| seed as f64);
        seeds.zip(values.iter().copied()).collect::<Vec<_>>()
    };
    Ok(Outcome {
        figures: vec![
            Figure::new("bias_one_face_um", "bias of the radius errors from one face, mean of 12 seeds", "µm", mean(&one) * 1e6)
                .source(6.4)
                .rule(Rule::Near(0.8)),
            Figure::new("bias_two_faces_um", "bias of the radius errors from two faces, mean of 12 seeds", "µm", mean(&two) * 1e6)
                .source(0.24)
                .rule(Rule::AtMost(0.5)),
            Figure::new("one_face_s_cone_um", "rms prediction error with the profile of one face: S piece, cone", "µm", misses.map(|miss| miss * 1e6))
                .source([7.0, 6.6])
                .rule(Rule::Near(1.0)),
        ],
        plots: vec![
            Plot::new(
                "Bias of the identified radius errors",
                Axis::new("run", Unit::ONE),
                Axis::new("size of the bias", Unit::UM),
            )
            .with(Series::points("one face", points(&one)))
            .with(Series::points("both faces", points(&two)))
            .with(Series::level("set-up offset", case.set_up)),
        ],
        tables: Vec::new(),
        remarks: vec![
            "On one face a set-up offset, a wrong tool radius and a wrong ball radius are the same number; both faces of a rib leave only the offset.".to_owned(),
        ],
    })
}

/// The rib as milled by a tool without run-out, clamped anew and off by the set-up offset.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let mut case = case()?;
    case.tool = Runout {
        offset: 0.0,
        lean: 0.0,
        constant: 0.0,
        ..case.tool
    };
    let heights = test_heights();
    let record = |name, faces, expected| -> Result<Recorded, ScenarioError> {
        let rib = Rib {
            faces,
            heights: &heights,
            cut_here: false,
            gauge: false,
        };
        Ok(Recorded {
            name,
            session: rib.session(name, &case, |side, _| side * case.set_up, seed)?,
            expected,
        })
    };
    Ok(vec![
        record(
            "one_face",
            &[1.0],
            Expected::Effects(
                &["process.tool_radius", "probe.ball_radius", "fixture.shift"],
                0.4,
            ),
        )?,
        record(
            "two_faces",
            &[1.0, -1.0],
            Expected::Effects(&["fixture.shift"], 0.4),
        )?,
    ])
}
