//! Effects of the declared model against a plant that shares no code with them: what one session promised, the next one
//! of the same machine keeps.

use diagnosis::{DeclaredEffect, Options, Session, Verdict, diagnose};
use effects::estimates::estimates;
use effects::{DeclaredParameter, candidate, library, observe};
use machine::{Chain, JointKind};
use nalgebra::{DMatrix, DVector};
use validation::blind::{Content, measure, session};

/// Effects of an hour or a clamping: the next session need not have them.
const PASSING: [&str; 5] = ["thermal.", "process.slip", "fixture.", "data.", "time."];

#[test]
fn the_next_session_keeps_the_promise_and_without_it_the_gap_is_back() {
    let (mut judged, mut clean) = (0, 0);
    for seed in 1..40 {
        let content = Content::Known(2);
        let (first, truth) = session(seed, content);
        let passes = |effect: &String| PASSING.iter().any(|of| effect.starts_with(of));
        if truth.effects.iter().any(passes) {
            continue;
        }
        let found = diagnose(&first, &Options::default()).unwrap();
        let mut names: Vec<&String> = found.effects.iter().map(|one| &one.effect).collect();
        let mut hidden: Vec<&String> = truth.effects.iter().collect();
        names.sort();
        hidden.sort();
        if names != hidden {
            continue;
        }
        let plan = first.plan.clone().unwrap();
        let later = measure(seed, content, &plan, 77);
        let bare = diagnose(&later, &Options::default()).unwrap();
        let declared: Vec<DeclaredEffect> = (found.effects.iter())
            .map(|effect| found.declare(effect))
            .collect();
        let known = Session {
            declared,
            ..later.clone()
        };
        let report = diagnose(&known, &Options::default()).unwrap();
        assert!(report.gap.rms < 0.5 * bare.gap.rms, "seed {seed}");
        // What remains is the noise of the touches and the doubt of a few parameters over a hundred touches.
        assert!(
            report.gap.rms < 1.3 * truth.noise,
            "seed {seed}: {:e} with noise {:e}",
            report.gap.rms,
            truth.noise
        );
        assert_eq!(report.declared.len(), 2);
        let last = report.declared[1].achieved.as_ref().unwrap();
        let all = report.declared[0].achieved.as_ref().unwrap();
        assert!(
            (all.rms_before - bare.gap.rms).abs() < 0.2 * bare.gap.rms,
            "seed {seed}"
        );
        assert!(
            (last.rms_after - report.gap.rms).abs() < 0.2 * report.gap.rms,
            "seed {seed}"
        );
        judged += 1;
        clean += usize::from(
            report.verdict == Verdict::NoGap
                && report.declared.iter().all(|one| one.kept == Some(true)),
        );
        if judged == 6 {
            break;
        }
    }
    println!("{clean} of {judged} without a gap");
    assert!(judged == 6 && clean >= 5, "{clean} of {judged}");
}

#[test]
fn a_promise_that_the_machine_no_longer_keeps_is_told() {
    let mut broken = 0;
    for seed in 1..40 {
        let (first, truth) = session(seed, Content::Known(1));
        if truth.effects[0] != "probe.ball_radius" && !truth.effects[0].starts_with("link.") {
            continue;
        }
        let found = diagnose(&first, &Options::default()).unwrap();
        if found.effects.len() != 1 {
            continue;
        }
        let mut wrong = found.declare(&found.effects[0]);
        for parameter in &mut wrong.parameters {
            parameter.value = -parameter.value;
        }
        let session = Session {
            declared: vec![wrong],
            ..first
        };
        let report = diagnose(&session, &Options::default()).unwrap();
        assert_eq!(report.declared[0].kept, Some(false), "seed {seed}");
        assert!(report.gap.rms > found.gap.rms, "seed {seed}");
        let doubled = report.effects[0].parameters[0].value / found.effects[0].parameters[0].value;
        assert!((doubled - 2.0).abs() < 0.1, "seed {seed}: {doubled}");
        broken += 1;
        if broken == 2 {
            return;
        }
    }
    panic!("{broken} sessions only");
}

