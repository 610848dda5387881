//! The writer thread: takes batches from the queue, writes, splits, syncs.

use std::collections::{BTreeMap, VecDeque};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bytes::Bytes;
use mcap::records::Metadata;

use super::queue::{Entry, Queue};
use super::{Losses, RecorderOptions, Statistics, TopicStatistics};
use crate::channel::Channel;
use crate::disk::{Place, Stream};
use crate::error::Error;
use crate::metadata::FolderInformation;
use crate::seal::{Reach, Seals};
use crate::split::SplitFile;

/// Name of the MCAP metadata record with the losses so far: topic to JSON of [`Losses`]. The last one in a recording
/// counts.
pub(crate) const LOSSES_RECORD: &str = "probecell_losses";

/// Name of the MCAP metadata record in which rosbag2 keeps its `metadata.yaml`.
pub(crate) const ROSBAG2_RECORD: &str = "rosbag2";

/// Room of written entries is given back in portions of this many bytes, so that pushers do not wait for a whole batch.
const RELEASE_BYTES: usize = 1 << 20;

/// Messages between two looks at the clock.
const CLOCK_STRIDE: u32 = 32;

/// A latched message kept for the next split.
struct Latched {
    sequence: u32,
    publish_time: u64,
    payload: Bytes,
}

struct Topic {
    channel: Channel,
    messages: u64,
    /// Messages in the files, repeats included: the count in `metadata.yaml`.
    recorded: u64,
    bytes: u64,
    latched: VecDeque<Latched>,
}

pub(super) struct RecordingWriter {
    options: RecorderOptions,
    name: String,
    split: Option<SplitFile>,
    seals: Option<Seals>,
    finished: FolderInformation,
    topics: Vec<Topic>,
    statistics: Statistics,
    losses_written: u64,
}

impl RecordingWriter {
    pub(super) fn create(options: RecorderOptions) -> Result<Self, Error> {
        let folder = &options.folder;
        let name = folder
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if let Some(parent) = folder.parent() {
            std::fs::create_dir_all(parent)
                .map_err(|source| Error::io("make the folder", parent, source))?;
        }
        std::fs::create_dir(folder).map_err(|source| match source.kind() {
            ErrorKind::AlreadyExists => Error::Exists {
                path: folder.clone(),
            },
            _ => Error::io("make the folder", folder, source),
        })?;
        let finished = FolderInformation {
            custom_data: options.custom_data.clone(),
            ros_distro: options.ros_distro.clone(),
            ..FolderInformation::default()
        };
        let seals = (options.sealer.clone())
            .map(|sealer| Seals::create(&*options.disk, &options.folder, sealer))
            .transpose()?;
        let mut writer = Self {
            options,
            name,
            split: None,
            seals,
            finished,
            topics: Vec::new(),
            statistics: Statistics::default(),
            losses_written: 0,
        };
        let opened = writer.open_split().map(|_| ());
        match opened.and_then(|()| writer.write_folder_metadata()) {
            Ok(()) => Ok(writer),
            Err(failure) => {
                drop(writer.abandon());
                Err(failure)
            }
        }
    }

    fn open_split(&mut self) -> Result<&mut SplitFile, Error> {
        let path = self.options.folder.join(format!(
            "{}_{}.mcap",
            self.name,
            self.statistics.files.len()
        ));
        let mut split = SplitFile::create(
            &*self.options.disk,
            &path,
            &self.options.chunks(),
            self.seals.is_some(),
        )?;
        let (disk, folder) = (&self.options.disk, &self.options.folder);
        let named = split.sync().and_then(|()| {
            let synced = disk.sync_folder(folder);
            synced.map_err(|source| Error::io("sync the folder", folder, source))
        });
        if let Err(failure) = named {
            split.abandon();
            return Err(failure);
        }
        self.statistics.files.push(path);
        Ok(self.split.insert(split))
    }

    /// The whole folder as it stands, the open file included.
    fn folder_information(&self) -> FolderInformation {
        let mut information = self.finished.clone();
        information.topics = self
            .topics
            .iter()
            .map(|topic| (topic.channel.clone(), topic.recorded))
            .collect();
        information
            .files
            .extend(self.split.iter().map(|split| split.information.clone()));
        information
    }

    fn write_folder_metadata(&self) -> Result<(), Error> {
        (self.folder_information()).write(&*self.options.disk, &self.options.folder)
    }

    fn close_split(&mut self, losses: &(Vec<Losses>, u64)) -> Result<(), Error> {
        self.write_losses(losses)?;
        let serialized = self.folder_information().to_string();
        let Some(mut split) = self.split.take() else {
            return Ok(());
        };
        split.metadata(&Metadata {
            name: ROSBAG2_RECORD.to_owned(),
            metadata: BTreeMap::from([("serialized_metadata".to_owned(), serialized)]),
        })?;
        let (information, bytes, digest) = split.finish()?;
        if let (Some(seals), Some(digest)) = (&mut self.seals, digest) {
            seals.add(&information.path, digest, Reach::Whole)?;
        }
        self.finished.files.push(information);
        self.statistics.file_bytes += bytes;
        Ok(())
    }

