//! B-datum: a part that is clamped again lies elsewhere; a best fit tells position from form.
//!
//! mm in figures.

use metrology::profile::fit_position;
use probecell_msgs::geometry_msgs;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use report::{Axis, Plot, Series, Unit};

use super::{CONSTANT, Case, SHIFT, along, noise};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "B-datum",
    effect: "the relocated part lies off by (0.0023, 0.0083) mm",
    source: "height 0.0268 mm at the datum, 0.0228 after best fit; without a constant the shift is found within 0.002 mm, a \
             constant of 0.0014 moves dx by -0.0016; dx and dφ correlate with 0.86",
    run,
    sessions: Some(sessions),
};

const RUNS: usize = 300;

fn shifted(case: &Case, constant: f64) -> Vec<f64> {
    let normals = case.normals.iter();
    normals.map(|n| n.dot(&SHIFT) + constant).collect()
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let case = Case::new()?;
    let fit = |deviations: &[f64]| fit_position(&case.points, &case.normals, deviations);
    let clean = fit(&shifted(&case, 0.0))?;
    let biased = fit(&shifted(&case, CONSTANT))?;
    let mut random = Pcg64::seed_from_u64(run.seed);
    let mut worst = 0.0_f64;
    let mut heights = [0.0; 2];
    let mut shown = None;
    for count in 0..RUNS {
        let noisy: Vec<f64> = shifted(&case, 0.0)
            .iter()
            .zip(noise(&mut random))
            .map(|(t, e)| t + e)
            .collect();
        let found = fit(&noisy)?;
        worst = worst.max((found.shift - SHIFT).amax());
        let both = case.evaluate(&noisy)?;
        heights[0] += both.datum.height() / RUNS as f64 * 1e3;
        heights[1] += both.fitted.height() / RUNS as f64 * 1e3;
        shown.get_or_insert((noisy, found.residuals));
        run.done(count + 1, RUNS);
    }
    let plots = shown.map(|(noisy, residuals)| {
        Plot::new(
            "Relocated part",
            Axis::new("length along the profile", Unit::MM),
            Axis::new("deviation", Unit::UM),
        )
        .with(Series::points("at the datum", along(&case, &noisy)))
        .with(Series::points("after best fit", along(&case, &residuals)))
        .with_size(720, 360)
    });
    let millimetres = |shift: nalgebra::Vector2<f64>| [shift.x * 1e3, shift.y * 1e3];
    Ok(Outcome {
        figures: vec![
            Figure::new(
                "shift_mm",
                "dx, dy found without noise",
                "mm",
                millimetres(clean.shift),
            )
            .source([0.0023, 0.0083])
            .rule(Rule::Near(1e-9)),
            Figure::new(
                "worst_shift_error_mm",
                "largest error of dx, dy in 300 noisy runs",
                "mm",
                worst * 1e3,
            )
            .source(0.002)
            .rule(Rule::AtMost(0.002)),
            Figure::new(
                "bias_mm",
                "error of dx by a constant of 0.0014 mm",
                "mm",
                (biased.shift - SHIFT).x * 1e3,
            )
            .source(-0.0016)
            .rule(Rule::Near(1e-4)),
            Figure::new(
                "correlation",
                "correlation of dx and dφ, size",
                "",
                clean.correlation(0, 2).abs(),
            )
            .source(0.86)
            .rule(Rule::Near(0.01)),
            Figure::new(
                "heights_mm",
                "height of a perfect relocated part at the datum and after best fit, means",
                "mm",
                heights,
            ),
            Figure::new(
                "height_ratio",
                "the second over the first",
                "",
                heights[1] / heights[0],
            )
            .source(0.0228 / 0.0268)
            .rule(Rule::Below(1.0)),
        ],
        plots: plots.into_iter().collect(),
        ..Outcome::default()
    })
}

/// The relocated part measured on a machine, by its datum and with the fitted position in its plan.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let case = Case::new()?;
    let mut random = Pcg64::seed_from_u64(seed);
    let measured: Vec<f64> = shifted(&case, 0.0)
        .iter()
        .zip(noise(&mut random))
        .map(|(t, e)| t + e)
        .collect();
    let relocated = case.session("B-datum, relocated", &measured)?;
    let fit = fit_position(&case.points, &case.normals, &measured)?;
    let mut fitted = relocated.clone();
    "B-datum, fitted".clone_into(&mut fitted.name);
    if let Some(plan) = &mut fitted.plan {
        let pose = &mut plan.part_pose;
        (pose.position.x, pose.position.y) = (fit.shift.x, fit.shift.y);
        pose.orientation = geometry_msgs::Quaternion {
            z: (fit.rotation / 2.0).sin(),
            w: (fit.rotation / 2.0).cos(),
            ..geometry_msgs::Quaternion::default()
        };
    }
    Ok(vec![
        Recorded {
            name: "relocated",
            session: relocated,
            expected: Expected::Effects(&["fixture.shift"], 0.7),
        },
        Recorded {
            name: "fitted",
            session: fitted,
            expected: Expected::NoGap,
        },
    ])
}
