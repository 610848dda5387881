//! The sample recordings of `bags/samples`: made again they hold the same messages, replayed they are equal, and
//! diagnosed they say what their recipes promise. `cargo run --release -p xtask -- bags` makes them again.

use bags::Bag;
use cell_tests::{factories, recording, sample};
use expect_test::expect_file;
use graph::{
    replay::{Verdict, replay},
    topics,
};

/// Every sample with its recording.
fn samples() -> Vec<(String, sample::Recipe, Bag)> {
    let names = sample::names();
    assert!((3..=6).contains(&names.len()), "{names:?}");
    names
        .into_iter()
        .map(|name| {
            let file = sample::folder().join(format!("{name}.mcap"));
            let size = std::fs::metadata(&file).expect("a sample").len();
            assert!(size < 1 << 20, "{name} has {size} bytes");
            let bag = Bag::open(&file).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(bag.damage(), []);
            (name.clone(), sample::recipe(&name), bag)
        })
        .collect()
}

#[test]
fn a_sample_made_again_holds_the_same_messages() {
    for (name, recipe, bag) in samples() {
        let cell = sample::cell(&recipe);
        let stored = sample::read(&cell, &bag);
        let made = sample::make(&recipe, &cell);
        assert_eq!(stored.len(), made.len(), "{name}: number of messages");
        for (stored, made) in stored.iter().zip(&made) {
            let key = (&stored.topic, stored.sequence, stored.at);
            assert_eq!(key, (&made.topic, made.sequence, made.at), "{name}");
            let difference = sample::difference(stored, made);
            assert_eq!(
                difference, None,
                "{name}: {} {}",
                stored.topic, stored.sequence
            );
        }
    }
}

#[test]
fn the_part_of_a_sample_ends_as_its_recipe_says() {
    for (name, recipe, bag) in samples() {
        let log = sample::read(&sample::cell(&recipe), &bag);
        // A reference that comes late revokes what was reported before: the last report holds.
        let verdict = log
            .iter()
            .filter(|published| published.topic == topics::PART_REPORTS.name)
            .flat_map(|published| sample::described(published).leaves())
            .filter(|(path, _)| path == "verdict")
            .map(|(_, verdict)| verdict)
            .next_back();
        assert_eq!(verdict, Some(recipe.part_verdict.to_string()), "{name}");
    }
}

#[test]
fn a_sample_and_its_readable_twin_say_the_same() {
    for (name, recipe, bag) in samples() {
        let twin = std::fs::read_to_string(sample::folder().join(format!("{name}.jsonl")))
            .unwrap_or_else(|error| panic!("{name}.jsonl: {error}"));
        let expected = sample::twin(&name, &sample::read(&sample::cell(&recipe), &bag));
        for (number, (line, expected)) in twin.lines().zip(expected.lines()).enumerate() {
            assert_eq!(line, expected, "{name}.jsonl:{}", number + 1);
        }
        assert_eq!(twin.lines().count(), expected.lines().count(), "{name}");
    }
}

#[test]
fn a_sample_replays_equal() {
    for (name, recipe, bag) in samples() {
        let cell = sample::cell(&recipe);
        let stored = recording(&sample::read(&cell, &bag));
        let report = replay(&stored, &factories(&cell, &cell.node_names()))
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(
            report.verdict,
            Verdict::Equal,
            "{name}: {:?}",
            report.first_difference
        );
    }
}

#[test]
fn a_sample_is_diagnosed_as_its_recipe_says() {
    for (name, recipe, _) in samples() {
        let cell = sample::cell(&recipe);
        let file = sample::folder().join(format!("{name}.mcap"));
        let report = sample::gap_report(&name, &recipe, &cell, &file);
        let verdict = serde_json::to_value(report.verdict).expect("a verdict");
        assert_eq!(verdict, serde_json::json!(recipe.verdict), "{name}");
        let effects: Vec<&str> = report
            .effects
            .iter()
            .map(|effect| effect.effect.as_str())
            .collect();
        assert_eq!(effects, recipe.effects, "{name}");
        expect_file![file.with_extension("report.txt")].assert_eq(&format!("{report}\n"));
    }
}
