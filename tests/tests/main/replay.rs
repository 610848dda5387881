//! A session on virtual time, made again from its recording, from its snapshots, and from a bag on disk.

use std::{collections::BTreeMap, sync::LazyLock, time::Duration};

use bags::{Bag, Channel, Overflow, Qos, Recorder, RecorderOptions, SplitAt};
use cell::{Cell, NODES};
use cell_tests::{
    BEGIN, ask_for_a_part, cell, executor, factories, instance, make_part, messages, recording,
    trace::Trace,
};
use graph::{
    Published, Stamp, Wiring,
    replay::{Recording, Report, Verdict, replay},
    topics,
};
use probecell_msgs::{ControllerReply, ControllerStatus, ProbeTrigger, to_cdr};

use crate::support::turn_mill;

/// The session that most of these tests replay.
static LOG: LazyLock<Vec<Published>> = LazyLock::new(|| make_part(&turn_mill(), "punch").1);

/// Replays the nodes of that name; what the others said comes from the log.
fn replayed(cell: &Cell, nodes: &[&'static str], recording: &Recording) -> Report {
    replay(recording, &factories(cell, nodes)).unwrap_or_else(|error| panic!("{error}"))
}

/// Everything was compared, and everything is equal.
fn assert_all_equal(report: &Report, log: &[Published]) {
    assert_eq!(
        report.verdict,
        Verdict::Equal,
        "{:?}",
        report.first_difference
    );
    let mut published: BTreeMap<&str, u64> = BTreeMap::new();
    for one in log {
        *published.entry(&one.topic).or_default() += 1;
    }
    for topic in &report.topics {
        let expected = published.get(topic.topic.as_str()).copied().unwrap_or(0);
        assert_eq!(topic.equal, expected, "{}", topic.topic);
    }
    for node in &report.nodes {
        assert!(node.steps > 0 && node.steps_left == 0, "{node:?}");
    }
}

#[test]
fn replaying_a_part_computes_every_message_of_every_node_again() {
    let cell = turn_mill();
    let log = &*LOG;
    let report = replayed(&cell, &cell.node_names(), &recording(log));
    assert_all_equal(&report, log);
    // The topics of a whole part: none of them may be compared over nothing.
    for name in [
        "joint_states",
        "probe_events",
        "measurement_order",
        "feature_results",
        "corrections",
        "part_reports",
    ] {
        let topic = report
            .topics
            .iter()
            .find(|topic| topic.topic == name)
            .expect(name);
        assert!(topic.equal > 0, "{name}");
    }
}

#[test]
fn the_nodes_that_decide_are_replayed_against_a_recorded_machine() {
    let cell = turn_mill();
    let log = &*LOG;
    assert_all_equal(&replayed(&cell, NODES, &recording(log)), log);
}

#[test]
fn two_sessions_of_one_seed_are_equal_byte_for_byte_and_another_seed_is_not() {
    let first = &*LOG;
    let (_, second) = make_part(&turn_mill(), "punch");
    assert!(*first == second);
    let other = cell("turn_mill.toml", |text| {
        text.replace("seed = 1\n", "seed = 2\n")
    });
    let (_, third) = make_part(&other, "punch");
    assert!(*first != third);
}

#[test]
fn a_session_resumed_from_its_snapshots_goes_on_byte_for_byte() {
    let cell = turn_mill();
    let uninterrupted = &*LOG;
    let end = uninterrupted.last().expect("messages").at;
    let span = end.since_s(BEGIN);
    let mut session = executor(&cell);
    ask_for_a_part(&mut session, "punch");
    for cut in 1..40 {
        session.run_until(BEGIN.after_s(span * f64::from(cut) / 40.0));
        for name in cell.node_names() {
            let node = session
                .nodes()
                .iter()
                .find(|node| node.name() == name)
                .expect(name);
            let text = node.snapshot().to_string();
            // Through the start, so that nothing of the interrupted node is left.
            session
                .restore(name, instance(&cell, name).snapshot())
                .expect(name);
            let read = serde_json::from_str(&text).expect(name);
            session.restore(name, read).expect(name);
        }
    }
    session.run_until(end);
    assert!(session.take_log() == *uninterrupted);
}

#[test]
fn every_node_resumes_from_any_of_its_snapshots() {
    let cell = turn_mill();
    let log = &*LOG;
    for trace in Trace::all(&cell, log) {
        let cuts: Vec<usize> = (0..12).map(|cut| cut * trace.len() / 12).collect();
        let mut node = trace.fresh();
        for (&cut, text) in cuts.iter().zip(trace.snapshots(&cuts)) {
            let snapshot = serde_json::from_str(&text).expect("JSON");
            assert_eq!(
                trace.first_difference(node.as_mut(), cut, usize::MAX, snapshot),
                None,
                "{} from step {cut}",
                trace.node
            );
        }
    }
}

/// The first position that is not zero: its bytes stand nowhere else in the message.
fn nonzero(positions: &[f64]) -> f64 {
    *positions
        .iter()
        .find(|position| **position != 0.0)
        .expect("an axis away from its zero")
}

/// The log with one byte of one message changed: the lowest of that number in the message.
fn with_changed_byte(log: &[Published], topic: &str, sequence: u64, number: f64) -> Vec<Published> {
    let mut log = log.to_vec();
    let message = log
        .iter_mut()
        .find(|one| one.topic == topic && one.sequence == sequence)
        .expect("the message");
    let bytes = number.to_le_bytes();
    let place = message
        .payload
        .windows(8)
        .position(|window| window == bytes)
        .expect("the number");
    message.payload[place] ^= 1;
    log
}

#[test]
fn one_changed_byte_of_a_recorded_trigger_is_told_by_topic_and_message() {
    let cell = turn_mill();
    let log = &*LOG;
    let triggers: Vec<ProbeTrigger> = messages(log, topics::PROBE_TRIGGERS.name);
    for sequence in [1, triggers.len() / 2, triggers.len()] {
        let changed = with_changed_byte(
            log,
            topics::PROBE_TRIGGERS.name,
            sequence as u64,
            nonzero(&triggers[sequence - 1].axis_positions),
        );
        let report = replayed(&cell, NODES, &recording(&changed));
        assert_eq!(report.verdict, Verdict::Different);
        let first = report.first_difference.expect("a first difference");
        assert_eq!(
            (first.topic.as_str(), first.sequence),
            ("probe_events", sequence as u64)
        );
        assert_ne!(first.recorded, first.recomputed);
    }
}

#[test]
fn one_changed_byte_of_a_recorded_sample_or_reply_is_told_by_topic_and_message() {
    let cell = turn_mill();
    let log = &*LOG;
    let samples: Vec<ControllerStatus> = messages(log, topics::CONTROLLER_STATUS.name);
    let moving = samples
        .iter()
        .position(|sample| sample.axis_positions[0] < -1e-3)
        .expect("a sample with X out");
    let number = samples[moving].axis_positions[0];
    let changed = with_changed_byte(
        log,
        topics::CONTROLLER_STATUS.name,
        moving as u64 + 1,
        number,
    );
    let first = replayed(&cell, NODES, &recording(&changed))
        .first_difference
        .expect("a first difference");
    assert_eq!(
        (first.topic.as_str(), first.sequence),
        ("joint_states", moving as u64 + 1)
    );

    let replies: Vec<ControllerReply> = messages(log, topics::CONTROLLER_REPLIES.name);
    let written = replies
        .iter()
        .position(|reply| reply.value != 0.0)
        .expect("a wear offset was written");
    let changed = with_changed_byte(
        log,
        topics::CONTROLLER_REPLIES.name,
        written as u64 + 1,
        replies[written].value,
    );
    let first = replayed(&cell, NODES, &recording(&changed))
        .first_difference
        .expect("a first difference");
    assert_eq!(
        (first.topic.as_str(), first.sequence),
        ("correction_acknowledgements", 1)
    );
}

/// The log without one message.
fn without(log: &[Published], topic: &str, sequence: u64) -> Vec<Published> {
    let left: Vec<Published> = log
        .iter()
        .filter(|one| !(one.topic == topic && one.sequence == sequence))
        .cloned()
        .collect();
    assert_eq!(left.len() + 1, log.len());
    left
}

#[test]
fn a_missing_input_makes_the_replay_incomplete_and_is_named() {
    let cell = turn_mill();
    let log = &*LOG;
    for (topic, sequence, node) in [
        ("probe_triggers", 5, "probe_events"),
        ("controller_status", 700, "machine_state"),
        ("controller_replies", 2, "machine_state"),
        ("run_requests", 1, "cycle"),
    ] {
        let report = replayed(&cell, NODES, &recording(&without(log, topic, sequence)));
        assert_eq!(report.verdict, Verdict::Incomplete, "{topic}");
        let stopped = report
            .nodes
            .iter()
            .find(|one| one.node == node)
            .expect(node);
        assert_eq!(
            stopped.waits_for,
            Some(format!("message {sequence} on {topic}"))
        );
        assert!(stopped.steps_left > 0);
    }
}

#[test]
fn a_missing_output_or_journal_makes_the_replay_incomplete() {
    let cell = turn_mill();
    let log = &*LOG;
    let report = replayed(
        &cell,
        NODES,
        &recording(&without(log, "feature_results", 3)),
    );
    assert_eq!(report.verdict, Verdict::Incomplete);
    let topic = report
        .topics
        .iter()
        .find(|topic| topic.topic == "feature_results")
        .expect("the topic");
    assert_eq!((topic.not_recorded, topic.different), (1, 0));

    let report = replayed(&cell, NODES, &recording(&without(log, "analysis/steps", 1)));
    assert_eq!(report.verdict, Verdict::Incomplete);
}

#[test]
fn a_node_that_says_one_thing_more_or_less_than_it_did_is_found() {
    let log = &*LOG;
    // The same session judged with another tolerance.
    let other = self::cell("turn_mill.toml", |text| {
        text.replace("repeat_limit_um = 6.0", "repeat_limit_um = 5.0")
    });
    assert_eq!(
        replayed(&other, NODES, &recording(log)).verdict,
        Verdict::Equal,
        "no point is touched twice"
    );
    let other = self::cell("turn_mill.toml", |text| {
        text.replace(
            "touch_standard_uncertainty_um = 0.6",
            "touch_standard_uncertainty_um = 0.7",
        )
    });
    let report = replayed(&other, NODES, &recording(log));
    let first = report.first_difference.expect("a first difference");
    assert_eq!(
        (report.verdict, first.topic.as_str(), first.sequence),
        (Verdict::Different, "touch_deviations", 1)
    );
}

/// Writes the log as the recorder process does, in files of at most `split_bytes`.
fn written(log: &[Published], folder: &std::path::Path, split_bytes: Option<u64>) -> usize {
    let mut options = RecorderOptions::new(folder);
    options.overflow = Overflow::Block;
    options.chunk_bytes = 1 << 16;
    options.sync_interval = Duration::from_secs(60);
    options.split = SplitAt {
        bytes: split_bytes,
        duration: None,
    };
    let recorder = Recorder::start(options).unwrap_or_else(|error| panic!("{error}"));
    let mut channels = BTreeMap::new();
    for one in log {
        let channel = *channels.entry(one.topic.as_str()).or_insert_with(|| {
            let (message, qos) = topics::by_name(&one.topic)
                .map_or(topics::JOURNAL, |topic| (topic.message, topic.qos));
            let qos = if qos.transient_local {
                Qos::latched()
            } else {
                Qos::default()
            };
            recorder
                .channel(&Channel::of(
                    format!("/turn_mill/{}", one.topic),
                    message,
                    qos,
                ))
                .expect("a channel")
        });
        let time = one.at.0 as u64;
        recorder
            .push(channel, one.sequence, time, time, one.payload.clone())
            .expect("room in the queue");
    }
    let statistics = recorder.stop().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        (statistics.messages, statistics.missing()),
        (log.len() as u64, 0)
    );
    statistics.files.len()
}

