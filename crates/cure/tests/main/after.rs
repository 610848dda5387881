use cure::{Outcome, after, after_table};
use rand::Rng as _;
use rand_pcg::Pcg64;

use crate::known::{constant, effect, parameter, random, report};

/// A scale and a backlash, each times `factor`.
fn axis(scale: f64, backlash: f64, factor: f64) -> [serde_json::Value; 2] {
    [
        effect("axis.X.scale", &[parameter("k", scale * factor, "1")]),
        effect(
            "axis.X.backlash",
            &[
                parameter("b", backlash * factor, "m"),
                constant("last_move", 1.0, "1"),
            ],
        ),
    ]
}

fn sign(random: &mut Pcg64) -> f64 {
    if random.random_bool(0.5) { 1.0 } else { -1.0 }
}

#[test]
fn what_was_loaded_wrongly_is_told_from_what_is_left_over_a_hundred_draws() {
    let mut random = random(7);
    for _ in 0..100 {
        let scale = random.random_range(2e-5..4e-4) * sign(&mut random);
        let backlash = random.random_range(5e-6..4e-5) * sign(&mut random);
        let before = report(&axis(scale, backlash, 1.0));
        for (factor, words) in [
            (2.0, "opposite sign"),
            (1.0, "not loaded"),
            (-1.0, "applied twice"),
            (0.1, "most of it is gone"),
            (1.5, "second compensation"),
        ] {
            let next = report(&axis(scale, backlash, factor));
            let (text, all_gone) = after_table(&before, &[], &next).unwrap();
            let unbroken: Vec<&str> = text.split_whitespace().collect();
            assert_eq!(
                unbroken.join(" ").matches(words).count(),
                2,
                "{factor}: {text}"
            );
            assert!(
                !all_gone && text.lines().all(|line| line.chars().count() <= 100),
                "{text}"
            );
        }
        let (text, all_gone) = after_table(&before, &[], &report(&[])).unwrap();
        assert!(
            all_gone && text.contains("axis.X.backlash\n    gone"),
            "{text}"
        );
    }
}

#[test]
fn a_cause_that_is_one_of_a_group_is_not_taken_for_gone() {
    let before = report(&[effect("axis.X.scale", &[parameter("k", 1e-4, "1")])]);
    let mut other = effect("axis.Y.scale", &[parameter("k", 1e-4, "1")]);
    other["group"] = serde_json::json!(["axis.Y.scale", "axis.X.scale"]);
    let became = after(&before, &[], &report(&[other])).unwrap();
    assert_eq!(became[0].outcome, Outcome::InGroup);
}

#[test]
fn a_report_without_a_cause_that_is_written_has_no_after() {
    let before = report(&[effect("fixture.shift", &[parameter("x", 1e-5, "m")])]);
    let error = after(&before, &[], &report(&[])).unwrap_err().to_string();
    assert!(
        error.contains("no cause that is written into a machine"),
        "{error}"
    );
}
