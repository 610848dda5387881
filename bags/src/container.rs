//! What one `.mcap` file holds and where: found by its summary if that is whole, otherwise by walking the file.
//!
//! Every chunk is unpacked on its own and checked against its CRC, so damage costs the chunks it hits and nothing else.
//! Lengths in a file are never believed before they are compared with what is there: no length makes this code allocate
//! more than the file can fill, wait, or panic. Offsets are bytes from the start of the file.

pub(crate) mod foreign;
mod scan;
mod summary;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use mcap::records::{Record, op};

use crate::damage::{Damage, DamageKind};
use crate::error::Error;

/// Uncompressed size above which a chunk is taken for damage: 1 GiB.
const CHUNK_LIMIT: u64 = 1 << 30;

/// A stretch of a file that holds messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Block {
    /// Of its first record.
    pub(crate) offset: u64,
    /// Of all its records, their headers included.
    pub(crate) length: u64,
    /// First and last log time.
    pub(crate) bounds: (u64, u64),
    /// Channels in it, if known.
    pub(crate) channels: Option<Vec<u16>>,
    /// A chunk, or messages written without one.
    pub(crate) chunk: bool,
}

/// Location and names of an attachment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AttachmentLocation {
    pub(crate) offset: u64,
    pub(crate) length: u64,
    pub(crate) log_time: u64,
    pub(crate) name: String,
    pub(crate) media_type: String,
    pub(crate) size: u64,
}

/// One file, its messages apart.
#[derive(Debug)]
pub(crate) struct Contents {
    pub(crate) path: PathBuf,
    pub(crate) file: File,
    pub(crate) length: u64,
    pub(crate) library: String,
    pub(crate) channels: BTreeMap<u16, Arc<mcap::Channel<'static>>>,
    pub(crate) blocks: Vec<Block>,
    pub(crate) attachments: Vec<AttachmentLocation>,
    pub(crate) metadata: Vec<mcap::records::Metadata>,
    /// Messages of each channel.
    pub(crate) counts: BTreeMap<u16, u64>,
    pub(crate) data_end: Option<DataEnd>,
    pub(crate) damage: Vec<Damage>,
}

/// The record behind the data section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DataEnd {
    pub(crate) offset: u64,
    /// Of everything before it; 0 if the writer computed none.
    crc: u32,
}

impl Contents {
    pub(crate) fn read(path: &Path) -> Result<Self, Error> {
        let failed = |source| Error::io("read the recording", path, source);
        let file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        let mut contents = Self {
            path: path.to_owned(),
            file,
            length,
            library: String::new(),
            channels: BTreeMap::new(),
            blocks: Vec::new(),
            attachments: Vec::new(),
            metadata: Vec::new(),
            counts: BTreeMap::new(),
            data_end: None,
            damage: Vec::new(),
        };
        let mut magic = [0; mcap::MAGIC.len()];
        let there = magic
            .len()
            .min(usize::try_from(length).unwrap_or(usize::MAX));
        read_at(&contents.file, &mut magic[..there], 0).map_err(failed)?;
        if magic[..there] != mcap::MAGIC[..there] {
            return Err(foreign::error(path));
        }
        match summary::read(&mut contents).map_err(failed)? {
            Ok(()) => {}
            Err(reason) => {
                contents.channels.clear();
                contents.blocks.clear();
                contents.attachments.clear();
                contents.metadata.clear();
                contents.counts.clear();
                contents.data_end = None;
                scan::walk(&mut contents, reason).map_err(failed)?;
            }
        }
        Ok(contents)
    }