    fn write_losses(&mut self, losses: &(Vec<Losses>, u64)) -> Result<(), Error> {
        let (losses, changes) = losses;
        if *changes == self.losses_written {
            return Ok(());
        }
        let mut table: BTreeMap<String, Losses> = BTreeMap::new();
        for (topic, losses) in self
            .topics
            .iter()
            .zip(losses)
            .filter(|(_, losses)| **losses != Losses::default())
        {
            let sum = table.entry(topic.channel.topic.clone()).or_default();
            sum.queue += losses.queue;
            sum.bus += losses.bus;
            sum.recovered += losses.recovered;
        }
        let text = |losses: &Losses| serde_json::to_string(losses).unwrap_or_default();
        let metadata = table
            .iter()
            .map(|(topic, losses)| (topic.clone(), text(losses)))
            .collect();
        if let Some(split) = &mut self.split {
            split.metadata(&Metadata {
                name: LOSSES_RECORD.to_owned(),
                metadata,
            })?;
            self.losses_written = *changes;
        }
        Ok(())
    }

    fn split_is_full(&self, log_time: u64) -> bool {
        let Some(split) = &self.split else {
            return false;
        };
        let Some((start, _)) = split.information.bounds else {
            return false;
        };
        let by_size = self
            .options
            .split
            .bytes
            .is_some_and(|limit| split.written() >= limit);
        let span = Duration::from_nanos(log_time.saturating_sub(start));
        by_size
            || self
                .options
                .split
                .duration
                .is_some_and(|limit| span >= limit)
    }

    /// Begins the next file, whose first message will have `log_time`.
    fn next_split(&mut self, log_time: u64, queue: &Queue) -> Result<(), Error> {
        self.close_split(&queue.all_losses())?;
        self.open_split()?;
        let Some(split) = &mut self.split else {
            return Ok(());
        };
        for (index, topic) in self.topics.iter_mut().enumerate() {
            for message in &topic.latched {
                let times = (log_time, message.publish_time);
                split.write(
                    index,
                    &topic.channel,
                    message.sequence,
                    times,
                    &message.payload,
                )?;
                topic.recorded += 1;
                self.statistics.repeats += 1;
            }
        }
        self.write_folder_metadata()
    }

    fn write(&mut self, entry: &Entry, queue: &Queue) -> Result<(), Error> {
        match entry {
            Entry::Message {
                channel,
                sequence,
                log_time,
                publish_time,
                payload,
            } => {
                if self.split_is_full(*log_time) {
                    self.next_split(*log_time, queue)?;
                }
                let (Some(split), Some(topic)) = (&mut self.split, self.topics.get_mut(*channel))
                else {
                    return Ok(());
                };
                split.write(
                    *channel,
                    &topic.channel,
                    *sequence,
                    (*log_time, *publish_time),
                    payload,
                )?;
                topic.messages += 1;
                topic.recorded += 1;
                topic.bytes += payload.len() as u64;
                let depth = topic.channel.qos.latched_depth();
                if depth > 0 {
                    if topic.latched.len() == depth {
                        topic.latched.pop_front();
                    }
                    topic.latched.push_back(Latched {
                        sequence: *sequence,
                        publish_time: *publish_time,
                        payload: payload.clone(),
                    });
                }
            }
            Entry::Attachment {
                name,
                media_type,
                log_time,
                data,
            } => {
                if let Some(split) = &mut self.split {
                    split.attach(*log_time, name, media_type, data)?;
                }
            }
            Entry::Metadata { name, table } => {
                if let Some(split) = &mut self.split {
                    split.metadata(&Metadata {
                        name: name.clone(),
                        metadata: table.clone(),
                    })?;
                }
            }
        }
        Ok(())
    }

    fn sync(&mut self, queue: &Queue) -> Result<(), Error> {
        self.write_losses(&queue.all_losses())?;
        if let Some(split) = &mut self.split {
            split.sync()?;
            if let (Some(seals), Some(digest)) = (&mut self.seals, split.digest()) {
                seals.add(&split.information.path, digest, Reach::Prefix)?;
            }
        }
        queue.set_durable(self.topics.iter().map(|topic| topic.messages).sum());
        Ok(())
    }

