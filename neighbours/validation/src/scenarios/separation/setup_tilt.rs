//! C-setup-tilt: a tilt of the part in the second pass bows the result by a parabola that no shift can separate.
//!
//! µm in figures; 1 µm over the length of 220 mm as the source has it.

use metrology::separation::{SetUp, recursion, reversal, tilt_bow, undetermined, without_line};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use report::{Axis, Plot, Series, Unit};

use super::{LATHE, N, SPACING, error, generatrix, guideway, part, pass, places};
use crate::scenarios::touches::{Touch, session};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "C-setup-tilt",
    effect: "tilt of the part in the second pass",
    source: "a tilt of 1 µm over 220 mm bows the result by 1.375 µm, 0.83 after the line is taken off; a parabola is never \
             separable with unknown tilt; reversal is immune",
    run,
    sessions: Some(sessions),
};

/// Height over the length by which the part is tilted, m.
const TILT: f64 = 1e-6;
const LENGTH: f64 = (N - 1) as f64 * SPACING;

fn run(_run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let (first, moved) = (pass(0, || 0.0).readings, pass(1, || 0.0).readings);
    let clean = recursion(&first, &moved)?.guideway;
    let found = |change: &dyn Fn(f64) -> f64| -> Result<Vec<f64>, ScenarioError> {
        let changed: Vec<f64> = moved
            .iter()
            .zip(places())
            .map(|(k, z)| k + change(z))
            .collect();
        let guideway = recursion(&first, &changed)?.guideway;
        Ok(guideway.iter().zip(&clean).map(|(a, b)| a - b).collect())
    };
    let bowed = found(&|z| TILT * z / LENGTH)?;
    let ramp = found(&|_| TILT)?;
    // A parabola is known by any three of its points.
    let second_difference = bowed[2] - 2.0 * bowed[1] + bowed[0];
    let sagitta = second_difference.abs() * ((N - 1) * (N - 1)) as f64 / 8.0;
    let rest = without_line(&bowed)
        .iter()
        .fold(0.0_f64, |m, e| m.max(e.abs()));
    let turned: Vec<f64> = places()
        .zip(guideway())
        .map(|(z, s)| part(z) - s + TILT + TILT * z / LENGTH)
        .collect();
    let reversed = reversal(&first, &turned)?;
    let null = |shifts: &[usize]| undetermined(N, shifts, SetUp::HeightAndTilt) as f64;
    let plot = Plot::new(
        "Error of the guideway by a tilt of 1 µm over 220 mm",
        Axis::new("place along the guideway", Unit::MM),
        Axis::new("error", Unit::UM),
    )
    .with(Series::line(
        "recursion",
        places().zip(bowed.iter().copied()).collect(),
    ))
    .with(Series::line(
        "its line taken off",
        places().zip(without_line(&bowed)).collect(),
    ));
    Ok(Outcome {
        figures: vec![
            Figure::new("bow_um", "bow of the separated guideway", "µm", sagitta * 1e6)
                .source(1.375)
                .rule(Rule::Near(0.001)),
            Figure::new("bow_after_line_um", "largest error after the line is taken off", "µm", rest * 1e6)
                .source(0.83)
                .rule(Rule::Near(0.01)),
            Figure::new("bow_formula_um", "bow by φL²/(8σ)", "µm", tilt_bow(TILT / LENGTH, LENGTH, SPACING) * 1e6)
                .source(1.375)
                .rule(Rule::Near(0.001)),
            Figure::new("ramp_um", "ramp by a height of 1 µm, at 220 mm", "µm", ramp[N - 1].abs() * 1e6)
                .source(11.0)
                .rule(Rule::Near(0.001)),
            Figure::new("undetermined", "shapes left undetermined with unknown height and tilt: shifts 0, 1; 0, 1, 3; 0, 1, 3, 5; 0, 1, 3, 5, 7", "", [
                null(&[0, 1]), null(&[0, 1, 3]), null(&[0, 1, 3, 5]), null(&[0, 1, 3, 5, 7]),
            ])
                .source([3.0; 4])
                .rule(Rule::Near(0.0)),
            Figure::new("reversal_um", "error by reversal, same height and tilt", "µm", error(&reversed.guideway) * 1e6)
                .source(0.0)
                .rule(Rule::AtMost(1e-9)),
        ],
        plots: vec![plot],
        remarks: vec![
            "Constant, line and parabola are never separable by shifts with unknown tilt; the separation says so by the \
             number of undetermined shapes."
                .to_owned(),
        ],
        ..Outcome::default()
    })
}

/// The second pass alone, on a straight guideway, with the part tilted by 20 µm over its length.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut touches = Vec::new();
    for _ in 0..8 {
        for (point, z) in places().enumerate() {
            let noise: f64 = StandardNormal.sample(&mut random);
            touches.push(Touch {
                point,
                deviation: 20e-6 * z / LENGTH + 1e-6 * noise,
            });
        }
    }
    let plan = generatrix("shaft, second pass");
    Ok(vec![Recorded {
        name: "second_pass",
        session: session("C-setup-tilt, second pass", LATHE, plan, &touches)?,
        expected: Expected::Effects(&["fixture.tilt"], 0.3),
    }])
}
