//! What is recorded is read back: whole, in order, split or not.

use std::collections::BTreeMap;
use std::time::Duration;

use bags::{Bag, Channel, DamageKind, Error, Overflow, Qos, Recorder, RecorderOptions, SplitAt};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

fn text_channel(topic: &str, qos: Qos) -> Channel {
    Channel::new(
        topic,
        "std_msgs/msg/String",
        "string data\n",
        format!("RIHS01_{}", "0".repeat(64)),
        qos,
    )
}

fn options(folder: &tempfile::TempDir) -> RecorderOptions {
    RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder.path().join("run"))
    }
}

/// Topic, sequence, log time, publish time, payload.
type Flat = (String, u32, u64, u64, Vec<u8>);

fn read_all(bag: &Bag) -> Vec<Flat> {
    bag.messages()
        .map(|message| message.unwrap())
        .map(|m| {
            (
                m.channel.topic.clone(),
                m.sequence,
                m.log_time,
                m.publish_time,
                m.payload.to_vec(),
            )
        })
        .collect()
}

/// Seeded messages on three topics, log times not in order and with ties.
fn messages(seed: u64, count: usize) -> Vec<Flat> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut sequences = [0u32; 3];
    (0..count)
        .map(|index| {
            let topic = random.random_range(0..3);
            sequences[topic] += 1;
            let log_time = (index as u64 / 4) * 1000 + random.random_range(0..3) * 1000;
            let mut payload = vec![0, 1, 0, 0];
            payload.extend((0..random.random_range(0..300)).map(|_| random.random_range(0..9u8)));
            (
                format!("/cell/t{topic}"),
                sequences[topic],
                log_time,
                log_time.saturating_sub(7),
                payload,
            )
        })
        .collect()
}

fn record(options: RecorderOptions, messages: &[Flat], qos: Qos) -> bags::Statistics {
    let recorder = Recorder::start(options).unwrap();
    for (topic, sequence, log_time, publish_time, payload) in messages {
        let channel = recorder.channel(&text_channel(topic, qos)).unwrap();
        recorder
            .push(
                channel,
                u64::from(*sequence),
                *log_time,
                *publish_time,
                payload.clone(),
            )
            .unwrap();
    }
    recorder.stop().unwrap()
}

#[test]
fn the_same_messages_come_back_whatever_the_chunk_size_and_compression() {
    for seed in 0..8 {
        let written = messages(seed, 3000);
        let mut expected = written.clone();
        expected.sort_by_key(|message| message.2);
        for chunk_bytes in [1, 100, 1 << 10, 10_000, 1 << 20] {
            let folder = tempfile::tempdir().unwrap();
            let options = RecorderOptions {
                chunk_bytes,
                compress: seed % 2 == 0,
                ..options(&folder)
            };
            let statistics = record(options, &written, Qos::default());
            assert_eq!(statistics.messages, 3000);
            let bag = Bag::open(folder.path().join("run")).unwrap();
            assert_eq!(bag.damage(), []);
            assert_eq!(
                read_all(&bag),
                expected,
                "seed {seed}, chunks of {chunk_bytes} bytes"
            );
            assert_eq!(bag.counts().iter().sum::<u64>(), 3000);
            assert_eq!(bag.bounds(), Some((expected[0].2, expected[2999].2)));
        }
    }
}

