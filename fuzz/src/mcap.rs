//! Any bytes as an MCAP file: opened, described, read as a session, recovered.
//!
//! Messages come in order of time whatever the file says, and what is recovered is whole.

use std::{collections::BTreeMap, io::Cursor, path::Path};

use bags::{Bag, Channel, Measurement, Overflow, Qos, Recorder, RecorderOptions, Session, recover};
use probecell_msgs::{
    InspectionPlan, Message, ProbeEvent, sensor_msgs::JointState, std_msgs, to_cdr,
};
use tempfile::TempDir;

use crate::{cdr, urdf};

/// Reads the bytes in each way that there is.
pub fn target(data: &[u8]) {
    let folder = folder();
    let file = folder.path().join("bag.mcap");
    std::fs::write(&file, data).expect("a file in it");
    let Ok(bag) = Bag::open(&file) else { return };
    read(&bag);
    let attached = bag.attachments().flatten().count();
    let to = folder.path().join("saved");
    let recovery = recover(&file, &to, None).expect("what can be opened can be recovered");
    assert_eq!(recovery.attachments, attached as u64);
    let saved = Bag::open(&to).expect("what was recovered can be opened");
    assert_eq!(saved.verify(), [], "what was recovered is whole");
    assert_eq!(saved.counts().iter().sum::<u64>(), recovery.messages);
}

/// Reads a recording in each way that there is.
pub(crate) fn read(bag: &Bag) {
    let mut last = 0;
    for message in bag.messages().flatten() {
        assert!(
            message.log_time >= last,
            "message at {} after {last}",
            message.log_time
        );
        last = message.log_time;
    }
    let info = bag.info(true);
    assert_eq!(info.messages, bag.counts().iter().sum::<u64>());
    for measurement in [Measurement::Only, Measurement::Last] {
        // Most inputs are no session; what is one holds only what was checked.
        if let Ok(session) = Session::read_measurement(bag, &measurement) {
            assert!(
                session.events.iter().all(|event| event
                    .message
                    .axis_positions
                    .iter()
                    .all(|q| q.is_finite()))
            );
        }
    }
}

/// A folder in memory where the system has one: what is recovered is synced to its disk.
pub(crate) fn folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    let made = if memory.is_dir() {
        tempfile::tempdir_in(memory)
    } else {
        tempfile::tempdir()
    };
    made.expect("a temporary folder")
}

/// A recording of a session, compressed and not; a file without chunks, and one without checksums.
pub fn seeds() -> Vec<Vec<u8>> {
    vec![
        recorded(true),
        recorded(false),
        written(false),
        written(true),
    ]
}

/// As our recorder writes it.
fn recorded(compress: bool) -> Vec<u8> {
    recording(compress).0
}

/// A recording's only file, `run_0.mcap`, and its `metadata.yaml`.
pub(crate) fn recording(compress: bool) -> (Vec<u8>, Vec<u8>) {
    let folder = folder();
    let to = folder.path().join("run");
    let options = RecorderOptions {
        overflow: Overflow::Block,
        compress,
        ..RecorderOptions::new(&to)
    };
    let recorder = Recorder::start(options).expect("a recorder");
    recorder
        .attach("cell.toml", "application/toml", 1, &b"name = \"c\"\n"[..])
        .expect("attached");
    for (number, (topic, ty, cdr)) in (0..).zip(messages()) {
        let channel = recorder
            .channel(&Channel::of(topic, ty, Qos::default()))
            .expect("a channel");
        recorder
            .push(channel, number, number + 1, number, cdr)
            .expect("recorded");
    }
    recorder.stop().expect("a recording");
    let read = |name| std::fs::read(to.join(name)).expect("a file of the recording");
    (read("run_0.mcap"), read("metadata.yaml"))
}

/// As others may write it.
fn written(chunks: bool) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .compression(None)
        .use_chunks(chunks)
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false)
        .calculate_summary_section_crc(false);
    let mut writer = options
        .create(Cursor::new(Vec::new()))
        .expect("a writer to memory");
    for (number, (topic, ty, cdr)) in (0..).zip(messages()) {
        let schema = writer
            .add_schema(ty.name, "ros2msg", ty.definition.as_bytes())
            .expect("a schema");
        let channel = writer
            .add_channel(schema, topic, "cdr", &BTreeMap::new())
            .expect("a channel");
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: number,
            log_time: u64::from(number) + 1,
            publish_time: u64::from(number),
        };
        writer
            .write_to_known_channel(&header, &cdr)
            .expect("written");
    }
    writer.finish().expect("finished");
    writer.into_inner().into_inner()
}

type Line = (&'static str, &'static probecell_msgs::MessageType, Vec<u8>);

fn messages() -> Vec<Line> {
    let model = std_msgs::String {
        data: String::from_utf8_lossy(&urdf::seeds()[0]).into_owned(),
    };
    let mut messages = vec![
        (
            "/c/robot_description",
            std_msgs::String::TYPE,
            to_cdr(&model),
        ),
        (
            "/c/inspection_plan",
            InspectionPlan::TYPE,
            to_cdr(&cdr::plan()),
        ),
    ];
    for tick in 0..4_u32 {
        messages.push((
            "/c/joint_states",
            JointState::TYPE,
            to_cdr(&cdr::joints(tick)),
        ));
        messages.push((
            "/c/probe_events",
            ProbeEvent::TYPE,
            to_cdr(&cdr::event(tick.into())),
        ));
    }
    messages
}
