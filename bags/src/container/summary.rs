//! The fast way into a file: its summary section, if that is whole, checked and complete.

use std::io;

use mcap::MAGIC;
use mcap::records::{Record, op};

use super::{
    AttachmentLocation, Block, Contents, DATA_END, Names, RECORD_HEADER, parse, record_length,
};

/// Footer record: header, two offsets, CRC.
const FOOTER: usize = RECORD_HEADER + 20;

/// A summary larger than this is not one of ours to hold in memory: 1 GiB.
const SUMMARY_LIMIT: u64 = 1 << 30;

/// Why the summary cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Unusable {
    /// The file does not end with footer and magic.
    NoFooter,
    /// There is a footer, but what it points at is damaged.
    Damaged(String),
    /// Whole, but it does not list everything: written so.
    Incomplete,
}

/// Fills `contents` from the summary. The outer error is the operating system's.
pub(super) fn read(contents: &mut Contents) -> io::Result<Result<(), Unusable>> {
    let tail = (FOOTER + MAGIC.len()) as u64;
    if contents.length < tail + MAGIC.len() as u64 {
        return Ok(Err(Unusable::NoFooter));
    }
    let footer_at = contents.length - tail;
    let raw = contents.bytes(footer_at, tail)?;
    let (footer, magic) = raw.split_at(FOOTER);
    let Some((header, body)) = footer.split_first_chunk::<RECORD_HEADER>() else {
        return Ok(Err(Unusable::NoFooter));
    };
    if magic != MAGIC || header[0] != op::FOOTER || record_length(header) != 20 {
        return Ok(Err(Unusable::NoFooter));
    }
    let Ok(Record::Footer(fields)) = parse(op::FOOTER, body) else {
        return Ok(Err(Unusable::NoFooter));
    };
    // Without a summary section the checksum is that of the footer alone.
    let start = match fields.summary_start {
        0 => footer_at,
        start => start,
    };
    if start < MAGIC.len() as u64 || start > footer_at || footer_at - start > SUMMARY_LIMIT {
        return Ok(Err(Unusable::Damaged(format!(
            "the footer points at byte {start}"
        ))));
    }
    let section = contents.bytes(start, footer_at - start)?;
    if fields.summary_crc != 0 {
        let mut crc = crc32fast::Hasher::new();
        crc.update(&section);
        crc.update(&footer[..FOOTER - 4]);
        let found = crc.finalize();
        if found != fields.summary_crc {
            let why = format!("CRC {found:08x}, expected {:08x}", fields.summary_crc);
            return Ok(Err(Unusable::Damaged(why)));
        }
    }
    if let Some(at) = start.checked_sub(DATA_END) {
        contents.take_data_end(at)?;
    }
    if start == footer_at {
        return Ok(Err(Unusable::Incomplete));
    }
    Ok(take_section(contents, &section, start))
}

fn take_section(contents: &mut Contents, section: &[u8], start: u64) -> Result<(), Unusable> {
    let mut names = Names::default();
    let mut statistics = None;
    let mut metadata_places = Vec::new();
    let mut lacks_schemas = false;
    let take = |opcode: u8, body: &[u8]| -> Result<(), String> {
        if opcode == op::CHANNEL && names.lack_schema_of(body) {
            lacks_schemas = true;
            return Ok(());
        }
        names.take(opcode, body)?;
        if opcode == op::SCHEMA || opcode == op::CHANNEL {
            return Ok(());
        }
        match parse(opcode, body)? {
            Record::ChunkIndex(index) => contents.blocks.push(Block {
                offset: index.chunk_start_offset,
                length: index.chunk_length,
                bounds: (index.message_start_time, index.message_end_time),
                channels: (!index.message_index_offsets.is_empty())
                    .then(|| index.message_index_offsets.keys().copied().collect()),
                chunk: true,
            }),
            Record::AttachmentIndex(index) => contents.attachments.push(AttachmentLocation {
                offset: index.offset,
                length: index.length,
                log_time: index.log_time,
                name: index.name,
                media_type: index.media_type,
                size: index.data_size,
            }),
            Record::MetadataIndex(index) => metadata_places.push((index.offset, index.length)),
            Record::Statistics(found) => statistics = Some(found),
            _ => {}
        }
        Ok(())
    };
    super::each_record(section, |_| {}, take).map_err(Unusable::Damaged)?;
    if lacks_schemas {
        return Err(Unusable::Incomplete);
    }
    contents.channels = names.channels;
    let statistics = statistics.ok_or(Unusable::Incomplete)?;
    let complete = statistics.chunk_count as usize == contents.blocks.len()
        && statistics.attachment_count as usize == contents.attachments.len()
        && statistics.metadata_count as usize == metadata_places.len()
        && statistics.channel_count as usize == contents.channels.len()
        && (statistics.message_count == 0 || !contents.blocks.is_empty());
    if !complete {
        return Err(Unusable::Incomplete);
    }
    if statistics
        .channel_message_counts
        .values()
        .try_fold(0u64, |sum, count| sum.checked_add(*count))
        != Some(statistics.message_count)
    {
        return Err(Unusable::Damaged(
            "its message counts contradict one another".to_owned(),
        ));
    }
    if contents.blocks.iter().any(|block| {
        block
            .offset
            .checked_add(block.length)
            .is_none_or(|end| end > start)
    }) {
        return Err(Unusable::Damaged(
            "a chunk index points beyond the data".to_owned(),
        ));
    }
    // Where chunks have message indexes, one without has no message: schemas and channels alone.
    if contents.blocks.iter().any(|block| block.channels.is_some()) {
        contents.blocks.retain(|block| block.channels.is_some());
    }
    contents.blocks.sort_by_key(|block| block.offset);
    contents.counts = statistics.channel_message_counts;
    for (offset, length) in metadata_places {
        take_metadata(contents, offset, length);
    }
    take_header(contents);
    Ok(())
}

fn take_metadata(contents: &mut Contents, offset: u64, length: u64) {
    let found = contents
        .bytes(offset, length)
        .map_err(|error| error.to_string())
        .and_then(|raw| match raw.split_first_chunk::<RECORD_HEADER>() {
            Some((header, body))
                if header[0] == op::METADATA && record_length(header) == body.len() as u64 =>
            {
                match parse(op::METADATA, body)? {
                    Record::Metadata(metadata) => Ok(metadata),
                    _ => Err("no metadata".to_owned()),
                }
            }
            _ => Err("no metadata record where the index says".to_owned()),
        });
    match found {
        Ok(metadata) => contents.metadata.push(metadata),
        Err(why) => contents.damaged(offset, length, super::DamageKind::Record(why)),
    }
}

/// The header only names the writer; damage there costs nothing.
fn take_header(contents: &mut Contents) {
    let at = MAGIC.len() as u64;
    let Ok(raw) = contents.bytes(at, RECORD_HEADER as u64) else {
        return;
    };
    let Some(header) = raw.first_chunk::<RECORD_HEADER>() else {
        return;
    };
    let length = record_length(header);
    if header[0] == op::HEADER
        && length < 1 << 16
        && let Ok(body) = contents.bytes(at + RECORD_HEADER as u64, length)
        && let Ok(Record::Header(header)) = parse(op::HEADER, &body)
    {
        contents.library = header.library;
    }
}
