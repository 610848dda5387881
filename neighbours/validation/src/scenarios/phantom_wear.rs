//! A-phantom-wear: a probe error is corrected away as if it were tool wear; the register alone looks like a worn insert.
//!
//! The turn-mill cell makes the same part with the same tools before and after the calibration of the probe. A gauge of
//! known diameter tells the two causes apart: it is read with the probe, but no tool has cut it. µm.

use metrology::decision::DecisionLimits;
use metrology::probe_model::Probe;
use nalgebra::Vector3;
use probecell_msgs::{InspectionFeature, Verdict};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use report::{Axis, Plot, Series, Table, Unit};

use crate::scenarios::touches::{Touch, plan, planned, round, session};
use crate::scenarios::turn_mill::{MACHINE, ProbeState, SIZES, make};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "A-phantom-wear",
    effect: "probe error absorbed as tool wear",
    source: "the wear register ends 65 µm lower with the uncalibrated probe for the same tool; a tool error of 50 µm then \
             counts as worn on every feature, though never after calibration",
    run,
    sessions: Some(sessions),
};

/// m; diameter of the gauge.
const GAUGE: f64 = 25e-3;
/// m; a reading error of the gauge beyond this alone takes a size out of its tolerance.
const LIMIT: f64 = 10e-6;
/// m; standard deviation of a touch.
const TOUCH: f64 = 0.5e-6;

/// The probe of the cell file, less what its calibration has stored.
fn probe(state: ProbeState) -> Probe {
    match state {
        ProbeState::Uncalibrated => Probe {
            radius: 3e-3 + 5.5e-6,
            stored_radius: 3e-3,
            offset_x: -30e-6,
            offset_y: 0.0,
        },
        // The gauge that the calibration trusts is 6.2 µm off.
        ProbeState::Calibrated => Probe {
            radius: 3e-3 + 5.5e-6,
            stored_radius: 3e-3 + 5.5e-6 - 3.1e-6,
            ..Probe::default()
        },
    }
}

/// Wear register in µm, mean of both tools, and the last verdict on each size.
fn course(
    state: ProbeState,
    seed: u64,
    tool_error: f64,
) -> Result<(f64, Vec<&'static str>), ScenarioError> {
    let error = format!("error_um = {tool_error:.1}");
    let part = make(state, seed, &|text| text.replace("error_um = 20.0", &error))?;
    let wear = part.wear_um()?;
    let tools = [2, 3].map(|tool| wear.get(&tool).copied().unwrap_or(f64::NAN));
    let verdicts = SIZES
        .iter()
        .map(|(size, _, _)| {
            let last = part.verdicts(size)?.pop();
            Ok(last.map_or("none", |verdict| match verdict.verdict {
                Verdict::QUALIFIED => "qualified",
                Verdict::TOOL_WORN => "tool worn",
                _ => "other",
            }))
        })
        .collect::<Result<Vec<_>, ScenarioError>>()?;
    Ok((f64::midpoint(tools[0], tools[1]), verdicts))
}

/// What a register that looks worn and a reading of the gauge say together.
fn cause(gauge_error: f64) -> &'static str {
    if gauge_error.abs() > LIMIT {
        "probe"
    } else {
        "tool"
    }
}