#[test]
fn a_split_recording_reads_as_one_and_every_split_alone_has_the_latched_messages() {
    let folder = tempfile::tempdir().unwrap();
    let options = RecorderOptions {
        split: SplitAt {
            bytes: None,
            duration: Some(Duration::from_secs(1)),
        },
        ..options(&folder)
    };
    let recorder = Recorder::start(options).unwrap();
    let plan = recorder
        .channel(&text_channel("/cell/plan", Qos::latched()))
        .unwrap();
    let state = recorder
        .channel(&text_channel("/cell/state", Qos::default()))
        .unwrap();
    recorder.push(plan, 1, 10, 5, b"plan 1".to_vec()).unwrap();
    for step in 0..50u64 {
        recorder
            .push(
                state,
                step,
                step * 100_000_000,
                step * 100_000_000,
                step.to_le_bytes().to_vec(),
            )
            .unwrap();
        if step == 25 {
            recorder
                .push(plan, 2, step * 100_000_000 + 1, 5, b"plan 2".to_vec())
                .unwrap();
        }
    }
    let statistics = recorder.stop().unwrap();
    assert_eq!(statistics.messages, 52);
    assert_eq!(statistics.files.len(), 5);
    assert_eq!(statistics.repeats, 4);
    for (number, file) in statistics.files.iter().enumerate() {
        let bag = Bag::open(file).unwrap();
        let first = bag.messages_on(&["/cell/plan"]).next().unwrap().unwrap();
        assert_eq!(
            &first.payload[..],
            if number < 3 { b"plan 1" } else { b"plan 2" },
            "split {number}"
        );
        assert_eq!(
            first.log_time,
            if number == 0 {
                10
            } else {
                number as u64 * 1_000_000_000
            }
        );
        assert_eq!(first.publish_time, 5);
    }
    let bag = Bag::open(folder.path().join("run")).unwrap();
    let plans: Vec<_> = bag
        .messages_on(&["/cell/plan"])
        .map(|plan| plan.unwrap().payload)
        .collect();
    assert_eq!(plans, [&b"plan 1"[..], b"plan 2"]);
    assert_eq!(read_all(&bag).len(), 52);
}

#[test]
fn splits_by_size_keep_every_message() {
    let folder = tempfile::tempdir().unwrap();
    let written = messages(3, 4000);
    let options = RecorderOptions {
        split: SplitAt {
            bytes: Some(50_000),
            duration: None,
        },
        chunk_bytes: 5_000,
        compress: false,
        ..options(&folder)
    };
    let statistics = record(options, &written, Qos::default());
    assert!(
        statistics.files.len() > 5,
        "{} files",
        statistics.files.len()
    );
    for file in &statistics.files {
        let bytes = std::fs::metadata(file).unwrap().len();
        assert!(bytes < 80_000, "{} has {bytes} bytes", file.display());
    }
    let mut expected = written;
    expected.sort_by_key(|message| message.2);
    let mut read = read_all(&Bag::open(folder.path().join("run")).unwrap());
    // Log times jump back by up to two steps in this recording, so ties may stand on both sides of a split; their order
    // is then that of the files, which is the order of writing.
    assert_eq!(read.len(), expected.len());
    read.sort_by_key(|message| message.2);
    assert_eq!(read, expected);
}

#[test]
fn a_reading_goes_on_where_it_stopped() {
    let topics = ["/cell/t0", "/cell/t2"];
    for (seed, qos) in [(5, Qos::default()), (6, Qos::latched())] {
        let folder = tempfile::tempdir().unwrap();
        let options = RecorderOptions {
            split: SplitAt {
                bytes: Some(20_000),
                duration: None,
            },
            chunk_bytes: 1_000,
            ..options(&folder)
        };
        let statistics = record(options, &messages(seed, 2000), qos);
        assert!(statistics.files.len() > 5);
        let bag = Bag::open(folder.path().join("run")).unwrap();
        let all: Vec<_> = bag.messages_on(&topics).map(Result::unwrap).collect();
        for stop in (0..=all.len()).step_by(37) {
            let mut reading = bag.messages_on(&topics);
            assert!(
                reading
                    .by_ref()
                    .take(stop)
                    .map(Result::unwrap)
                    .eq(all[..stop].iter().cloned())
            );
            let rest = bag.messages_after(&topics, reading.position());
            assert!(
                rest.map(Result::unwrap).eq(all[stop..].iter().cloned()),
                "seed {seed}, after {stop}"
            );
        }
    }
}

