//! What a recording lacks is named by topic and number.

use std::path::Path;

use bags::{Bag, Channel, LossEvidence, Overflow, Qos, Recorder, RecorderOptions, recover};

/// Records messages of topics by (topic, number, publish time) in that order.
fn record(folder: &Path, messages: &[(&str, u64, u64)]) {
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder)
    })
    .unwrap();
    for (at, (topic, number, published)) in messages.iter().enumerate() {
        let channel = Channel::new(
            *topic,
            "std_msgs/msg/String",
            "string data\n",
            "",
            Qos::default(),
        );
        let channel = recorder.channel(&channel).unwrap();
        recorder
            .push(channel, *number, 1_000 + at as u64, *published, vec![0; 8])
            .unwrap();
    }
    recorder.stop().unwrap();
}

fn said(bag: &Path, later: Option<&Path>) -> Vec<String> {
    let later = later.map(|path| Bag::open(path).unwrap());
    let gaps = Bag::open(bag).unwrap().gaps(later.as_ref());
    gaps.iter().map(ToString::to_string).collect()
}

#[test]
fn numbers_between_others_are_missing_and_restarts_and_late_ones_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run");
    record(
        &bag,
        &[
            ("/a", 0, 10),
            ("/a", 1, 20),
            ("/a", 4, 50),
            ("/a", 3, 40),
            ("/a", 6, 70),
            // Restarted: it counts again, and loses one.
            ("/a", 0, 80),
            ("/a", 2, 100),
            // Nobody numbers these.
            ("/b", 0, 10),
            ("/b", 0, 20),
            ("/b", 0, 30),
            // A latched one again, as at the start of a file.
            ("/c", 7, 10),
            ("/c", 8, 20),
            ("/c", 7, 10),
            ("/c", 9, 30),
        ],
    );
    assert_eq!(
        said(&bag, None),
        [
            "/a: message 2 is missing: later numbers are there",
            "/a: message 5 is missing: later numbers are there",
            "/a: message 1 is missing: later numbers are there",
        ]
    );
}

#[test]
fn what_was_lost_with_a_recorder_is_bounded_by_the_recording_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    record(
        &first,
        &[
            ("/a", 0, 10),
            ("/a", 1, 20),
            ("/latched", 3, 5),
            ("/restarted", 9, 10),
        ],
    );
    record(
        &second,
        &[
            ("/a", 17, 180),
            ("/a", 18, 190),
            ("/latched", 3, 5),
            ("/latched", 4, 200),
            ("/restarted", 0, 150),
            ("/new", 2, 10),
        ],
    );
    assert_eq!(
        said(&first, Some(&second)),
        ["/a: messages 2 to 16 are missing: the later recording begins after them"]
    );
    assert_eq!(said(&first, None), [""; 0]);
}

/// A recorder that is killed: the file is cut, and what was published after its last whole chunk is in no recording but
/// for its number.
#[test]
fn the_loss_of_a_cut_recording_is_numbered_and_goes_into_the_recovered_one() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second, whole] = ["first", "second", "whole"].map(|name| folder.path().join(name));
    let touches: Vec<(&str, u64, u64)> = (0..100)
        .map(|number| ("/touches", number, 10 * number))
        .collect();
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        chunk_bytes: 500,
        compress: false,
        ..RecorderOptions::new(&first)
    })
    .unwrap();
    let channel = Channel::new(
        "/touches",
        "std_msgs/msg/String",
        "string data\n",
        "",
        Qos::default(),
    );
    let channel = recorder.channel(&channel).unwrap();
    for (_, number, published) in &touches[..60] {
        recorder
            .push(channel, *number, *published, *published, vec![0; 40])
            .unwrap();
    }
    recorder.stop().unwrap();
    let file = first.join("first_0.mcap");
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    std::fs::remove_file(first.join("metadata.yaml")).unwrap();
    record(&second, &touches[75..]);

    let there = Bag::open(&first).unwrap().messages().flatten().count() as u32;
    assert!(there > 0 && there < 60);
    let gaps = Bag::open(&first)
        .unwrap()
        .gaps(Some(&Bag::open(&second).unwrap()));
    assert_eq!(gaps.len(), 1);
    let found = (
        gaps[0].topic.as_str(),
        gaps[0].first,
        gaps[0].last,
        gaps[0].evidence,
    );
    assert_eq!(found, ("/touches", there, 74, LossEvidence::LaterRecording));

    let recovery = recover(&first, &whole, Some(&second)).unwrap();
    assert_eq!(recovery.gaps, gaps);
    let recovered = Bag::open(&whole).unwrap();
    let table = recovered
        .metadata()
        .find(|(name, _)| *name == "probecell_gaps")
        .unwrap()
        .1
        .clone();
    assert_eq!(table["/touches"], format!("{there} to 74"));
}
