//! What can be wrong with a recording, and where.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// What is wrong at an offset of a file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DamageKind {
    /// The file ends inside a record, or without its footer.
    Truncated,
    /// No footer, index or summary that could be used; the file was scanned instead.
    NoSummary(String),
    /// A chunk cannot be unpacked or fails its CRC: all its messages are lost.
    Chunk(String),
    /// A record outside of chunks that cannot be read.
    Record(String),
    /// The data contradicts its checksum or the statistics, though each chunk can be read.
    DataSection(String),
    /// Bytes that are no record; reading continued at the next chunk.
    Garbage,
    /// Messages whose channel record is lost.
    UnknownChannel {
        /// Their number.
        messages: u64,
    },
    /// A file that `metadata.yaml` names and that is not there.
    MissingFile,
}

impl DamageKind {
    /// Whether messages may be missing because of it.
    pub fn loses_messages(&self) -> bool {
        !matches!(self, Self::NoSummary(_))
    }
}

/// Damage found in a recording. Everything else of the recording is given all the same.
#[derive(
    Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, thiserror::Error,
)]
pub struct Damage {
    /// File concerned.
    pub file: PathBuf,
    /// Where it begins, bytes from the start of the file.
    pub offset: u64,
    /// Bytes concerned.
    pub length: u64,
    /// What is wrong.
    pub kind: DamageKind,
}

impl Display for Damage {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            file,
            offset,
            length,
            kind,
        } = self;
        match kind {
            DamageKind::Truncated => write!(f, "the file is cut off at byte {}", offset + length)?,
            DamageKind::NoSummary(why) => write!(
                f,
                "no usable summary at byte {offset} ({why}), the file was walked"
            )?,
            DamageKind::Chunk(why) => write!(
                f,
                "the chunk at byte {offset} ({length} bytes) is damaged: {why}"
            )?,
            DamageKind::Record(why) => write!(
                f,
                "the record at byte {offset} ({length} bytes) is damaged: {why}"
            )?,
            DamageKind::DataSection(why) => {
                write!(f, "the data section ({length} bytes) is damaged: {why}")?;
            }
            DamageKind::Garbage => {
                write!(f, "{length} bytes from byte {offset} on are no records")?;
            }
            DamageKind::UnknownChannel { messages } => {
                write!(
                    f,
                    "{messages} messages in the chunk at byte {offset} belong to a channel whose record is lost"
                )?;
            }
            DamageKind::MissingFile => write!(f, "a file named in metadata.yaml is not there")?,
        }
        write!(f, ": {}", file.display())
    }
}