#[test]
fn attachments_tables_and_losses_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let recorder = Recorder::start(options(&folder)).unwrap();
    let channel = recorder
        .channel(&text_channel("/cell/a", Qos::default()))
        .unwrap();
    recorder
        .attach("cell.toml", "application/toml", 3, &b"name = \"c\""[..])
        .unwrap();
    recorder
        .metadata(
            "probecell",
            BTreeMap::from([("revision".to_owned(), "abc".to_owned())]),
        )
        .unwrap();
    recorder.push(channel, 0, 1, 1, vec![1]).unwrap();
    recorder.report_bus_loss(channel, 7, false);
    recorder.report_bus_loss(channel, 2, true);
    let statistics = recorder.stop().unwrap();
    assert_eq!(statistics.missing(), 7);
    let bag = Bag::open(folder.path().join("run")).unwrap();
    let attachment = bag.attachments().next().unwrap().unwrap();
    assert_eq!(
        (attachment.name.as_str(), &attachment.data[..]),
        ("cell.toml", &b"name = \"c\""[..])
    );
    assert!(
        bag.metadata()
            .any(|(name, table)| name == "probecell" && table["revision"] == "abc")
    );
    assert!(
        bag.metadata().any(|(name, table)| name == "rosbag2"
            && table["serialized_metadata"].starts_with("version: 9"))
    );
    assert_eq!(bag.losses()["/cell/a"].missing(), 7);
    assert_eq!(bag.verify(), []);
}

#[test]
fn a_full_queue_counts_every_message_it_refuses() {
    let folder = tempfile::tempdir().unwrap();
    let options = RecorderOptions {
        queue_bytes: 20_000,
        overflow: Overflow::Count,
        ..options(&folder)
    };
    let recorder = Recorder::start(options).unwrap();
    let channel = recorder
        .channel(&text_channel("/cell/a", Qos::default()))
        .unwrap();
    let mut lost = 0;
    for number in 0..20_000u64 {
        if recorder
            .push(channel, number, number, number, vec![0; 1000])
            .unwrap()
            == bags::Pushed::Lost
        {
            lost += 1;
        }
    }
    let statistics = recorder.stop().unwrap();
    assert_eq!(statistics.messages + lost, 20_000);
    assert_eq!(statistics.missing(), lost);
    assert!(statistics.queue_peak_bytes <= 20_000);
    let bag = Bag::open(folder.path().join("run")).unwrap();
    assert_eq!(
        bag.losses().get("/cell/a").map_or(0, |losses| losses.queue),
        lost
    );
    assert_eq!(read_all(&bag).len() as u64, statistics.messages);
}

#[test]
fn fifty_joint_states_at_a_kilohertz_never_exceed_the_queue() {
    let folder = tempfile::tempdir().unwrap();
    let limit = 1 << 20;
    let recorder = Recorder::start(RecorderOptions {
        queue_bytes: limit,
        ..options(&folder)
    })
    .unwrap();
    let channels: Vec<_> = (0..50)
        .map(|number| {
            recorder
                .channel(&text_channel(
                    &format!("/c{number}/joint_states"),
                    Qos::default(),
                ))
                .unwrap()
        })
        .collect();
    for tick in 0..1000u64 {
        for channel in &channels {
            recorder
                .push(
                    *channel,
                    tick,
                    tick * 1_000_000,
                    tick * 1_000_000,
                    vec![tick as u8; 300],
                )
                .unwrap();
        }
    }
    let statistics = recorder.stop().unwrap();
    assert_eq!(statistics.messages, 50_000);
    assert!(
        statistics.queue_peak_bytes <= limit,
        "{} bytes",
        statistics.queue_peak_bytes
    );
}

#[test]
fn a_message_larger_than_the_queue_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let options = RecorderOptions {
        queue_bytes: 1000,
        overflow: Overflow::Count,
        ..options(&folder)
    };
    let recorder = Recorder::start(options).unwrap();
    let channel = recorder
        .channel(&text_channel("/cell/cloud", Qos::default()))
        .unwrap();
    assert_eq!(
        recorder.push(channel, 0, 0, 0, vec![7; 5 << 20]).unwrap(),
        bags::Pushed::Queued
    );
    recorder.stop().unwrap();
    let bag = Bag::open(folder.path().join("run")).unwrap();
    assert_eq!(
        bag.messages().next().unwrap().unwrap().payload.len(),
        5 << 20
    );
}

