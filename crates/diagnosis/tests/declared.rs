//! Effects of the declared model against a plant that shares no code with them: what one session promised, the next one
//! of the same machine keeps.

use diagnosis::blind::{Content, measure, session};
use diagnosis::{DeclaredEffect, Options, Session, Verdict, diagnose};

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
            .map(|effect| DeclaredEffect::of(effect, &found))
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
        let mut wrong = DeclaredEffect::of(&found.effects[0], &found);
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