    /// First and last log time, ns since 1970; `None` without messages.
    pub(crate) fn bounds(&self) -> Option<(u64, u64)> {
        self.blocks
            .iter()
            .map(|block| block.bounds)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Notes damage of this file.
    fn damaged(&mut self, offset: u64, length: u64, kind: DamageKind) {
        self.damage.push(Damage {
            file: self.path.clone(),
            offset,
            length,
            kind,
        });
    }

    /// The records of a block, unpacked and checked.
    pub(crate) fn load(&self, block: &Block) -> Result<Bytes, Damage> {
        let damaged = |why: String| {
            let kind = if block.chunk {
                DamageKind::Chunk(why)
            } else {
                DamageKind::Record(why)
            };
            Damage {
                file: self.path.clone(),
                offset: block.offset,
                length: block.length,
                kind,
            }
        };
        let raw = self
            .bytes(block.offset, block.length)
            .map_err(|error| damaged(error.to_string()))?;
        if !block.chunk {
            return Ok(raw.into());
        }
        match raw.split_first_chunk::<RECORD_HEADER>() {
            Some((header, body))
                if header[0] == op::CHUNK && record_length(header) == body.len() as u64 =>
            {
                unpack(body).map_err(damaged)
            }
            _ => Err(damaged("no chunk record where the index says".to_owned())),
        }
    }

    /// Reads the whole file against its checksums and its statistics, and returns what opening did not find.
    pub(crate) fn verify(&self) -> Vec<Damage> {
        let mut damage = Vec::new();
        let mut counts = BTreeMap::<u16, u64>::new();
        for block in &self.blocks {
            let count = |message: MessageLocation| *counts.entry(message.channel).or_default() += 1;
            damage.extend(self.walk(block, count).err());
        }
        damage.extend(
            self.attachments
                .iter()
                .filter_map(|location| self.attachment(location).err()),
        );
        // What is lost in a chunk is not counted, and breaks the checksum of the whole as well.
        if damage.is_empty() && self.damage.is_empty() {
            damage.extend(self.contradicted_counts(&counts));
            damage.extend(self.contradicted_checksum());
        }
        damage
    }

    /// Loads a block and walks its messages.
    pub(crate) fn walk(
        &self,
        block: &Block,
        message: impl FnMut(MessageLocation),
    ) -> Result<Bytes, Damage> {
        let records = self.load(block)?;
        each_record(&records, message, |_, _| Ok(())).map_err(|why| Damage {
            file: self.path.clone(),
            offset: block.offset,
            length: block.length,
            kind: DamageKind::Chunk(why),
        })?;
        Ok(records)
    }

    fn contradicted_counts(&self, found: &BTreeMap<u16, u64>) -> Option<Damage> {
        let ids: BTreeSet<&u16> = self.counts.keys().chain(found.keys()).collect();
        let of = |counts: &BTreeMap<u16, u64>, id: &u16| counts.get(id).copied().unwrap_or(0);
        let id = ids
            .into_iter()
            .find(|id| of(&self.counts, id) != of(found, id))?;
        let topic = self
            .channels
            .get(id)
            .map_or_else(|| format!("channel {id}"), |channel| channel.topic.clone());
        let why = format!(
            "the statistics count {} messages of {topic}, and {} are there",
            of(&self.counts, id),
            of(found, id)
        );
        Some(self.data_section(why))
    }

    /// That the data section does not fit its checksum, which shows damage that neither a chunk nor a record shows.
    pub(crate) fn contradicted_checksum(&self) -> Option<Damage> {
        let Some(DataEnd { offset, crc }) = self.data_end else {
            let why = "no DataEnd record stands behind it".to_owned();
            return Some(self.data_section(why));
        };
        if crc == 0 {
            return None;
        }
        let mut hasher = crc32fast::Hasher::new();
        let mut at = 0;
        while at < offset {
            let length = (offset - at).min(1 << 20);
            match self.bytes(at, length) {
                Ok(bytes) => hasher.update(&bytes),
                Err(error) => return Some(self.data_section(error.to_string())),
            }
            at += length;
        }
        let found = hasher.finalize();
        let why = || {
            let place = "no record shows where";
            self.data_section(format!("CRC {found:08x}, expected {crc:08x}; {place}"))
        };
        (found != crc).then(why)
    }

    fn data_section(&self, why: String) -> Damage {
        Damage {
            file: self.path.clone(),
            offset: 0,
            length: self.data_end.map_or(self.length, |end| end.offset),
            kind: DamageKind::DataSection(why),
        }
    }

    /// Takes the record at `offset` for the DataEnd if it is one.
    fn take_data_end(&mut self, offset: u64) -> std::io::Result<()> {
        let raw = self.bytes(offset, DATA_END)?;
        if let Some((header, body)) = raw.split_first_chunk::<RECORD_HEADER>()
            && header[0] == op::DATA_END
            && record_length(header) == body.len() as u64
            && let Ok(Record::DataEnd(end)) = parse(op::DATA_END, body)
        {
            let crc = end.data_section_crc;
            self.data_end = Some(DataEnd { offset, crc });
        }
        Ok(())
    }

    /// The data of an attachment.
    pub(crate) fn attachment(&self, location: &AttachmentLocation) -> Result<Bytes, Damage> {
        let damaged = |why: String| Damage {
            file: self.path.clone(),
            offset: location.offset,
            length: location.length,
            kind: DamageKind::Record(why),
        };
        let raw = self
            .bytes(location.offset, location.length)
            .map_err(|error| damaged(error.to_string()))?;
        match raw.split_first_chunk::<RECORD_HEADER>() {
            Some((header, body))
                if header[0] == op::ATTACHMENT && record_length(header) == body.len() as u64 =>
            {
                match parse(op::ATTACHMENT, body).map_err(damaged)? {
                    Record::Attachment { data, .. } => Ok(data.into_owned().into()),
                    _ => Err(damaged("no attachment".to_owned())),
                }
            }
            _ => Err(damaged(
                "no attachment record where the index says".to_owned(),
            )),
        }
    }

    /// A stretch of the file. The caller has compared it with the file's length.
    fn bytes(&self, offset: u64, length: u64) -> std::io::Result<Vec<u8>> {
        if offset
            .checked_add(length)
            .is_none_or(|end| end > self.length)
        {
            return Err(std::io::Error::new(
                std::io::ErrorKind::UnexpectedEof,
                "it reaches beyond the end of the file",
            ));
        }
        let mut raw = vec![0; usize::try_from(length).map_err(std::io::Error::other)?];
        read_at(&self.file, &mut raw, offset)?;
        Ok(raw)
    }
}

/// Opcode and body length.
pub(crate) const RECORD_HEADER: usize = 9;

/// Length of a DataEnd record, its header included.
const DATA_END: u64 = RECORD_HEADER as u64 + 4;

pub(crate) fn record_length(header: &[u8; RECORD_HEADER]) -> u64 {
    let [_, a, b, c, d, e, f, g, h] = *header;
    u64::from_le_bytes([a, b, c, d, e, f, g, h])
}

#[cfg(unix)]
fn read_at(file: &File, buffer: &mut [u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

#[cfg(not(unix))]
fn read_at(mut file: &File, buffer: &mut [u8], offset: u64) -> std::io::Result<()> {
    use std::io::{Seek, SeekFrom};
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(buffer)
}

/// The fields before a chunk's compressed records.
struct ChunkHead<'a> {
    uncompressed_size: u64,
    crc: u32,
    compression: &'a [u8],
    /// Of the head itself; compressed records follow.
    length: usize,
    /// Of the compressed records.
    compressed: u64,
}

impl ChunkHead<'_> {
    /// Length of the fields that are known; a later version of the format may add others behind them.
    fn known(&self) -> u64 {
        self.length as u64 + self.compressed
    }
}

/// Reads a chunk's head; `None` if the bytes cannot be one. `body_length` is that of the record.
fn chunk_head(head: &[u8], body_length: u64) -> Option<ChunkHead<'_>> {
    let u64_at = |at: usize| {
        head.get(at..at + 8)?
            .try_into()
            .ok()
            .map(u64::from_le_bytes)
    };
    let u32_at = |at: usize| {
        head.get(at..at + 4)?
            .try_into()
            .ok()
            .map(u32::from_le_bytes)
    };
    let name_length = u32_at(28)? as usize;
    if name_length > 16 {
        return None;
    }
    let length = 32 + name_length + 8;
    let compressed = u64_at(32 + name_length)?;
    (compressed.checked_add(length as u64)? <= body_length).then_some(ChunkHead {
        uncompressed_size: u64_at(16)?,
        crc: u32_at(24)?,
        compression: head.get(32..32 + name_length)?,
        length,
        compressed,
    })
}

