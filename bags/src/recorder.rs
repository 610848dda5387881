//! Records messages from any thread into a rosbag2 folder, on one writer thread.
//!
//! - **Memory is bounded**: the queue is measured in bytes. When it is full the pusher waits or the message is counted
//!   as lost, per topic, and the losses are written into the recording. Nothing is lost silently.
//! - **A kill costs at most [`RecorderOptions::sync_interval`]**: the writer closes the chunk, writes and syncs twice per
//!   interval, so that a message is on disk within one interval of its push, as long as disk and processor need less than
//!   half of it. The same bound holds for a power failure.
//! - **Every split stands alone**: the last messages of latched (transient local) topics are repeated at its start,
//!   with the log time of the split's first message, their own sequence and publish time.
//! - Schema, channel, attachments, losses and a `metadata.yaml` of version 9 are written as rosbag2 has them.
//!
//! Times are nanoseconds since 1970. The recorder asks no clock for stamps: log and publish time come with the message;
//! only the sync interval runs on the monotonic clock.

mod queue;
mod thread;

use std::collections::BTreeMap;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use crate::channel::Channel;
use crate::disk::{Disk, SystemDisk};
use crate::error::Error;
use crate::seal::Sealer;
use crate::split::ChunkOptions;
use queue::{Entry, Queue};

pub(crate) use thread::{LOSSES_RECORD, ROSBAG2_RECORD};

/// What to do with a message for which the queue has no room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Overflow {
    /// Count it as lost and continue: a control loop must not wait for a disk.
    #[default]
    Count,
    /// Make the pusher wait: for conversions, where time does not matter.
    Block,
}

/// When a new file is begun; both limits may be given, the first one reached counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SplitAt {
    /// File size in bytes; exceeded by one chunk at most.
    pub bytes: Option<u64>,
    /// Span of log time.
    pub duration: Option<Duration>,
}

/// Settings of a recording.
#[derive(Debug, Clone)]
pub struct RecorderOptions {
    /// Folder to be made; its last component names the files (`<folder>/<name>_0.mcap`). It must not exist.
    pub folder: PathBuf,
    /// The most a kill may cost.
    pub sync_interval: Duration,
    /// When a new file is begun.
    pub split: SplitAt,
    /// Room of the queue, bytes (payloads and their bookkeeping). A larger message is taken when the queue is empty.
    pub queue_bytes: usize,
    /// What to do when the queue is full.
    pub overflow: Overflow,
    /// Uncompressed size at which a chunk is closed, bytes.
    pub chunk_bytes: u64,
    /// Compress chunks with zstd.
    pub compress: bool,
    /// zstd level; 0 is zstd's default.
    pub compression_level: u32,
    /// `ros_distro` of `metadata.yaml`.
    pub ros_distro: String,
    /// `custom_data` of `metadata.yaml`.
    pub custom_data: BTreeMap<String, String>,
    /// What signs the seals of the recording ([`crate::verify_seals`]); none: it has none.
    pub sealer: Option<Sealer>,
    /// Where it is written.
    pub disk: Arc<dyn Disk>,
}

impl RecorderOptions {
    /// Defaults: 1 s sync interval, no splits, 64 MiB queue that counts losses, 1 MiB chunks, zstd.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
            sync_interval: Duration::from_secs(1),
            split: SplitAt::default(),
            queue_bytes: 64 << 20,
            overflow: Overflow::default(),
            chunk_bytes: 1 << 20,
            compress: true,
            compression_level: 0,
            ros_distro: "jazzy".to_owned(),
            custom_data: BTreeMap::new(),
            sealer: None,
            disk: Arc::new(SystemDisk),
        }
    }

    fn check(&self) -> Result<(), Error> {
        let bad = |option, value: String, must| {
            Err(Error::Option {
                option,
                value,
                must,
            })
        };
        if self.sync_interval.is_zero() {
            return bad("sync_interval", "0 s".to_owned(), "above 0 s");
        }
        if self.queue_bytes == 0 {
            return bad("queue_bytes", "0 bytes".to_owned(), "above 0 bytes");
        }
        if self.chunk_bytes == 0 || self.chunk_bytes > 1 << 29 {
            return bad(
                "chunk_bytes",
                format!("{} bytes", self.chunk_bytes),
                "between 1 byte and 512 MiB",
            );
        }
        if self.split.bytes == Some(0) {
            return bad("split.bytes", "0 bytes".to_owned(), "above 0 bytes");
        }
        if self
            .split
            .duration
            .is_some_and(|duration| duration.is_zero())
        {
            return bad("split.duration", "0 s".to_owned(), "above 0 s");
        }
        if self.folder.file_name().is_none() {
            return bad(
                "folder",
                self.folder.display().to_string(),
                "a path that ends in a name",
            );
        }
        Ok(())
    }

    fn chunks(&self) -> ChunkOptions {
        ChunkOptions {
            bytes: self.chunk_bytes,
            zstd: self.compress,
            zstd_level: self.compression_level,
            data_crc: true,
        }
    }
}

