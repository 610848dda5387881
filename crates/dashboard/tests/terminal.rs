//! The hall as text, on a sample recording.

use std::collections::BTreeSet;
use std::path::Path;

use bags::Bag;
use dashboard::state::{Hall, read_topics};
use dashboard::view::hall_text;
use graph::Stamp;
use probecell_msgs::{Correction, MachineState, to_cdr};

fn hall(until_s: f64) -> (Hall, Stamp, String) {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/samples");
    let bag = Bag::open(samples.join("punch.mcap")).expect("a sample");
    let begin = Stamp(bag.bounds().expect("messages").0 as i64);
    let (mut hall, mut last, mut cell) = (Hall::default(), begin, String::new());
    for message in bag.messages() {
        let message = message.expect("a message");
        let at = Stamp(message.log_time as i64);
        let topic = &message.channel.topic;
        let read = (read_topics().iter()).any(|one| topic.ends_with(&format!("/{}", one.name)));
        if read && at.since_s(begin) <= until_s {
            hall.apply(topic, &message.payload, at);
            last = at;
            let namespace = topic[1..].split('/').next();
            namespace.expect("a namespace").clone_into(&mut cell);
        }
    }
    (hall, last, cell)
}

#[test]
fn a_part_that_is_made_and_one_that_was_qualified_are_shown() {
    let (during, now, cell) = hall(20.0);
    let text = hall_text(&during, now, "");
    let row = text.lines().nth(1).expect("a row");
    assert!(
        row.contains(&cell) && row.contains("punch, pass 1"),
        "{text}"
    );

    let (after, now, _) = hall(f64::INFINITY);
    let text = hall_text(&after, now, "No router answers at tcp/x.");
    let row = text.lines().nth(1).expect("a row");
    assert!(row.contains("punch, qualified"), "{text}");
    assert!(text.ends_with("No router answers at tcp/x.\n"), "{text}");
    let header = text.lines().next().expect("a header");
    let column = |line: &str, word: &str| {
        let at = line
            .find(word)
            .unwrap_or_else(|| panic!("{word} in {line}"));
        line[..at].chars().count()
    };
    assert_eq!(column(header, "part"), column(row, "punch"), "{text}");
}

#[test]
fn a_kept_cell_is_never_shown_as_live_and_gives_way_to_a_live_one() {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/samples");
    let bag = Bag::open(samples.join("punch.mcap")).expect("a sample");
    let end = Stamp(bag.bounds().expect("messages").1 as i64);
    let now = end.after_s(600.0);
    let (mut hall, mut name) = (Hall::default(), String::new());
    // A storage that keeps all that it hears, and answers in any order.
    let mut messages: Vec<_> = bag.messages().map(|one| one.expect("a message")).collect();
    messages.reverse();
    for one in &messages {
        let topic = &one.channel.topic;
        hall.apply_kept(topic, &one.payload, Stamp(one.log_time as i64), now);
        let namespace = topic[1..].split('/').next();
        namespace.expect("a namespace").clone_into(&mut name);
    }
    let text = hall_text(&hall, now, "");
    let row = text.lines().nth(1).expect("a row");
    for words in ["not live", "punch, qualified", "10 min ago, kept"] {
        assert!(row.contains(words), "{words}: {text}");
    }
    let just = hall_text(&hall, end, "");
    assert!(just.contains("less than a minute ago, kept"), "{just}");
    let cell = hall.cell(&name).expect("a cell");
    assert!(cell.is_stale(end) && cell.gap.is_some());
    // Of what an operator or a node acts on nothing was taken.
    assert!(cell.corrections().next().is_none() && cell.plan.is_none() && cell.order.is_none());
    assert_eq!(hall.last_event(), 0);

    let state = to_cdr(&MachineState::default());
    hall.apply(&format!("/{name}/machine_state"), &state, now);
    let cell = hall.cell(&name).expect("a cell");
    assert!(!cell.kept && cell.gap.is_none() && cell.ended.is_empty());
    assert_eq!(hall.cells().count(), 1);
    // It leaves, is forgotten, and what was kept shows as long as a storage answers with it.
    let none = BTreeSet::new();
    hall.set_present(&none, now.after_s(3.0));
    hall.set_present(&none, now.after_s(64.0));
    assert!(hall.cell(&name).is_some_and(|cell| cell.kept));
    hall.set_present(&none, now.after_s(101.0));
    assert_eq!(hall.cells().count(), 0);
}

#[test]
fn a_correction_that_waits_is_shown_with_the_command_that_decides_on_it() {
    let (mut hall, now, cell) = hall(f64::INFINITY);
    let correction = Correction {
        header: now.header(""),
        correction_id: "punch/finish/1/T2".to_owned(),
        previous_value: 0.0,
        new_value: -12.34e-6,
        feature_ids: vec!["D2".to_owned()],
        approval: Correction::APPROVAL_NONE,
        expires: now.after_s(60.0).time(),
        ..Correction::default()
    };
    hall.apply(&format!("/{cell}/corrections"), &to_cdr(&correction), now);
    let text = hall_text(&hall, now, "");
    let mut lines = text.lines().skip(1);
    assert!(
        lines.next().is_some_and(|row| row.starts_with('▲')),
        "{text}"
    );
    let below: Vec<&str> = lines.map(str::trim).collect();
    assert!(
        below.contains(&"correction of D2 waits for approval"),
        "{text}"
    );
    let command = "0.0 µm → −12.3 µm: probecell approve punch/finish/1/T2 --operator NAME";
    assert!(below.contains(&command), "{text}");
}

#[test]
fn an_empty_bus_is_said_to_be_empty() {
    let text = hall_text(&Hall::default(), Stamp(0), "");
    assert_eq!(text, "no cell is on the bus\n");
}
