//! What can go wrong with a recording as a whole. Damage inside a file is not an error: see [`crate::Damage`].

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One sentence each, the path last. Cheap to clone, so that every pusher can return the same failure.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// The operating system refused; `doing` is the verb phrase of the attempt.
    #[error("cannot {doing}: {source}: {path}")]
    Io {
        /// What was attempted, such as `"write the recording"`.
        doing: &'static str,
        /// The operating system's reason.
        source: Arc<io::Error>,
        /// File or folder concerned.
        path: PathBuf,
    },
    /// The MCAP writer refused a record.
    #[error("cannot write the recording: {reason}: {path}")]
    Write {
        /// The writer's reason.
        reason: String,
        /// File being written.
        path: PathBuf,
    },
    /// The open file of a recording was given another name.
    #[error(
        "the recording was moved while it was written; what was recorded until then is where it is now: {path}"
    )]
    Moved {
        /// File that was written.
        path: PathBuf,
    },
    /// The open file of a recording was removed; what it held was copied from its descriptor.
    #[error("the recording was removed while it was written; {kept}: {path}")]
    Removed {
        /// What became of what it held.
        kept: String,
        /// File that was written.
        path: PathBuf,
    },
    /// A recording is never written over another one.
    #[error("the folder exists already, a recording is never written over another: {path}")]
    Exists {
        /// Folder asked for.
        path: PathBuf,
    },
    /// The file does not begin with the MCAP magic bytes.
    #[error("not an MCAP file (bad magic bytes at offset 0): {path}")]
    NotMcap {
        /// File opened.
        path: PathBuf,
    },
    /// A recording in another form than MCAP.
    #[error("the file {what}; make it readable by `{command}`: {path}")]
    OtherForm {
        /// What it is, as a verb phrase.
        what: &'static str,
        /// The command that converts it.
        command: String,
        /// File opened.
        path: PathBuf,
    },
    /// A folder of rosbag2 whose messages are compressed one by one.
    #[error(
        "each message is compressed by {format} (compression_mode MESSAGE in metadata.yaml); make it readable by \
         `ros2 bag convert -i {} -o convert.yaml` with `output_bags: [{{uri: plain, storage_id: mcap, all: true}}]` in convert.yaml: {}",
        path.display(),
        path.display()
    )]
    CompressedMessages {
        /// As `metadata.yaml` names it.
        format: String,
        /// Folder opened.
        path: PathBuf,
    },
    /// A folder with more than one recording.
    #[error("the folder holds {} recordings, name one of them ({}{}): {}", count, recordings.join(", "), if recordings.len() < *count { ", ..." } else { "" }, path.display())]
    SeveralRecordings {
        /// Their number.
        count: usize,
        /// Names of the first of them.
        recordings: Vec<String>,
        /// Folder opened.
        path: PathBuf,
    },
    /// A folder without a single `.mcap`.
    #[error("no .mcap file in the folder: {path}")]
    NoRecording {
        /// Folder opened.
        path: PathBuf,
    },
    /// The recorder has been stopped, or its writer thread is gone.
    #[error("the recorder has stopped: {path}")]
    Stopped {
        /// Folder of the recording.
        path: PathBuf,
    },
    /// More than 65535 channels or schemas.
    #[error("a recording holds at most 65535 channels")]
    TooManyChannels,
    /// An option that makes no sense.
    #[error("recorder option {option} is {value}, must be {must}")]
    Option {
        /// Name of the field of [`crate::RecorderOptions`].
        option: &'static str,
        /// Value with its unit.
        value: String,
        /// What it must be.
        must: &'static str,
    },
    /// No such topic in the bag.
    #[error("no topic {topic}: {path}")]
    NoTopic {
        /// Topic asked for.
        topic: String,
        /// Bag opened.
        path: PathBuf,
    },
    /// The topic carries another type than the one asked for.
    #[error("topic {topic} carries {found}, expected {expected}: {path}")]
    OtherType {
        /// Topic asked for.
        topic: String,
        /// Type in the bag.
        found: String,
        /// Type asked for.
        expected: String,
        /// Bag opened.
        path: PathBuf,
    },
    /// A payload that is no message of its type.
    #[error(
        "message {sequence} of topic {topic} cannot be decoded as {expected}: {reason}: {path}"
    )]
    Decode {
        /// Topic.
        topic: String,
        /// Sequence number in the recording.
        sequence: u32,
        /// Type of the topic.
        expected: String,
        /// Why.
        reason: String,
        /// Bag opened.
        path: PathBuf,
    },
    /// Part of the recording is damaged; the rest is given all the same.
    #[error(transparent)]
    Damaged(#[from] crate::Damage),
}

impl Error {
    pub(crate) fn io(doing: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io {
            doing,
            source: Arc::new(source),
            path: path.to_owned(),
        }
    }

    pub(crate) fn mcap(path: &Path, source: mcap::McapError) -> Self {
        match source {
            mcap::McapError::Io(source) => Self::io("write the recording", path, source),
            mcap::McapError::TooManyChannels | mcap::McapError::TooManySchemas => {
                Self::TooManyChannels
            }
            other => Self::Write {
                reason: other.to_string(),
                path: path.to_owned(),
            },
        }
    }
}