/// A channel of this recorder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChannelId(usize);

/// What became of a pushed message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pushed {
    /// It stands in the queue.
    Queued,
    /// The queue was full; the loss is counted.
    Lost,
}

/// Messages of a topic that the recording does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Losses {
    /// Refused because the recorder's queue was full, or left over after a failure of the disk.
    pub queue: u64,
    /// Missed on the bus before they reached the recorder, as reported by its subscriber.
    pub bus: u64,
    /// Of those, fetched late from the publisher (and recorded after all).
    pub recovered: u64,
}

impl Losses {
    /// Messages missing from the recording.
    pub fn missing(self) -> u64 {
        self.queue + self.bus.saturating_sub(self.recovered)
    }
}

/// One topic of a finished recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicStatistics {
    /// Topic name.
    pub topic: String,
    /// Type name.
    pub type_name: String,
    /// Messages written, without repeats of latched ones.
    pub messages: u64,
    /// Payload bytes of those.
    pub bytes: u64,
    /// What is missing.
    pub losses: Losses,
}

/// A finished recording.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Statistics {
    /// Messages written, without repeats of latched ones.
    pub messages: u64,
    /// Latched messages written again at the starts of splits.
    pub repeats: u64,
    /// Payload bytes, without repeats.
    pub bytes: u64,
    /// Size of all files, bytes.
    pub file_bytes: u64,
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Most bytes that stood in the queue at once.
    pub queue_peak_bytes: usize,
    /// Topic by topic, in the order in which the recorder came to know them.
    pub topics: Vec<TopicStatistics>,
}

impl Statistics {
    /// Messages missing from the recording, over all topics.
    pub fn missing(&self) -> u64 {
        self.topics.iter().map(|topic| topic.losses.missing()).sum()
    }
}

/// Puts messages into a running recording, from any thread; clones push into the same one.
#[derive(Clone)]
pub struct Pusher {
    queue: Arc<Queue>,
    folder: PathBuf,
}

impl Pusher {
    /// Folder of the recording.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Registers a channel; the same channel gives the same number again.
    ///
    /// # Errors
    /// Too many channels, or the recorder has stopped.
    pub fn channel(&self, channel: &Channel) -> Result<ChannelId, Error> {
        self.queue.channel(channel).map(ChannelId)
    }

    /// Queues a message. Fails once the recorder has failed or stopped, then always with the same error.
    ///
    /// `sequence` is the publication number on the topic; MCAP keeps its low 32 bits. `log_time` is the instant of
    /// reception, `publish_time` that of the source, both ns since 1970. The payload is not copied.
    ///
    /// # Errors
    /// The recorder has stopped.
    pub fn push(
        &self,
        channel: ChannelId,
        sequence: u64,
        log_time: u64,
        publish_time: u64,
        payload: impl Into<Bytes>,
    ) -> Result<Pushed, Error> {
        let payload = payload.into();
        self.queue.push(
            Entry::Message {
                channel: channel.0,
                sequence: sequence as u32,
                log_time,
                publish_time,
                payload,
            },
            &self.folder,
        )
    }