/// Whatever the library can fit and report, the report says enough to predict: for every variant at a tried shape,
/// from fitted coefficients to reported parameters and back to a signature.
#[test]
fn every_reported_effect_is_predicted_as_it_was_fitted() {
    let mut tried = 0;
    for seed in 1..=4 {
        let (session, _) = session(seed, Content::Clean);
        let observations = observe(&session).unwrap();
        let variants = library(&observations);
        for (place, variant) in variants.iter().enumerate() {
            let trials = variant.shape.as_ref().map_or(&[][..], |it| &it.trials);
            let shape = trials.get(trials.len() / 2).copied().unwrap_or(0.0);
            let found = candidate(&observations, &variants, place, shape);
            let Some(candidate) = found.filter(|_| variant.effect != "process.slip") else {
                continue;
            };
            let count = candidate.block.len();
            let fitted = DVector::from_fn(count, |k, _| 1e-5 * (k as f64 - 1.3));
            let still = DMatrix::zeros(count, count);
            let parameters = estimates(variant, &candidate, &fitted, &still, None, 1.96);
            let declared = DeclaredEffect {
                effect: variant.effect.clone(),
                parameters: (parameters.iter())
                    .map(|one| DeclaredParameter {
                        name: one.name.clone(),
                        value: one.value,
                        unit: one.unit.clone(),
                        ci95: None,
                    })
                    .collect(),
                chosen_from: Vec::new(),
                source: None,
                measured: None,
                promised: None,
            };
            let acting = declared
                .acting(&observations.chain)
                .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
            let predicted = acting.signature(&observations);
            let wanted = candidate.signature(fitted.as_slice());
            for (row, wanted) in wanted.iter().enumerate() {
                let found = predicted[row];
                assert!(
                    (found - wanted).abs() < 1e-10,
                    "seed {seed}, {} {:?}: row {row} has {found:e} for {wanted:e}",
                    variant.effect,
                    declared.parameters,
                );
            }
            tried += 1;
        }
    }
    assert!(tried > 200, "{tried} variants");
}

#[test]
fn numbers_that_nobody_can_mean_are_refused() {
    let slide = |seed| {
        let (session, _) = session(seed, Content::Clean);
        let chain = Chain::from_urdf(&session.robot_description).unwrap();
        let mut axes = (0..chain.axes().len()).map(|axis| chain.axis(axis));
        let slide = axes.find(|joint| joint.kind == JointKind::Prismatic)?;
        Some((session, format!("axis.{}.cyclic", slide.name)))
    };
    let (session, cyclic) = (1..20).find_map(slide).unwrap();
    let declared = |effect: &str, parameters: &[(&str, f64, &str)]| DeclaredEffect {
        effect: effect.to_owned(),
        parameters: (parameters.iter())
            .map(|&(name, value, unit)| DeclaredParameter {
                name: name.to_owned(),
                value,
                unit: unit.to_owned(),
                ci95: None,
            })
            .collect(),
        chosen_from: Vec::new(),
        source: None,
        measured: None,
        promised: None,
    };
    let wave = |period| {
        [
            ("a", 1e-6, "m"),
            ("phase", 0.0, "rad"),
            ("period", period, "m"),
        ]
    };
    for (effect, says) in [
        (declared(&cyclic, &wave(0.0)), "must be positive"),
        (declared(&cyclic, &wave(-0.01)), "must be positive"),
        (declared(&cyclic, &wave(1e-320)), "not in the unit"),
        (
            declared("probe.ball_radius", &[("dr", 3.5, "m")]),
            "not in the unit",
        ),
        (
            declared("probe.ball_radius", &[("dr", 1e300, "m")]),
            "not in the unit",
        ),
        (
            declared("probe.ball_radius", &[("dr", 1e-6, "m"), ("dr", 2e-6, "m")]),
            "form no known combination",
        ),
    ] {
        let session = Session {
            declared: vec![effect],
            ..session.clone()
        };
        let told = observe(&session).map(|_| "nothing".to_owned());
        let told = told.unwrap_or_else(|error| error.to_string());
        assert!(told.contains(says), "{:?}: {told}", session.declared[0]);
    }
}
