//! The diagnosis of development sessions that another author's simulator wrote, judged by the rules of their README.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use diagnosis::{Options, diagnose};
use score::Score;
use serde_json::Value;

#[path = "../examples/common/mod.rs"]
mod common;
#[path = "../examples/common/score.rs"]
mod score;

#[test]
fn development_sessions_are_explained_and_nothing_innocent_is_named() {
    let Some(directory) = shared_data::path("trials/dev") else {
        return;
    };
    let text = std::fs::read_to_string(directory.join("truth.json")).unwrap();
    let truths: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    let (mut causes, mut verdicts, mut inside, mut judged) = (0, 0, 0, 0);
    let mut ratios: Vec<f64> = Vec::new();
    for (name, truth) in &truths {
        let session = common::read(&directory.join(name)).unwrap();
        let report = diagnose(&session, &Options::default()).unwrap();
        let score = Score::of(truth, &report);
        println!(
            "{name:24} cause {:5} verdict {:5} parameters {}/{} hidden {:?}",
            score.cause, score.verdict, score.inside, score.judged, score.truth
        );
        for miss in &score.missed {
            println!("      {miss}");
        }
        if score.truth.is_empty() {
            assert!(report.effects.is_empty(), "{name}: {report}");
        }
        causes += usize::from(score.cause);
        verdicts += usize::from(score.verdict);
        inside += score.inside;
        judged += score.judged;
        ratios.extend(score.ratio);
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "cause {causes} verdict {verdicts} of {}, parameters {inside}/{judged}",
        truths.len()
    );
    assert_eq!((causes, verdicts, truths.len()), (37, 37, 37));
    assert!(10 * inside >= 9 * judged, "{inside} of {judged} parameters");
    assert!(ratios[ratios.len() / 2] <= 1.10, "{ratios:?}");
}