#[test]
fn pushers_of_many_threads_lose_nothing_when_the_recorder_stops() {
    let folder = tempfile::tempdir().unwrap();
    let recorder = Recorder::start(RecorderOptions {
        queue_bytes: 100_000,
        ..options(&folder)
    })
    .unwrap();
    std::thread::scope(|scope| {
        for thread in 0..4u64 {
            let pusher = recorder.pusher();
            scope.spawn(move || {
                let channel = pusher
                    .channel(&text_channel(&format!("/t{thread}"), Qos::default()))
                    .unwrap();
                for number in 0..5000 {
                    pusher
                        .push(
                            channel,
                            number,
                            number,
                            number,
                            number.to_le_bytes().to_vec(),
                        )
                        .unwrap();
                }
            });
        }
    });
    let late = recorder.pusher();
    let statistics = recorder.stop().unwrap();
    assert_eq!(statistics.messages, 20_000);
    let channel = late.channel(&text_channel("/t0", Qos::default())).unwrap();
    assert!(matches!(
        late.push(channel, 0, 0, 0, vec![]),
        Err(Error::Stopped { .. })
    ));
    let bag = Bag::open(folder.path().join("run")).unwrap();
    for thread in 0..4 {
        let topic = format!("/t{thread}");
        let sequences: Vec<_> = bag
            .messages_on(&[&topic])
            .map(|message| message.unwrap().sequence)
            .collect();
        assert!(sequences.iter().copied().eq(0..5000), "{topic}");
    }
}

#[test]
fn what_cannot_be_recorded_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("run")).unwrap();
    let Err(error) = Recorder::start(options(&folder)) else {
        panic!("an existing folder was taken")
    };
    assert!(matches!(error, Error::Exists { .. }), "{error}");
    let file = folder.path().join("file");
    std::fs::write(&file, b"x").unwrap();
    let Err(error) = Recorder::start(RecorderOptions::new(file.join("run"))) else {
        panic!("a file is no folder")
    };
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert_eq!(error.to_string().lines().count(), 1);
    let bad = RecorderOptions {
        sync_interval: Duration::ZERO,
        ..RecorderOptions::new(folder.path().join("other"))
    };
    assert!(matches!(
        Recorder::start(bad),
        Err(Error::Option {
            option: "sync_interval",
            ..
        })
    ));
}

#[test]
fn a_missing_split_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let options = RecorderOptions {
        split: SplitAt {
            bytes: Some(2_000),
            duration: None,
        },
        chunk_bytes: 500,
        compress: false,
        ..options(&folder)
    };
    let statistics = record(options, &messages(1, 200), Qos::default());
    std::fs::remove_file(&statistics.files[1]).unwrap();
    let bag = Bag::open(folder.path().join("run")).unwrap();
    let damage = bag.damage();
    assert_eq!(damage.len(), 1);
    assert_eq!(damage[0].kind, DamageKind::MissingFile);
    assert_eq!(damage[0].file, statistics.files[1]);
}

#[test]
fn a_folder_that_vanishes_ends_the_recording_with_one_error_for_everybody() {
    let folder = tempfile::tempdir().unwrap();
    let split = SplitAt {
        bytes: None,
        duration: Some(Duration::from_secs(1)),
    };
    let recorder = Recorder::start(RecorderOptions {
        split,
        queue_bytes: 10_000,
        ..options(&folder)
    })
    .unwrap();
    let channel = recorder
        .channel(&text_channel("/cell/a", Qos::default()))
        .unwrap();
    std::fs::remove_dir_all(folder.path().join("run")).unwrap();
    // The queue blocks, so the writer must take these and fail at the second split at the latest.
    let failed = (0..100_000u64).find_map(|step| {
        recorder
            .push(channel, step, step * 1_000_000_000, 0, vec![0; 100])
            .err()
    });
    let failed = failed
        .expect("messages were taken though the folder is gone")
        .to_string();
    assert_eq!(failed.lines().count(), 1);
    assert_eq!(recorder.failure().unwrap().to_string(), failed);
    assert_eq!(recorder.stop().unwrap_err().to_string(), failed);
}
