//! The 416 files of MCAP's conformance suite, rebuilt from their descriptions: none is called damaged, none loses a record, and
//! verifying finds each flipped byte.

use std::collections::BTreeMap;

use mcap::MAGIC;
use mcap::records::op;
use serde_json::Value;

use super::specification::{ADDED, Body, chunk, crc, is_whole, read};

/// A record of the conformance suite, by its fields.
struct Described<'a>(BTreeMap<&'a str, &'a Value>);

impl<'a> Described<'a> {
    fn of(record: &'a Value) -> (&'a str, Self) {
        let fields = record["fields"].as_array().unwrap();
        let fields = fields
            .iter()
            .map(|field| (field[0].as_str().unwrap(), &field[1]));
        (record["type"].as_str().unwrap(), Self(fields.collect()))
    }

    fn text(&self, name: &str) -> &str {
        self.0[name].as_str().unwrap()
    }

    fn number(&self, name: &str) -> u64 {
        self.text(name).parse().unwrap()
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        let bytes = self.0[name].as_array().unwrap();
        let byte = |value: &Value| value.as_str().unwrap().parse().unwrap();
        bytes.iter().map(byte).collect()
    }

    fn table(&self, name: &str) -> Vec<(&str, &str)> {
        let table = self.0[name].as_object().unwrap();
        table
            .iter()
            .map(|(key, value)| (key.as_str(), value.as_str().unwrap()))
            .collect()
    }

    /// Keys as 16 bits, values as 64.
    fn numbers(&self, name: &str) -> Vec<u8> {
        let rows = self
            .table(name)
            .into_iter()
            .fold(Body::default(), |rows, (key, value)| {
                rows.u16(key.parse().unwrap()).u64(value.parse().unwrap())
            });
        rows.0
    }

    /// The record as the suite writes it: DataEnd, Footer, Message and what is inside a chunk are never longer.
    fn record(&self, kind: &str, added: &[u8]) -> Vec<u8> {
        let body = Body::default();
        let n = |name| self.number(name);
        let small = |name| u16::try_from(n(name)).unwrap();
        let medium = |name| u32::try_from(n(name)).unwrap();
        match kind {
            "Header" => body
                .text(self.text("profile"))
                .text(self.text("library"))
                .record(op::HEADER, added),
            "Schema" => body
                .u16(small("id"))
                .text(self.text("name"))
                .text(self.text("encoding"))
                .block(&self.bytes("data"))
                .record(op::SCHEMA, added),
            "Channel" => body
                .u16(small("id"))
                .u16(small("schema_id"))
                .text(self.text("topic"))
                .text(self.text("message_encoding"))
                .table(&self.table("metadata"))
                .record(op::CHANNEL, added),
            "Message" => body
                .u16(small("channel_id"))
                .u32(medium("sequence"))
                .u64(n("log_time"))
                .u64(n("publish_time"))
                .bytes(&self.bytes("data"))
                .record(op::MESSAGE, &[]),
            "Attachment" => {
                let data = self.bytes("data");
                let body = body
                    .u64(n("log_time"))
                    .u64(n("create_time"))
                    .text(self.text("name"))
                    .text(self.text("media_type"))
                    .u64(data.len() as u64)
                    .bytes(&data);
                let checksum = crc(&body.0);
                body.u32(checksum).record(op::ATTACHMENT, added)
            }
            "Metadata" => body
                .text(self.text("name"))
                .table(&self.table("metadata"))
                .record(op::METADATA, added),
            "Statistics" => body
                .u64(n("message_count"))
                .u16(small("schema_count"))
                .u32(medium("channel_count"))
                .u32(medium("attachment_count"))
                .u32(medium("metadata_count"))
                .u32(medium("chunk_count"))
                .u64(n("message_start_time"))
                .u64(n("message_end_time"))
                .block(&self.numbers("channel_message_counts"))
                .record(op::STATISTICS, added),
            "ChunkIndex" => body
                .u64(n("message_start_time"))
                .u64(n("message_end_time"))
                .u64(n("chunk_start_offset"))
                .u64(n("chunk_length"))
                .block(&self.numbers("message_index_offsets"))
                .u64(n("message_index_length"))
                .text(self.text("compression"))
                .u64(n("compressed_size"))
                .u64(n("uncompressed_size"))
                .record(op::CHUNK_INDEX, added),
            "AttachmentIndex" => body
                .u64(n("offset"))
                .u64(n("length"))
                .u64(n("log_time"))
                .u64(n("create_time"))
                .u64(n("data_size"))
                .text(self.text("name"))
                .text(self.text("media_type"))
                .record(op::ATTACHMENT_INDEX, added),
            "MetadataIndex" => body
                .u64(n("offset"))
                .u64(n("length"))
                .text(self.text("name"))
                .record(op::METADATA_INDEX, added),
            "SummaryOffset" => body
                .bytes(&[u8::try_from(n("group_opcode")).unwrap()])
                .u64(n("group_start"))
                .u64(n("group_length"))
                .record(op::SUMMARY_OFFSET, added),
            "DataEnd" => body
                .u32(medium("data_section_crc"))
                .record(op::DATA_END, &[]),
            "Footer" => body
                .u64(n("summary_start"))
                .u64(n("summary_offset_start"))
                .u32(medium("summary_crc"))
                .record(op::FOOTER, &[]),
            other => panic!("the suite has a record {other}"),
        }
    }
}