    /// Adds a file to the recording (the cell file, a node's config), stamped `log_time` (ns since 1970).
    /// Waits for room, whatever the policy.
    ///
    /// # Errors
    /// The recorder has stopped.
    pub fn attach(
        &self,
        name: impl Into<String>,
        media_type: impl Into<String>,
        log_time: u64,
        data: impl Into<Bytes>,
    ) -> Result<(), Error> {
        let entry = Entry::Attachment {
            name: name.into(),
            media_type: media_type.into(),
            log_time,
            data: data.into(),
        };
        self.queue.push(entry, &self.folder).map(|_| ())
    }

    /// Adds a named table of texts (source revision, session) to the recording. Waits for room, whatever the policy.
    ///
    /// # Errors
    /// The recorder has stopped.
    pub fn metadata(
        &self,
        name: impl Into<String>,
        table: BTreeMap<String, String>,
    ) -> Result<(), Error> {
        self.queue
            .push(
                Entry::Metadata {
                    name: name.into(),
                    table,
                },
                &self.folder,
            )
            .map(|_| ())
    }

    /// Counts messages that were missed on the bus before they could be pushed; `recovered` if they were fetched late.
    pub fn report_bus_loss(&self, channel: ChannelId, count: u64, recovered: bool) {
        self.queue.report_bus_loss(channel.0, count, recovered);
    }

    /// Messages missing so far, topic by topic; topics without loss are left out.
    pub fn losses(&self) -> Vec<(String, Losses)> {
        self.queue.losses()
    }

    /// Messages that were on disk, synced, after the last sync: the first so many that were queued. A kill of the
    /// process or of the machine cannot lose them.
    pub fn durable_messages(&self) -> u64 {
        self.queue.durable()
    }

    /// How long nothing has been heard of the writer thread: much longer than [`RecorderOptions::sync_interval`] where the
    /// disk does not answer, as a network drive whose server is gone. What is pushed meanwhile waits in the queue.
    pub fn silent_for(&self) -> Duration {
        self.queue.silent_for()
    }

    /// The failure that ended the recording early, if there was one.
    pub fn failure(&self) -> Option<Error> {
        self.queue.failure()
    }
}

/// A running recording: everything a [`Pusher`] can do, and the end.
pub struct Recorder {
    pusher: Pusher,
    thread: Option<JoinHandle<Result<Statistics, Error>>>,
}

impl Deref for Recorder {
    type Target = Pusher;

    fn deref(&self) -> &Pusher {
        &self.pusher
    }
}

impl Recorder {
    /// Makes the folder and its first file, and starts the writer thread.
    ///
    /// # Errors
    /// The folder exists, an option is out of its range, or what the system says.
    pub fn start(options: RecorderOptions) -> Result<Self, Error> {
        options.check()?;
        let folder = options.folder.clone();
        let queue = Arc::new(Queue::new(options.queue_bytes, options.overflow));
        let writer = thread::RecordingWriter::create(options)?;
        let for_thread = Arc::clone(&queue);
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || thread::run(writer, &for_thread))
            .map_err(|source| Error::io("start the writer thread", &folder, source))?;
        Ok(Self {
            pusher: Pusher { queue, folder },
            thread: Some(thread),
        })
    }

    /// A handle for another thread.
    pub fn pusher(&self) -> Pusher {
        self.pusher.clone()
    }

    /// Writes everything queued, closes the files and returns what was written. Pushers on other threads get
    /// [`Error::Stopped`] from now on.
    ///
    /// # Errors
    /// What could not be written.
    pub fn stop(mut self) -> Result<Statistics, Error> {
        self.join()
    }

    fn join(&mut self) -> Result<Statistics, Error> {
        self.pusher.queue.close();
        let stopped = || Error::Stopped {
            path: self.pusher.folder.clone(),
        };
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            // A panic of the writer thread is a bug; its message is on standard error already.
            Some(Err(_)) | None => Err(stopped()),
        }
    }
}

/// Drains the queue and closes the files; use [`Recorder::stop`] to learn whether that worked.
impl Drop for Recorder {
    fn drop(&mut self) {
        if self.thread.is_some() {
            drop(self.join());
        }
    }
}
