//! Files that the specification of MCAP allows and few writers make, built here byte by byte: longer records, opcodes of later
//! versions, channels without schemas in the summary.

use std::path::Path;

use bags::{Bag, DamageKind, recover};
use mcap::MAGIC;
use mcap::records::op;

/// What a later version of the format might add to the end of a record.
pub(crate) const ADDED: [u8; 3] = [0x01, 0xff, 0xff];

#[derive(Default)]
pub(crate) struct Body(pub(crate) Vec<u8>);

impl Body {
    pub(crate) fn u16(mut self, value: u16) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    pub(crate) fn u32(mut self, value: u32) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    pub(crate) fn u64(mut self, value: u64) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    pub(crate) fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    pub(crate) fn block(self, bytes: &[u8]) -> Self {
        self.u32(bytes.len() as u32).bytes(bytes)
    }

    pub(crate) fn text(self, text: &str) -> Self {
        self.block(text.as_bytes())
    }

    pub(crate) fn table(self, table: &[(&str, &str)]) -> Self {
        let rows = table.iter().fold(Body::default(), |rows, (key, value)| {
            rows.text(key).text(value)
        });
        self.block(&rows.0)
    }

    /// The record, with `added` behind its fields.
    pub(crate) fn record(self, opcode: u8, added: &[u8]) -> Vec<u8> {
        let mut record = vec![opcode];
        record.extend(((self.0.len() + added.len()) as u64).to_le_bytes());
        record.extend(self.0);
        record.extend(added);
        record
    }
}

pub(crate) fn crc(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

fn header(added: &[u8]) -> Vec<u8> {
    Body::default().text("").text("").record(op::HEADER, added)
}

fn schema(added: &[u8]) -> Vec<u8> {
    let body = Body::default().u16(1).text("std_msgs/msg/Bool");
    body.text("ros2msg")
        .text("bool data\n")
        .record(op::SCHEMA, added)
}

fn channel(added: &[u8]) -> Vec<u8> {
    let body = Body::default().u16(1).u16(1).text("/a").text("cdr");
    body.table(&[]).record(op::CHANNEL, added)
}

fn message(number: u32) -> Vec<u8> {
    let body = Body::default().u16(1).u32(number).u64(u64::from(number));
    let body = body.u64(u64::from(number)).bytes(&[0, 1, 0, 0, 1]);
    body.record(op::MESSAGE, &[])
}

fn messages(numbers: std::ops::Range<u32>) -> Vec<u8> {
    numbers.flat_map(message).collect()
}

pub(crate) fn chunk(records: &[u8], times: (u32, u32), added: &[u8]) -> Vec<u8> {
    Body::default()
        .u64(times.0.into())
        .u64(times.1.into())
        .u64(records.len() as u64)
        .u32(crc(records))
        .text("")
        .u64(records.len() as u64)
        .bytes(records)
        .record(op::CHUNK, added)
}

fn message_index(added: &[u8]) -> Vec<u8> {
    let entries = Body::default().u64(0).u64(0).0;
    Body::default()
        .u16(1)
        .block(&entries)
        .record(op::MESSAGE_INDEX, added)
}

fn attachment(added: &[u8]) -> Vec<u8> {
    let body = Body::default()
        .u64(5)
        .u64(5)
        .text("notes.txt")
        .text("text/plain");
    let body = body.u64(12).bytes(b"twelve bytes");
    let checksum = crc(&body.0);
    body.u32(checksum).record(op::ATTACHMENT, added)
}

/// A file of these records, with a summary section that follows from where it begins.
fn file(data: &[Vec<u8>], summary: impl FnOnce(u64) -> Vec<u8>) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(data.concat());
    let checksum = crc(&bytes);
    bytes.extend(Body::default().u32(checksum).record(op::DATA_END, &[]));
    let start = bytes.len() as u64;
    let summary = summary(start);
    let start = if summary.is_empty() { 0 } else { start };
    let mut section = summary;
    let footer = Body::default().u64(start).u64(0);
    section.push(op::FOOTER);
    section.extend(20u64.to_le_bytes());
    section.extend(&footer.0);
    let checksum = crc(&section);
    bytes.extend(section);
    bytes.extend(checksum.to_le_bytes());
    bytes.extend(MAGIC);
    bytes
}

fn no_summary(_: u64) -> Vec<u8> {
    Vec::new()
}

pub(crate) struct Found {
    pub(crate) messages: usize,
    pub(crate) attachments: usize,
    pub(crate) metadata: usize,
    pub(crate) damage: Vec<bags::Damage>,
}

pub(crate) fn read(bytes: &[u8], folder: &Path) -> Found {
    let path = folder.join("file.mcap");
    std::fs::write(&path, bytes).unwrap();
    let bag = Bag::open(&path).unwrap();
    Found {
        messages: bag.messages().flatten().count(),
        attachments: bag.attachments().flatten().count(),
        metadata: bag.metadata().count(),
        damage: bag.verify(),
    }
}