fn one_word(verdicts: &[&str]) -> String {
    let mut words = verdicts.to_vec();
    words.dedup();
    words.join(", ")
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    use ProbeState::{Calibrated, Uncalibrated};
    let mut done = 0;
    let mut course = |state, error| {
        let found = course(state, run.seed, error);
        done += 1;
        run.done(done, 5);
        found
    };
    let (before, _) = course(Uncalibrated, 20.0)?;
    let (after, _) = course(Calibrated, 20.0)?;
    let (_, blunt_before) = course(Uncalibrated, 50.0)?;
    let (_, blunt_after) = course(Calibrated, 50.0)?;
    // A tool that is really worn as far as the register of the uncalibrated machine claims.
    let (worn, _) = course(Calibrated, 85.0)?;
    let gauge = |state| Ok::<f64, ScenarioError>(probe(state).read_diameter(GAUGE)? - GAUGE);
    let (gauge_before, gauge_after) = (gauge(Uncalibrated)?, gauge(Calibrated)?);
    let mut table = Table::new(
        "What the register says, and what the gauge says",
        &["machine", "register, µm", "gauge error, µm", "cause"],
    );
    for (machine, wear, error) in [
        (
            "probe not calibrated, tool error 20 µm",
            before,
            gauge_before,
        ),
        ("probe calibrated, tool error 20 µm", after, gauge_after),
        ("probe calibrated, tool error 85 µm", worn, gauge_after),
    ] {
        let cause = if wear > -50.0 { "none" } else { cause(error) };
        table.row(vec![
            machine.to_owned(),
            format!("{wear:+.1}"),
            format!("{:+.1}", error * 1e6),
            cause.to_owned(),
        ]);
    }
    let drawn = |name: &str, values: [f64; 3]| {
        let places = [1.0, 2.0, 3.0].into_iter().zip(values);
        Series::points(name, places.map(|(x, y)| (x, y * 1e-6)).collect())
    };
    let gauges = [gauge_before, gauge_after, gauge_after].map(|error| error * 1e6);
    let plot = Plot::new(
        "Apparent wear in a register; a gauge shows its cause",
        Axis::named(
            "probe; error of the tool",
            [
                "not calibrated; 20 µm",
                "calibrated; 20 µm",
                "calibrated; 85 µm",
            ],
        ),
        Axis::new("register, error of the gauge", Unit::UM),
    )
    .with(drawn("wear register", [before, after, worn]))
    .with(drawn("gauge, read less true", gauges))
    .with(Series::level(
        "limit of the register",
        DecisionLimits::default().wear_limit,
    ))
    .with_size(640, 320);
    Ok(Outcome {
        plots: vec![plot],
        figures: vec![
            Figure::new(
                "wear_difference_um",
                "wear register before less after the calibration",
                "µm",
                before - after,
            )
            .source(-65.0)
            .rule(Rule::Near(3.0)),
            Figure::new(
                "wear_before_um",
                "wear register, probe not calibrated",
                "µm",
                before,
            ),
            Figure::new(
                "wear_after_um",
                "wear register, probe calibrated",
                "µm",
                after,
            ),
            Figure::new(
                "blunt_verdict_before",
                "tool error 50 µm, probe not calibrated: every size",
                "",
                one_word(&blunt_before),
            )
            .source("tool worn")
            .rule(Rule::Equals("tool worn".into())),
            Figure::new(
                "blunt_verdict_after",
                "tool error 50 µm, probe calibrated: every size",
                "",
                one_word(&blunt_after),
            )
            .source("qualified")
            .rule(Rule::Equals("qualified".into())),
            Figure::new(
                "worn_register_difference_um",
                "register of a really worn tool less the phantom's",
                "µm",
                worn - before,
            )
            .rule(Rule::SizeAtMost(6.0)),
            Figure::new(
                "gauge_error_before_um",
                "gauge read with the uncalibrated probe",
                "µm",
                gauge_before * 1e6,
            )
            .source(71.0)
            .rule(Rule::Near(0.1)),
            Figure::new(
                "cause_phantom",
                "register and gauge, probe not calibrated",
                "",
                cause(gauge_before),
            )
            .rule(Rule::Equals("probe".into())),
            Figure::new(
                "cause_worn",
                "register and gauge, worn tool",
                "",
                cause(gauge_after),
            )
            .rule(Rule::Equals("tool".into())),
        ],
        tables: vec![table],
        ..Outcome::default()
    })
}

/// The gauge touched before and after the calibration.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let one = |state, name: &'static str, share| -> Result<Recorded, ScenarioError> {
        let mut random = Pcg64::seed_from_u64(seed);
        let probe = probe(state);
        let error = probe.touch_x(GAUGE)? - (GAUGE / 2.0 + probe.stored_radius);
        let mut points = Vec::new();
        for height in [10e-3, 25e-3, 40e-3] {
            for step in 0..12 {
                let angle = f64::from(step) * std::f64::consts::TAU / 12.0;
                let out = Vector3::new(angle.cos(), angle.sin(), 0.0);
                let place = out * (GAUGE / 2.0) + Vector3::z() * height;
                let mut point = planned(place.into(), out);
                // C turns the place to the probe, which comes from +X.
                point.rotary_positions = vec![-angle];
                points.push(point);
            }
        }
        let touches: Vec<Touch> = (0..points.len())
            .map(|point| {
                let noise: f64 = StandardNormal.sample(&mut random);
                Touch {
                    point,
                    deviation: error + TOUCH * noise,
                }
            })
            .collect();
        let feature = round("gauge", InspectionFeature::CYLINDER, GAUGE / 2.0);
        let mut plan = plan("gauge", [-60e-3, 0.0, 0.0], 3e-3, vec![feature], points);
        plan.rotary_names = vec!["C".to_owned()];
        Ok(Recorded {
            name,
            session: session(&format!("A-phantom-wear, {name}"), MACHINE, plan, &touches)?,
            expected: Expected::Effects(&["probe.ball_radius"], share),
        })
    };
    Ok(vec![
        one(ProbeState::Uncalibrated, "gauge_before", 0.1)?,
        one(ProbeState::Calibrated, "gauge_after", 0.3)?,
    ])
}