/// The recording that a bag holds.
fn read(folder: &std::path::Path) -> Recording {
    let bag = Bag::open(folder).unwrap_or_else(|error| panic!("{error}"));
    let mut recording = Recording::default();
    for message in bag.messages() {
        let message = message.unwrap_or_else(|damage| panic!("{damage}"));
        let topic = message
            .channel
            .topic
            .strip_prefix("/turn_mill/")
            .expect("the namespace");
        let published = Stamp(message.publish_time as i64);
        recording.push(
            topic,
            u64::from(message.sequence),
            published,
            &message.payload,
        );
    }
    assert!(bag.damage().is_empty());
    recording
}

#[test]
fn a_bag_read_back_replays_equal_whole_or_in_splits() {
    let cell = turn_mill();
    let log = &*LOG;
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole");
    assert_eq!(written(log, &whole, None), 1);
    assert_all_equal(&replayed(&cell, &cell.node_names(), &read(&whole)), log);

    let split = folder.path().join("split");
    let files = written(log, &split, Some(1 << 17));
    assert!(files > 3, "{files} files");
    assert_all_equal(&replayed(&cell, &cell.node_names(), &read(&split)), log);
}

#[test]
fn every_topic_of_the_cell_has_one_producer_and_every_input_a_speaker() {
    let cell = turn_mill();
    let nodes = cell.nodes(false).expect("nodes");
    let wiring = Wiring::of(&nodes).unwrap_or_else(|error| panic!("{error}"));
    for topic in topics::ALL {
        if let Some(index) = wiring.producer(topic.name) {
            let expected = if nodes[index].name() == "simulator" {
                "driver"
            } else {
                nodes[index].name()
            };
            let producer = if topic.producer == "instrument" {
                "driver"
            } else {
                topic.producer
            };
            assert_eq!(producer, expected, "{}", topic.name);
        } else {
            assert!(
                ["operator", "gap", "recorder", "signals"].contains(&topic.producer),
                "{} has no producer",
                topic.name
            );
        }
    }
    let external: Vec<&str> = executor(&cell).external_topics().into_iter().collect();
    assert_eq!(
        external,
        [
            "approvals",
            "kept_orders",
            "launcher/faults",
            "operator_keys",
            "order_requests",
            "plan_requests",
            "recording_status",
            "run_requests",
            "signals",
            "stop_requests"
        ]
    );
}

#[test]
fn a_graph_with_two_machines_is_refused() {
    let cell = turn_mill();
    let nodes = vec![instance(&cell, "simulator"), instance(&cell, "simulator")];
    let Err(error) = Wiring::of(&nodes) else {
        panic!("two producers of one topic were accepted")
    };
    assert_eq!(
        error.to_string(),
        "topic controller_status has two producers: simulator and simulator"
    );
}

#[test]
fn a_message_that_cannot_be_read_makes_no_step() {
    let cell = turn_mill();
    let mut session = executor(&cell);
    session.inject(
        BEGIN.after_s(1.0),
        topics::RUN_REQUESTS.name,
        vec![0, 1, 0, 0, 9],
    );
    session.inject(
        BEGIN.after_s(1.0),
        topics::RUN_REQUESTS.name,
        to_cdr(&ProbeTrigger::default())[..3].to_vec(),
    );
    session.run_until(BEGIN.after_s(2.0));
    let log = &session.take_log();
    assert!(log.iter().all(|one| one.topic != topics::RUN_REPLIES.name));
    assert_eq!(
        replayed(&cell, &cell.node_names(), &recording(log)).verdict,
        Verdict::Equal
    );
}
