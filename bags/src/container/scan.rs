//! The slow way into a file: record by record, for files that were cut off, damaged, or written without an index.
//!
//! After bytes that are not a record the scan continues at the next chunk, which is known by its opcode, its compression and
//! two lengths that must agree.

use std::collections::BTreeMap;
use std::io;

use mcap::MAGIC;
use mcap::records::{Record, op};

use super::summary::Unusable;
use super::{
    AttachmentLocation, Block, Contents, DamageKind, Names, RECORD_HEADER, chunk_head, each_record,
    parse, record_length,
};

/// Messages outside of chunks are read in stretches of about this many bytes.
const LOOSE_BLOCK: u64 = 1 << 20;

/// Window in which the next chunk is looked for.
const SEARCH_WINDOW: u64 = 1 << 20;

/// Longest head of a chunk record: header, fields, a compression name of 16 bytes.
const CHUNK_PROBE: u64 = 9 + 32 + 16 + 8;

struct Walk<'a> {
    contents: &'a mut Contents,
    names: Names,
    /// Places of messages outside of chunks, being collected.
    loose: Option<Block>,
    /// Messages by block and channel: length of the block's (or first message's) record, count.
    counted: BTreeMap<(u64, u16), (u64, u64)>,
}

pub(super) fn walk(contents: &mut Contents, reason: Unusable) -> io::Result<()> {
    let no_footer = reason == Unusable::NoFooter;
    if let Unusable::Damaged(why) = reason {
        let end = contents.length;
        contents.damaged(end, 0, DamageKind::NoSummary(why));
    }
    let mut walk = Walk {
        contents,
        names: Names::default(),
        loose: None,
        counted: BTreeMap::new(),
    };
    let ended = walk.records()?;
    walk.close_loose();
    walk.settle_counts();
    if no_footer && ended == Ended::AtLastByte {
        let end = walk.contents.length;
        walk.contents.damaged(end, 0, DamageKind::Truncated);
    } else if no_footer && ended == Ended::Properly {
        let end = walk.contents.length;
        let why = "the file is cut off behind its last message".to_owned();
        walk.contents.damaged(end, 0, DamageKind::NoSummary(why));
    }
    walk.contents.channels = walk.names.channels;
    Ok(())
}

#[derive(PartialEq, Eq)]
enum Ended {
    /// At the data end or footer record.
    Properly,
    /// The file stopped between two records.
    AtLastByte,
    /// Damage at the end is noted already.
    Noted,
}