/// Unpacks the body of a chunk record.
fn unpack(body: &[u8]) -> Result<Bytes, String> {
    let head = chunk_head(body, body.len() as u64).ok_or("its head contradicts its length")?;
    if head.uncompressed_size > CHUNK_LIMIT {
        return Err(format!(
            "it claims {} bytes unpacked, above 1 GiB",
            head.uncompressed_size
        ));
    }
    let packed = usize::try_from(head.known())
        .ok()
        .and_then(|known| body.get(head.length..known))
        .ok_or("its head contradicts its length")?;
    let mut records = Vec::new();
    // One byte more than claimed shows a stream that is too long; memory grows only with what really comes out.
    let limit = head.uncompressed_size + 1;
    let unpacked = match head.compression {
        b"" => {
            records.extend_from_slice(packed);
            Ok(records.len())
        }
        b"zstd" => zstd::Decoder::with_buffer(packed)
            .and_then(|stream| stream.take(limit).read_to_end(&mut records)),
        b"lz4" => lz4_flex::frame::FrameDecoder::new(packed)
            .take(limit)
            .read_to_end(&mut records),
        other => {
            return Err(format!(
                "unknown compression {}",
                String::from_utf8_lossy(other)
            ));
        }
    };
    unpacked.map_err(|error| format!("it cannot be unpacked ({error})"))?;
    if records.len() as u64 != head.uncompressed_size {
        return Err(format!(
            "it unpacks to another size than the {} bytes it claims",
            head.uncompressed_size
        ));
    }
    if head.crc != 0 {
        let found = crc32fast::hash(&records);
        if found != head.crc {
            return Err(format!("CRC {found:08x}, expected {:08x}", head.crc));
        }
    }
    Ok(records.into())
}

