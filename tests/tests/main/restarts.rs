//! A process that ends while a part is made is started again: the part is stopped and said to be, the next one is made,
//! and the recording of it all replays.

use cell::{Cell, NODES};
use cell_tests::{BEGIN, PART_LIMIT, executor, factories, instance, messages, recording};
use graph::{
    Executor, Published, Stamp,
    replay::{Verdict, replay},
    topics,
};
use probecell_msgs::{Fault, OperatorRequest, PartReport, StepJournal, from_cdr, to_cdr};

use crate::support::turn_mill;

fn ask(executor: &mut Executor, at: Stamp, part: &str) {
    let request = OperatorRequest {
        subject: part.to_owned(),
        operator_name: "test".to_owned(),
        ..OperatorRequest::default()
    };
    executor.inject(at, topics::RUN_REQUESTS.name, to_cdr(&request));
}

/// Ends the process `name` in the middle of the first measurement, has a part made afterwards, and gives the log.
fn interrupted(cell: &Cell, name: &str) -> Vec<Published> {
    let mut executor = executor(cell);
    ask(&mut executor, BEGIN.after_s(1.0), "first");
    for _ in 0..12 {
        assert!(executor.run_until_published(topics::PROBE_EVENTS.name, BEGIN.after_s(PART_LIMIT)));
    }
    if name != "cycle" {
        let fault = Fault {
            node: name.to_owned(),
            severity: Fault::ERROR,
            code: "process_ended".to_owned(),
            text: format!("{name} ended; it is started again"),
            ..Fault::default()
        };
        executor.inject(executor.now(), topics::LAUNCHER_FAULTS.name, to_cdr(&fault));
        executor.run_until(executor.now());
    }
    executor.restart(instance(cell, name));
    executor.run_until(executor.now().after_s(120.0));
    let later = executor.now().after_s(1.0);
    ask(&mut executor, later, "second");
    assert!(
        executor.run_until_published(
            topics::PART_REPORTS.name,
            executor.now().after_s(PART_LIMIT)
        ),
        "{name}: the second part never ended"
    );
    executor.run_until(executor.now().after_s(1.0));
    executor.take_log()
}

#[test]
fn the_part_under_way_is_stopped_and_the_next_one_is_made() {
    let cell = turn_mill();
    for name in cell.node_names() {
        let log = interrupted(&cell, name);
        let mut parts: Vec<PartReport> = messages(&log, topics::PART_REPORTS.name);
        let second = parts.pop().expect("a report");
        assert_eq!(
            (second.part_id.as_str(), second.verdict),
            ("second", PartReport::QUALIFIED),
            "{name}: {}",
            second.text
        );
        let stopped: Vec<_> = parts
            .iter()
            .map(|part| (part.part_id.as_str(), part.verdict))
            .collect();
        assert_eq!(stopped, [("first", PartReport::STOPPED)], "{name}");
        assert!(parts[0].text.contains(name), "{}", parts[0].text);
        let report = replay(&recording(&log), &factories(&cell, &cell.node_names()))
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(
            report.verdict,
            Verdict::Equal,
            "{name}: {:?} {:?}",
            report.first_difference,
            report.nodes
        );
    }
}

#[test]
fn a_recording_begun_in_mid_session_is_partial_and_does_not_differ() {
    let cell = turn_mill();
    let mut executor = executor(&cell);
    ask(&mut executor, BEGIN.after_s(1.0), "first");
    executor.run_until(BEGIN.after_s(20.0));
    executor.take_log();
    executor.run_until_published(topics::PART_REPORTS.name, BEGIN.after_s(PART_LIMIT));
    let report = replay(&recording(&executor.take_log()), &factories(&cell, NODES))
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(report.verdict, Verdict::Incomplete);
    for node in &report.nodes {
        assert_eq!(node.steps, 0, "{node:?}");
        let reason = node.waits_for.as_deref().unwrap_or_default();
        assert!(reason.contains("from step 0 on"), "{node:?}");
    }
}