impl Walk<'_> {
    fn records(&mut self) -> io::Result<Ended> {
        let mut at = MAGIC.len() as u64;
        let end = self.contents.length;
        if end < at {
            self.contents.damaged(0, end, DamageKind::Truncated);
            return Ok(Ended::Noted);
        }
        while at < end {
            let left = end - at;
            if left < RECORD_HEADER as u64 {
                self.contents.damaged(at, left, DamageKind::Truncated);
                return Ok(Ended::Noted);
            }
            let raw = self.contents.bytes(at, RECORD_HEADER as u64)?;
            let header = raw
                .first_chunk::<RECORD_HEADER>()
                .ok_or(io::ErrorKind::UnexpectedEof)?;
            let (opcode, length) = (header[0], record_length(header));
            let body_left = left - RECORD_HEADER as u64;
            let known = (op::HEADER..=op::DATA_END).contains(&opcode) || opcode >= 0x80;
            if length > body_left || !self.is_record(opcode, at, length)? {
                match self.next_chunk(at + 1)? {
                    Some(next) => {
                        self.contents.damaged(at, next - at, DamageKind::Garbage);
                        at = next;
                        continue;
                    }
                    None if known && length > body_left => {
                        self.contents.damaged(at, left, DamageKind::Truncated);
                        return Ok(Ended::Noted);
                    }
                    None => {
                        self.contents.damaged(at, left, DamageKind::Garbage);
                        return Ok(Ended::Noted);
                    }
                }
            }
            if opcode == op::DATA_END {
                self.contents.take_data_end(at)?;
            }
            if opcode == op::DATA_END || opcode == op::FOOTER {
                return Ok(Ended::Properly);
            }
            self.record(opcode, at, length)?;
            at += RECORD_HEADER as u64 + length;
        }
        Ok(Ended::AtLastByte)
    }

    /// Whether a record of this length stands here.
    ///
    /// Chunks and message indexes hold their length twice; a bit flipped in one of them would make the scan skip what follows.
    /// A later version of the format may add fields behind those that are known, and opcodes below 0x80: then the record
    /// is one if another begins where it ends.
    fn is_record(&self, opcode: u8, at: u64, length: u64) -> io::Result<bool> {
        let body = at + RECORD_HEADER as u64;
        let known = match opcode {
            op::CHUNK => {
                let head = self.contents.bytes(body, length.min(CHUNK_PROBE))?;
                match chunk_head(&head, length) {
                    Some(head) => head.known(),
                    None => return Ok(false),
                }
            }
            op::MESSAGE_INDEX => match self.contents.bytes(body, length.min(6))?[..] {
                [_, _, a, b, c, d] => u64::from(u32::from_le_bytes([a, b, c, d])) + 6,
                _ => return Ok(false),
            },
            0 => return Ok(false),
            op::HEADER..=op::DATA_END | 0x80.. => length,
            _ => 0,
        };
        Ok(known == length || (known < length && self.begins_record(body + length)?))
    }

    /// Whether a record begins here that fits into the file, or the file ends.
    fn begins_record(&self, at: u64) -> io::Result<bool> {
        let left = self.contents.length - at;
        if left == 0 {
            return Ok(true);
        }
        let header = self.contents.bytes(at, left.min(RECORD_HEADER as u64))?;
        let fits = |header: &[u8; RECORD_HEADER]| {
            header[0] != 0 && record_length(header) <= left - RECORD_HEADER as u64
        };
        Ok(header.first_chunk::<RECORD_HEADER>().is_some_and(fits))
    }

    fn record(&mut self, opcode: u8, at: u64, length: u64) -> io::Result<()> {
        let whole = RECORD_HEADER as u64 + length;
        match opcode {
            op::CHUNK => self.chunk(at, whole),
            op::MESSAGE => return self.loose_message(at, length),
            op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA | op::ATTACHMENT => {
                let body = self.contents.bytes(at + RECORD_HEADER as u64, length)?;
                if let Err(why) = self.small_record(opcode, at, &body) {
                    self.contents.damaged(at, whole, DamageKind::Record(why));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn small_record(&mut self, opcode: u8, at: u64, body: &[u8]) -> Result<(), String> {
        self.names.take(opcode, body)?;
        match parse(opcode, body)? {
            Record::Header(header) => self.contents.library = header.library,
            Record::Metadata(metadata) => self.contents.metadata.push(metadata),
            Record::Attachment { header, data, .. } => {
                self.contents.attachments.push(AttachmentLocation {
                    offset: at,
                    length: (RECORD_HEADER + body.len()) as u64,
                    log_time: header.log_time,
                    name: header.name,
                    media_type: header.media_type,
                    size: data.len() as u64,
                });
            }
            _ => {}
        }
        Ok(())
    }

    fn chunk(&mut self, at: u64, whole: u64) {
        self.close_loose();
        let mut block = Block {
            offset: at,
            length: whole,
            bounds: (0, 0),
            channels: None,
            chunk: true,
        };
        let records = match self.contents.load(&block) {
            Ok(records) => records,
            Err(damage) => {
                self.contents.damage.push(damage);
                return;
            }
        };
        let mut bounds: Option<(u64, u64)> = None;
        let mut counts = BTreeMap::<u16, u64>::new();
        let names = &mut self.names;
        let walked = each_record(
            &records,
            |message| {
                let (start, end) = bounds.unwrap_or((message.log_time, message.log_time));
                bounds = Some((start.min(message.log_time), end.max(message.log_time)));
                *counts.entry(message.channel).or_default() += 1;
            },
            |opcode, body| names.take(opcode, body),
        );
        if let Err(why) = walked {
            self.contents.damaged(at, whole, DamageKind::Chunk(why));
            return;
        }
        let Some(bounds) = bounds else { return };
        block.bounds = bounds;
        block.channels = Some(counts.keys().copied().collect());
        self.contents.blocks.push(block);
        for (channel, count) in counts {
            self.counted.insert((at, channel), (whole, count));
        }
    }

    fn loose_message(&mut self, at: u64, length: u64) -> io::Result<()> {
        let whole = RECORD_HEADER as u64 + length;
        let head = self
            .contents
            .bytes(at, (RECORD_HEADER as u64 + length.min(22)).min(whole))?;
        let field = |from: usize, to: usize| head.get(RECORD_HEADER + from..RECORD_HEADER + to);
        let (Some(&[c0, c1]), Some(time)) = (field(0, 2), field(6, 14)) else {
            self.contents.damaged(
                at,
                whole,
                DamageKind::Record("it is shorter than a message's head".to_owned()),
            );
            return Ok(());
        };
        if length < 22 {
            self.contents.damaged(
                at,
                whole,
                DamageKind::Record("it is shorter than a message's head".to_owned()),
            );
            return Ok(());
        }
        let time = time.try_into().map_or(0, u64::from_le_bytes);
        match &mut self.loose {
            Some(block) if block.offset + block.length == at && block.length < LOOSE_BLOCK => {
                block.length += whole;
                block.bounds = (block.bounds.0.min(time), block.bounds.1.max(time));
            }
            _ => {
                self.close_loose();
                self.loose = Some(Block {
                    offset: at,
                    length: whole,
                    bounds: (time, time),
                    channels: None,
                    chunk: false,
                });
            }
        }
        let block = self.loose.as_ref().map_or(at, |block| block.offset);
        self.counted
            .entry((block, u16::from_le_bytes([c0, c1])))
            .or_insert((whole, 0))
            .1 += 1;
        Ok(())
    }

    fn close_loose(&mut self) {
        self.contents.blocks.extend(self.loose.take());
    }

    /// Counts messages of known channels, and names the others as damage. A channel record may stand behind its
    /// messages after damage, hence at the end.
    fn settle_counts(&mut self) {
        for ((at, channel), (whole, count)) in std::mem::take(&mut self.counted) {
            if self.names.channels.contains_key(&channel) {
                *self.contents.counts.entry(channel).or_default() += count;
            } else {
                self.contents
                    .damaged(at, whole, DamageKind::UnknownChannel { messages: count });
            }
        }
    }

    /// Offset of the next whole chunk record at or after `from`.
    fn next_chunk(&self, from: u64) -> io::Result<Option<u64>> {
        let end = self.contents.length;
        let mut window_at = from;
        while window_at < end {
            let window = self.contents.bytes(
                window_at,
                (end - window_at).min(SEARCH_WINDOW + CHUNK_PROBE),
            )?;
            let starts = window.len().min(SEARCH_WINDOW as usize);
            for start in 0..starts {
                let at = window_at + start as u64;
                if looks_like_chunk(&window[start..], end - at) {
                    let header = self.contents.bytes(at, RECORD_HEADER as u64)?;
                    let length = header.first_chunk().map_or(0, record_length);
                    if self.is_record(op::CHUNK, at, length)? {
                        return Ok(Some(at));
                    }
                }
            }
            window_at += starts as u64;
        }
        Ok(None)
    }
}

fn looks_like_chunk(bytes: &[u8], left: u64) -> bool {
    let Some((header, body)) = bytes.split_first_chunk::<RECORD_HEADER>() else {
        return false;
    };
    if header[0] != op::CHUNK {
        return false;
    }
    let length = record_length(header);
    length <= left - RECORD_HEADER as u64
        && chunk_head(body, length)
            .is_some_and(|head| matches!(head.compression, b"" | b"zstd" | b"lz4"))
}
