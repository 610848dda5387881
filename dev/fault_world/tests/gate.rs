//! Every order of events about two corrections, two operators, losses and repetitions within stated bounds.

use fault_world::{Bounds, Cells, Search, Tamper};
use serde_json::{Value, json};

/// More states than any of the searches has.
const LIMIT: usize = 100_000;

/// What may happen in each search. Every message may overtake those on other ways in all of them.
const SEARCHES: [Bounds; 3] = [
    Bounds {
        answers: 2,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        losses: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        repeats: 1,
        ..NOTHING
    },
];

const NOTHING: Bounds = Bounds {
    answers: 0,
    stops: 0,
    losses: 0,
    repeats: 0,
    restarts: 0,
    forgeries: 0,
    periods: 0,
};

#[test]
fn no_order_of_events_writes_a_correction_that_must_not_be_written() {
    let cells = Cells::default();
    let mut search = Search::new(cells.of(1), None);
    let (mut states, mut writes) = (0, 0);
    for bounds in SEARCHES {
        let found = search.run(bounds, LIMIT);
        println!(
            "{bounds:?}: {} states, {} steps, {} writes",
            found.states, found.steps, found.writes
        );
        assert_eq!(found.violation, None, "{bounds:?}");
        assert!(found.states < LIMIT, "{bounds:?} is not exhausted");
        states += found.states;
        writes += found.writes;
    }
    println!("{states} states");
    assert!(
        states > 20_000 && writes > 50,
        "{states} states, {writes} writes"
    );
}

/// A gate that forgets is found out, by the shortest order of events that shows it.
#[test]
fn a_gate_that_forgets_is_found_out() {
    fn applied(state: &mut Value) {
        state["applied"] = json!({});
        // It takes what the driver holds for what the correction was computed from.
        for writing in [&mut state["controller"]["status"]["tool_wear"]] {
            for wear in writing.as_array_mut().into_iter().flatten() {
                *wear = json!(0.0);
            }
        }
    }
    let cells = Cells::default();
    let bounds = |answers, repeats| Bounds {
        answers,
        repeats,
        ..NOTHING
    };
    let cases: [(Tamper, Bounds, &str); 1] = [(applied, bounds(1, 1), "is written twice")];
    for (tamper, bounds, says) in cases {
        let mut search = Search::new(cells.of(1), Some(tamper));
        let found = search.run(bounds, LIMIT);
        let (events, why) = found.violation.unwrap_or_default();
        println!("{why}: {events:?}");
        assert!(why.contains(says), "{says}: {why:?}, {events:?}");
    }
}