/// Reads and recovers a file that is whole.
#[track_caller]
pub(crate) fn is_whole(bytes: &[u8], messages: usize, attachments: usize, what: &str) {
    let folder = tempfile::tempdir().unwrap();
    let found = read(bytes, folder.path());
    assert_eq!(found.damage, [], "{what}");
    assert_eq!(found.messages, messages, "{what}");
    assert_eq!(found.attachments, attachments, "{what}");
    let recovered = recover(
        folder.path().join("file.mcap"),
        folder.path().join("recovered"),
        None,
    )
    .unwrap();
    assert_eq!(recovered.damage, [], "{what}");
    assert_eq!(recovered.messages, messages as u64, "{what}");
    assert_eq!(recovered.attachments, attachments as u64, "{what}");
    assert!(!recovered.lost_messages(), "{what}");
}

#[test]
fn records_may_be_longer_than_they_were() {
    let inside = [schema(&ADDED), channel(&ADDED), messages(0..20)].concat();
    let chunks = [
        header(&ADDED),
        chunk(&inside, (0, 19), &ADDED),
        message_index(&ADDED),
        chunk(&messages(20..40), (20, 39), &[0; 13]),
        message_index(&[0; 8]),
        attachment(&ADDED),
    ];
    is_whole(&file(&chunks, no_summary), 40, 1, "chunks");
    let loose = [
        header(&ADDED),
        schema(&ADDED),
        channel(&ADDED),
        messages(0..40),
    ];
    is_whole(&file(&loose, no_summary), 40, 0, "no chunks");
}

#[test]
fn records_of_unknown_opcodes_are_passed_over() {
    for opcode in [0x10, 0x7f, 0x80, 0xff] {
        let unknown = Body::default().bytes(&[7; 40]).record(opcode, &[]);
        let records = [
            header(&[]),
            schema(&[]),
            channel(&[]),
            messages(0..10),
            unknown.clone(),
            messages(10..30),
            unknown,
        ];
        is_whole(&file(&records, no_summary), 30, 0, &format!("{opcode:#x}"));
    }
}

#[test]
fn a_summary_may_repeat_channels_without_their_schemas() {
    let records = [header(&[]), schema(&[]), channel(&[]), messages(0..10)];
    let counts = Body::default().u16(1).u64(10).0;
    let statistics = Body::default().u64(10).u16(1).u32(1).u32(0).u32(0).u32(0);
    let statistics = statistics.u64(0).u64(9).block(&counts);
    let summary = [channel(&[]), statistics.record(op::STATISTICS, &[])].concat();
    is_whole(&file(&records, |_| summary), 10, 0, "no schema");
}

#[test]
fn a_record_whose_length_is_wrong_is_not_taken_for_a_longer_one() {
    let inside = [schema(&[]), channel(&[]), messages(0..20)].concat();
    let records = [
        header(&[]),
        chunk(&inside, (0, 19), &[]),
        chunk(&messages(20..40), (20, 39), &[]),
    ];
    let mut bytes = file(&records, no_summary);
    let first = MAGIC.len() + records[0].len();
    let second = first + records[1].len();
    // The first chunk would reach into the second.
    bytes[first + 1] ^= 0x40;
    let folder = tempfile::tempdir().unwrap();
    let found = read(&bytes, folder.path());
    assert!(
        found
            .damage
            .iter()
            .any(|damage| damage.kind == DamageKind::Garbage
                && damage.offset + damage.length == second as u64),
        "{:?}",
        found.damage
    );
}

#[test]
fn verifying_finds_what_only_the_checksum_of_the_data_section_shows() {
    let records = [header(&[]), schema(&[]), channel(&[]), messages(0..30)];
    let whole = file(&records, no_summary);
    let data = MAGIC.len() + records.concat().len();
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = whole;
    bytes[data - 1] ^= 1;
    let found = read(&bytes, folder.path());
    assert_eq!(found.messages, 30);
    assert!(
        matches!(&found.damage[..], [damage] if matches!(damage.kind, DamageKind::DataSection(_))
            && damage.length == data as u64),
        "{:?}",
        found.damage
    );
    let recovered = recover(
        folder.path().join("file.mcap"),
        folder.path().join("recovered"),
        None,
    )
    .unwrap();
    assert_eq!(recovered.messages, 30);
    assert!(recovered.lost_messages());
}

#[test]
fn verifying_counts_the_messages() {
    let inside = [schema(&[]), channel(&[]), messages(0..20)].concat();
    let records = [header(&[]), chunk(&inside, (0, 19), &[])];
    let counts = Body::default().u16(1).u64(21).0;
    let statistics = Body::default().u64(21).u16(1).u32(1).u32(0).u32(0).u32(1);
    let statistics = statistics.u64(0).u64(19).block(&counts);
    let place = (MAGIC.len() + records[0].len()) as u64;
    let length = records[1].len() as u64;
    let index = Body::default()
        .u64(0)
        .u64(19)
        .u64(place)
        .u64(length)
        .u32(0)
        .u64(0);
    let index = index
        .text("")
        .u64(inside.len() as u64)
        .u64(inside.len() as u64);
    let summary = [
        schema(&[]),
        channel(&[]),
        statistics.record(op::STATISTICS, &[]),
        index.record(op::CHUNK_INDEX, &[]),
    ];
    let folder = tempfile::tempdir().unwrap();
    let found = read(&file(&records, |_| summary.concat()), folder.path());
    let said = found.damage.first().map(ToString::to_string);
    assert!(
        said.as_ref()
            .is_some_and(|said| said.contains("21 messages of /a, and 20 are there")),
        "{said:?}"
    );
}