/// The one chunk of a file of the suite, and its message indexes.
fn described_chunk(records: &[(&str, Described<'_>)], indexed: bool, added: &[u8]) -> Vec<u8> {
    let mut inside = Vec::new();
    let mut entries: BTreeMap<u16, Vec<u8>> = BTreeMap::new();
    let mut times = Vec::new();
    for (kind, fields) in records {
        match *kind {
            "Channel" => drop(entries.entry(fields.number("id") as u16).or_default()),
            "Message" => {
                times.push(fields.number("log_time"));
                let at = Body::default()
                    .u64(fields.number("log_time"))
                    .u64(inside.len() as u64);
                let of_channel = entries
                    .entry(fields.number("channel_id") as u16)
                    .or_default();
                of_channel.extend(at.0);
            }
            _ => {}
        }
        inside.extend(fields.record(kind, &[]));
    }
    let first = times.iter().min().copied().unwrap_or(0);
    let last = times.iter().max().copied().unwrap_or(0);
    let mut bytes = chunk(&inside, (first as u32, last as u32), &[]);
    for (channel, entries) in entries.iter().filter(|_| indexed) {
        let index = Body::default().u16(*channel).block(entries);
        bytes.extend(index.record(op::MESSAGE_INDEX, added));
    }
    bytes
}

/// A file of the suite; its own checksums must come out.
fn rebuilt(description: &Value) -> Vec<u8> {
    let features = description["meta"]["variant"]["features"]
        .as_array()
        .unwrap();
    let has = |name: &str| features.iter().any(|feature| feature == name);
    let added: &[u8] = if has("pad") { &ADDED } else { &[] };
    let records = description["records"].as_array().unwrap();
    let mut records: Vec<_> = records.iter().map(Described::of).collect();
    let mut bytes = MAGIC.to_vec();
    if has("ch") {
        let in_chunk = |kind: &str| ["Schema", "Channel", "Message"].contains(&kind);
        let end = records
            .iter()
            .position(|(kind, _)| *kind == "DataEnd")
            .unwrap();
        let start = records
            .iter()
            .position(|(kind, _)| in_chunk(kind))
            .unwrap_or(end);
        let length = records[start..end]
            .iter()
            .take_while(|(kind, _)| in_chunk(kind))
            .count();
        let inside: Vec<_> = records.drain(start..start + length).collect();
        for (kind, fields) in records.drain(..start) {
            bytes.extend(fields.record(kind, added));
        }
        bytes.extend(described_chunk(&inside, has("mx"), added));
    }
    let mut summary = 0;
    for (kind, fields) in records {
        if kind == "DataEnd" {
            assert_eq!(u64::from(crc(&bytes)), fields.number("data_section_crc"));
        }
        bytes.extend(fields.record(kind, added));
        match kind {
            "DataEnd" => summary = bytes.len(),
            "Footer" => {
                let covered = &bytes[summary..bytes.len() - 4];
                assert_eq!(u64::from(crc(covered)), fields.number("summary_crc"));
            }
            _ => {}
        }
    }
    bytes.extend(MAGIC);
    bytes
}

#[test]
fn the_conformance_suite_is_read_whole_and_each_flipped_byte_found() {
    let Some(suite) = shared_data::path("data/mcap_conformance") else {
        return;
    };
    let mut number = 0;
    let folders = std::fs::read_dir(suite)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    for folder in folders.filter(|folder| folder.is_dir()) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap();
            let description: Value = serde_json::from_str(&text).unwrap();
            let bytes = rebuilt(&description);
            let records = description["records"].as_array().unwrap();
            let count = |kind: &str| {
                records
                    .iter()
                    .filter(|record| record["type"] == kind)
                    .count()
            };
            let name = path.display().to_string();
            is_whole(&bytes, count("Message"), count("Attachment"), &name);
            let folder = tempfile::tempdir().unwrap();
            assert_eq!(
                read(&bytes, folder.path()).metadata,
                count("Metadata"),
                "{name}"
            );
            // The magic bytes at the start decide whether it is such a file at all.
            let step = shared_data::share(17, 1);
            for at in (MAGIC.len() + number % step..bytes.len()).step_by(step) {
                let mut flipped = bytes.clone();
                flipped[at] ^= 0x55;
                assert!(
                    !read(&flipped, folder.path()).damage.is_empty(),
                    "byte {at} of {name}"
                );
            }
            number += 1;
        }
    }
    assert_eq!(number, 416);
}
