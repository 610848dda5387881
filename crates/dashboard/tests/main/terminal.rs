//! The hall as text, on a sample recording.

use std::collections::BTreeSet;
use std::path::Path;

use bags::Bag;
use dashboard::state::{Hall, read_topics};
use dashboard::view::hall_text;
use graph::Stamp;
use probecell_msgs::{
    Correction, MachineState, PartReport, PartStatus, PassDecision, PlanProgress, Verdict, to_cdr,
};

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
        below.contains(&"decide on correction of D2; the probe may be wrong"),
        "{text}"
    );
    assert!(
        (below.iter())
            .any(|line| line.contains("the probe may be wrong (")
                && line.contains("one of 12 causes")),
        "{text}"
    );
    let command =
        "0.0 µm → −12.3 µm: probecell approve punch/finish/1/T2 --operator NAME --cell CELL.toml";
    assert!(below.contains(&command), "{text}");
}

#[test]
fn an_empty_bus_is_said_to_be_empty() {
    let text = hall_text(&Hall::default(), Stamp(0), "");
    assert_eq!(text, "no cell is on the bus\n");
}

/// A hall with one cell, `mill`, told at some instants (s).
struct Told(Hall);

impl Told {
    fn hears<M: probecell_msgs::Message>(&mut self, at: f64, topic: &str, message: &M) {
        let at = Stamp(0).after_s(at);
        self.0
            .apply(&format!("/mill/{topic}"), &to_cdr(message), at);
    }

    fn shows(&self, at: f64) -> String {
        hall_text(&self.0, Stamp(0).after_s(at), "")
    }
}

fn making(run_id: &str, stage: u8) -> PartStatus {
    PartStatus {
        stage,
        run_id: run_id.to_owned(),
        part_id: run_id.to_owned(),
        ..PartStatus::default()
    }
}

/// A cell that was killed while it made a part knows nothing of it when it is started again, and its machine holds it.
#[test]
fn a_part_that_its_cell_did_not_live_to_end_is_not_forgotten() {
    let mut mill = Told(Hall::default());
    mill.hears(0.0, "machine_state", &MachineState::default());
    mill.hears(0.1, "part_status", &making("a", PartStatus::CUTTING));
    let ended = PartReport {
        part_id: "a".to_owned(),
        run_id: "a".to_owned(),
        verdict: PartReport::QUALIFIED,
        ..PartReport::default()
    };
    mill.hears(0.2, "part_reports", &ended);
    mill.hears(0.3, "part_status", &making("b", PartStatus::MEASURING));
    assert!(mill.shows(0.4).contains("b, pass 1"), "{}", mill.shows(0.4));
    assert!(mill.shows(5.0).contains("silent while making b"));
    mill.0.set_present(&BTreeSet::new(), Stamp(0).after_s(6.0));
    assert!(mill.shows(6.0).contains("left the bus while making b"));
    // It was only the dashboard that did not hear.
    let mut heard = Told(mill.0.clone());
    heard.hears(10.0, "part_status", &making("b", PartStatus::MEASURING));
    assert!(heard.shows(10.0).contains("b, pass 1"));
    assert!(!heard.shows(10.0).contains("interrupted"));
    // It was started anew.
    mill.hears(10.0, "part_status", &PartStatus::default());
    let shown = mill.shows(10.0);
    assert!(
        shown.contains("■ mill") && shown.contains("b, interrupted"),
        "{shown}"
    );
    assert!(
        shown.contains("b was interrupted: the cell ended"),
        "{shown}"
    );
    mill.hears(11.0, "part_status", &making("c", PartStatus::CUTTING));
    assert!(!mill.shows(11.0).contains("interrupted"));
}

/// The verdict that ended the part, not that which came last; a decision on the part before is none on this one.
#[test]
fn the_worst_verdict_is_shown_and_the_decision_on_the_part_that_is_shown() {
    let mut mill = Told(Hall::default());
    mill.hears(0.0, "machine_state", &MachineState::default());
    let verdict = |feature: &str, verdict: u8, error: f64| Verdict {
        plan_id: "a/finish/1".to_owned(),
        feature_id: feature.to_owned(),
        verdict,
        error,
        ..Verdict::default()
    };
    let scrap = Verdict::OVERCUT_NOT_COMPENSABLE;
    for one in [
        verdict("D1", scrap, -410e-6),
        verdict("D2", scrap, -415e-6),
        verdict("L3", Verdict::COMPENSABLE, 27e-6),
    ] {
        mill.hears(0.1, "verdicts", &one);
    }
    assert!(
        mill.shows(0.2).contains("D2 overcut"),
        "{}",
        mill.shows(0.2)
    );
    let decided = PassDecision {
        plan_id: "a/finish/1".to_owned(),
        text: "all sizes".to_owned(),
        ..PassDecision::default()
    };
    mill.hears(0.3, "pass_decisions", &decided);
    let decision = |mill: &Told| {
        mill.0
            .cell("mill")
            .and_then(|cell| cell.decision())
            .cloned()
    };
    mill.hears(0.4, "part_status", &making("a", PartStatus::CUTTING));
    assert_eq!(decision(&mill), Some(decided));
    mill.hears(0.5, "part_status", &making("b", PartStatus::CUTTING));
    assert_eq!(decision(&mill), None);
}

/// What a link drops is fetched late: progress of a plan that is made is none any more.
#[test]
fn late_progress_does_not_bring_planning_back() {
    let mut mill = Told(Hall::default());
    mill.hears(0.0, "machine_state", &MachineState::default());
    let progress = |at: f64, phase: u8| PlanProgress {
        header: Stamp(0).after_s(at).header(""),
        plan_id: "a/finish/1".to_owned(),
        phase,
        ..PlanProgress::default()
    };
    mill.hears(
        0.1,
        "plan_progress",
        &progress(0.1, PlanProgress::SEARCHING),
    );
    let planning = |mill: &Told| {
        mill.0
            .cell("mill")
            .is_some_and(|cell| cell.planning().is_some())
    };
    assert!(planning(&mill));
    mill.hears(0.3, "plan_progress", &progress(0.3, PlanProgress::DONE));
    mill.hears(
        0.4,
        "plan_progress",
        &progress(0.2, PlanProgress::SEARCHING),
    );
    assert!(!planning(&mill));
}