#[test]
fn the_last_steps_of_a_killed_process_are_missing_and_nothing_else_is() {
    let cell = turn_mill();
    let log = interrupted(&cell, "machine_state");
    // Its first process never got round to publishing its last batch: cut that one short.
    let journal = log
        .iter()
        .position(|one| one.topic == "machine_state/steps")
        .expect("a journal");
    let mut cut = log.clone();
    let mut batch: StepJournal = from_cdr(&cut[journal].payload).expect("a journal");
    let left = batch.now.len() - 40;
    batch.now.truncate(left);
    batch.port.truncate(left);
    batch.sequence.truncate(left);
    cut[journal].payload = to_cdr(&batch);
    let report = replay(&recording(&cut), &factories(&cell, &cell.node_names()))
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        report.verdict,
        Verdict::Incomplete,
        "{:?}",
        report.first_difference
    );
    for node in &report.nodes {
        assert_eq!(node.steps_left, 0, "{node:?}");
    }
    for topic in &report.topics {
        assert_eq!(topic.different + topic.not_recorded, 0, "{topic:?}");
        assert!(
            topic.not_recomputed == 0 || topic.node == "machine_state",
            "{topic:?}"
        );
    }
    let missing = report.topics.iter().map(|topic| topic.not_recomputed);
    assert!((1..200).contains(&missing.sum::<u64>()));
}

/// A launcher that is killed within a tenth of a second of the first messages of a restarted process: the journal of that
/// process is never published, and its messages bear the numbers of its predecessor's.
#[test]
fn a_process_killed_before_its_first_journal_makes_the_replay_incomplete_and_not_different() {
    let cell = turn_mill();
    let mut incomplete = 0;
    for name in ["machine_state", "analysis", "cycle"] {
        let log = interrupted(&cell, name);
        let journal_of = format!("{name}/steps");
        let journals = || {
            let of_node = log.iter().filter(|one| one.topic == journal_of);
            of_node.map(|one| from_cdr::<StepJournal>(&one.payload).expect("a journal"))
        };
        let began = journals().find(|batch| batch.incarnation == 1);
        let began = Stamp(began.expect("a second process").now[0]);
        for later in [0.01, 0.05, 0.5] {
            let end = began.after_s(later);
            let cut = log.iter().filter_map(|one| {
                let Some(_) = one.topic.strip_suffix("/steps") else {
                    return (one.at <= end).then(|| one.clone());
                };
                let mut batch: StepJournal = from_cdr(&one.payload).expect("a journal");
                let left = batch.now.partition_point(|&now| now <= end.0);
                if left == 0 || (one.topic == journal_of && batch.incarnation == 1) {
                    return None;
                }
                batch.now.truncate(left);
                batch.port.truncate(left);
                batch.sequence.truncate(left);
                let payload = to_cdr(&batch);
                Some(Published {
                    payload,
                    ..one.clone()
                })
            });
            let cut: Vec<Published> = cut.collect();
            let report = replay(&recording(&cut), &factories(&cell, &cell.node_names()))
                .unwrap_or_else(|error| panic!("{error}"));
            let made = |topic: &String| {
                let mut topics = report.topics.iter();
                topics.any(|one| one.node == name && one.topic == *topic)
            };
            let published = cut.iter().any(|one| one.at >= began && made(&one.topic));
            incomplete += usize::from(published);
            assert_eq!(
                report.verdict,
                if published {
                    Verdict::Incomplete
                } else {
                    Verdict::Equal
                },
                "{name}, {later} s: {:?}",
                report.first_difference
            );
            for topic in &report.topics {
                assert_eq!(topic.different, 0, "{name}, {later} s: {topic:?}");
                assert!(
                    topic.not_recomputed == 0 || topic.node == name,
                    "{name}, {later} s: {topic:?}"
                );
            }
        }
    }
    assert!(
        incomplete >= 5,
        "{incomplete} cuts hold messages of the process"
    );
}