    /// Ends the recording where its open file has been moved or removed by another program, or its folder may not be written any
    /// more: what would be written from now on could not be found, not be read, or not be completed.
    fn check_place(&mut self, queue: &Queue) -> Result<(), Error> {
        let Some(split) = &self.split else {
            return Ok(());
        };
        let (path, stream, place) = (split.path().to_owned(), split.stream(), split.place()?);
        if place == Place::Kept {
            return Ok(());
        }
        // The descriptor is still there: the file is made whole. Without a summary it is read all the same.
        drop(self.close_split(&queue.all_losses()));
        match place {
            Place::Moved => return Err(Error::Moved { path }),
            Place::Closed(reason) => {
                let folder = path.parent().unwrap_or(&path);
                let doing = "write into the folder of the recording";
                return Err(Error::io(doing, folder, reason.into()));
            }
            Place::Kept | Place::Removed => {}
        }
        let kept = self.keep(&stream, &path).map_or_else(
            |error| format!("what was recorded is lost ({error})"),
            |kept| format!("what was recorded until then is kept in {}", kept.display()),
        );
        Err(Error::Removed { kept, path })
    }

    /// Copies the removed file into a folder beside that of the recording.
    fn keep(&self, stream: &Stream, path: &Path) -> std::io::Result<PathBuf> {
        let folder = self
            .options
            .folder
            .with_file_name(format!("{}_kept", self.name));
        std::fs::create_dir_all(&folder)?;
        let file = folder.join(path.file_name().unwrap_or_default());
        stream.file().copy_to(&file)?;
        self.options.disk.sync_folder(&folder)?;
        Ok(file)
    }

    fn finish(&mut self, queue: &Queue) -> Result<Statistics, Error> {
        let losses = queue.all_losses();
        self.close_split(&losses)?;
        self.write_folder_metadata()?;
        if let Some(seals) = &mut self.seals {
            seals.add_file(crate::metadata::FILE_NAME, Reach::Last)?;
        }
        let mut statistics = std::mem::take(&mut self.statistics);
        statistics.queue_peak_bytes = queue.peak();
        statistics.topics = self
            .topics
            .iter()
            .zip(&losses.0)
            .map(|(topic, losses)| TopicStatistics {
                topic: topic.channel.topic.clone(),
                type_name: topic.channel.type_name.clone(),
                messages: topic.messages,
                bytes: topic.bytes,
                losses: *losses,
            })
            .collect();
        statistics.messages = statistics.topics.iter().map(|topic| topic.messages).sum();
        statistics.bytes = statistics.topics.iter().map(|topic| topic.bytes).sum();
        Ok(statistics)
    }

    /// Until the queue is closed and empty.
    fn record(&mut self, queue: &Queue) -> Result<Statistics, Error> {
        // Twice in the interval: a message that just misses one sync is still on disk in time with the next.
        let period = (self.options.sync_interval / 2).max(Duration::from_millis(1));
        let mut next_sync = Instant::now() + period;
        let mut since_clock = 0;
        let mut dirty = false;
        loop {
            let batch = queue.take(self.topics.len(), next_sync);
            queue.mark_alive();
            self.topics
                .extend(batch.new_channels.into_iter().map(|channel| Topic {
                    channel,
                    messages: 0,
                    recorded: 0,
                    bytes: 0,
                    latched: VecDeque::new(),
                }));
            let ended = batch.last && batch.entries.is_empty();
            let mut written = 0;
            let mut entries = batch.entries;
            while let Some(entry) = entries.pop_front() {
                if let Err(failure) = self.write(&entry, queue) {
                    entries.push_front(entry);
                    queue.lose(&entries);
                    return Err(failure);
                }
                dirty = true;
                written += entry.size();
                if written >= RELEASE_BYTES {
                    queue.release(std::mem::take(&mut written));
                }
                since_clock += 1;
                if since_clock >= CLOCK_STRIDE {
                    since_clock = 0;
                    queue.mark_alive();
                    if Instant::now() >= next_sync {
                        self.check_place(queue)?;
                        self.sync(queue)?;
                        dirty = false;
                        next_sync = Instant::now() + period;
                    }
                }
            }
            if written > 0 {
                queue.release(written);
            }
            if ended {
                self.check_place(queue)?;
                return self.finish(queue);
            }
            if Instant::now() >= next_sync {
                self.check_place(queue)?;
                if dirty || queue.all_losses().1 != self.losses_written {
                    self.sync(queue)?;
                    dirty = false;
                }
                next_sync = Instant::now() + period;
            }
        }
    }

    fn abandon(self) -> Vec<PathBuf> {
        if let Some(split) = self.split {
            split.abandon();
        }
        self.statistics.files
    }
}

pub(super) fn run(mut writer: RecordingWriter, queue: &Queue) -> Result<Statistics, Error> {
    let result = writer.record(queue);
    if let Err(failure) = &result {
        queue.fail(failure.clone());
        drop(writer.abandon());
    }
    result
}