/// Parses a record other than a chunk or message, without trusting a length in it.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    if opcode == op::ATTACHMENT && attachment_head(body).is_none() {
        return Err("its head contradicts its length".to_owned());
    }
    mcap::parse_record(opcode, body).map_err(|error| match error {
        mcap::McapError::Parse(_) => "its fields cannot be read".to_owned(),
        other => other.to_string(),
    })
}

/// Length of the fields before an attachment's data, if they and the CRC fit into the body.
fn attachment_head(body: &[u8]) -> Option<usize> {
    let text_end = |at: usize| {
        let length =
            u32::from_le_bytes(body.get(at..at.checked_add(4)?)?.try_into().ok()?) as usize;
        at.checked_add(4)?.checked_add(length)
    };
    let head = text_end(text_end(16)?)?.checked_add(8)?;
    (head.checked_add(4)? <= body.len()).then_some(head)
}

/// A message inside unpacked records.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MessageLocation {
    pub(crate) channel: u16,
    pub(crate) sequence: u32,
    pub(crate) log_time: u64,
    pub(crate) publish_time: u64,
    /// Payload within the records.
    pub(crate) start: usize,
    pub(crate) end: usize,
}

/// Walks unpacked records: messages to `message`, all others to `other`. A record that does not fit ends the walk with
/// its reason.
pub(crate) fn each_record<'a>(
    records: &'a [u8],
    mut message: impl FnMut(MessageLocation),
    mut other: impl FnMut(u8, &'a [u8]) -> Result<(), String>,
) -> Result<(), String> {
    let mut at = 0;
    while at < records.len() {
        let header = records[at..]
            .first_chunk::<RECORD_HEADER>()
            .ok_or("it ends inside a record")?;
        let start = at + RECORD_HEADER;
        let length = usize::try_from(record_length(header)).unwrap_or(usize::MAX);
        let end = start
            .checked_add(length)
            .filter(|end| *end <= records.len())
            .ok_or("it ends inside a record")?;
        let body = &records[start..end];
        if header[0] == op::MESSAGE {
            let (
                &[
                    a,
                    b,
                    s0,
                    s1,
                    s2,
                    s3,
                    l0,
                    l1,
                    l2,
                    l3,
                    l4,
                    l5,
                    l6,
                    l7,
                    p0,
                    p1,
                    p2,
                    p3,
                    p4,
                    p5,
                    p6,
                    p7,
                ],
                _,
            ) = body
                .split_first_chunk::<22>()
                .ok_or("a message is shorter than its head")?;
            message(MessageLocation {
                channel: u16::from_le_bytes([a, b]),
                sequence: u32::from_le_bytes([s0, s1, s2, s3]),
                log_time: u64::from_le_bytes([l0, l1, l2, l3, l4, l5, l6, l7]),
                publish_time: u64::from_le_bytes([p0, p1, p2, p3, p4, p5, p6, p7]),
                start: start + 22,
                end,
            });
        } else {
            other(header[0], body)?;
        }
        at = end;
    }
    Ok(())
}

/// Schemas and channels as they turn up.
#[derive(Default)]
pub(crate) struct Names {
    schemas: BTreeMap<u16, Arc<mcap::Schema<'static>>>,
    pub(crate) channels: BTreeMap<u16, Arc<mcap::Channel<'static>>>,
}

impl Names {
    /// Whether a channel record names a schema that has not turned up: a summary may repeat channels without their schemas.
    fn lack_schema_of(&self, body: &[u8]) -> bool {
        matches!(parse(op::CHANNEL, body), Ok(Record::Channel(channel))
            if channel.schema_id != 0 && !self.schemas.contains_key(&channel.schema_id))
    }

    /// Takes schema and channel records, ignores others. The first record of a number counts.
    pub(crate) fn take(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if opcode != op::SCHEMA && opcode != op::CHANNEL {
            return Ok(());
        }
        match parse(opcode, body)? {
            Record::Schema { header, data } => {
                self.schemas.entry(header.id).or_insert_with(|| {
                    Arc::new(mcap::Schema {
                        id: header.id,
                        name: header.name,
                        encoding: header.encoding,
                        data: data.into_owned().into(),
                    })
                });
            }
            Record::Channel(channel) => {
                let schema = match channel.schema_id {
                    0 => None,
                    id => Some(
                        self.schemas
                            .get(&id)
                            .cloned()
                            .ok_or_else(|| format!("channel {} has no schema", channel.id))?,
                    ),
                };
                self.channels.entry(channel.id).or_insert_with(|| {
                    Arc::new(mcap::Channel {
                        id: channel.id,
                        topic: channel.topic,
                        schema,
                        message_encoding: channel.message_encoding,
                        metadata: channel.metadata,
                    })
                });
            }
            _ => {}
        }
        Ok(())
    }
}
