//! Reads a recording: a single `.mcap`, or a rosbag2 folder of splits as one.
//!
//! Messages come in order of log time (ns since 1970); at equal times in the order of the files and within them, so the
//! order is the same at every reading. Only chunks that overlap in time are in memory at once. Latched messages that a
//! recorder repeated at the start of a split are given once.

mod files;
mod merge;
mod typed;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use probecell_msgs::migration::Migration;

use crate::channel::Channel;
use crate::container::{AttachmentLocation, Contents};
use crate::damage::Damage;
use crate::error::Error;
use crate::recorder::{LOSSES_RECORD, Losses};

pub use merge::{Messages, Position};
pub use typed::{Stamped, Typed};

/// A message as recorded. The payload is a view into its chunk, which stays in memory as long as the view does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recorded {
    /// Its topic.
    pub channel: Arc<Channel>,
    /// Publication number, low 32 bits.
    pub sequence: u32,
    /// Reception, ns since 1970.
    pub log_time: u64,
    /// Source time, ns since 1970.
    pub publish_time: u64,
    /// Serialised message; for `cdr` with its 4-byte encapsulation header.
    pub payload: Bytes,
}

/// A file inside the recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attachment {
    /// Name.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// When it was added, ns since 1970.
    pub log_time: u64,
    /// Its bytes.
    pub data: Bytes,
}

/// A recording opened for reading.
#[derive(Debug)]
pub struct Bag {
    path: PathBuf,
    files: Vec<Contents>,
    channels: Vec<Arc<Channel>>,
    /// Of each channel, where its messages are of another version of their type.
    migrations: Vec<Option<Migration>>,
    /// Number in `channels` of each file's channel ids.
    numbers: Vec<BTreeMap<u16, usize>>,
    missing: Vec<Damage>,
}

impl Bag {
    /// Opens a `.mcap` file or a folder of them.
    ///
    /// A file with a whole summary opens at once and its chunks are checked as they are read; any other is walked and
    /// checked now. Damage does not fail: see [`Bag::damage`] and the items of [`Messages`].
    ///
    /// # Errors
    /// Neither an MCAP file nor a folder with one, or what the system says.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let (paths, missing) = files::of(path)?;
        let files = paths
            .iter()
            .map(|path| Contents::read(path))
            .collect::<Result<Vec<_>, _>>()?;
        files::are_of_one_recording(path, &files)?;
        let (mut channels, mut migrations) = (Vec::<Arc<Channel>>::new(), Vec::new());
        let mut known: BTreeMap<Channel, usize> = BTreeMap::new();
        let mut numbers = Vec::with_capacity(files.len());
        for file in &files {
            let mut of_file = BTreeMap::new();
            for (id, raw) in &file.channels {
                let channel = Channel::from_mcap(raw);
                let number = *known.entry(channel).or_insert_with_key(|channel| {
                    let mut channel = channel.clone();
                    migrations.push(channel.migrated());
                    channels.push(Arc::new(channel));
                    channels.len() - 1
                });
                of_file.insert(*id, number);
            }
            numbers.push(of_file);
        }
        Ok(Self {
            path: path.to_owned(),
            files,
            channels,
            migrations,
            numbers,
            missing,
        })
    }

    /// What was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The files, in reading order.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(|file| file.path.as_path())
    }

    /// Writer of the first file, as it names itself.
    pub fn library(&self) -> &str {
        self.files.first().map_or("", |file| &file.library)
    }

    /// Channels in order of first appearance. A topic has several if several publishers or types were recorded.
    pub fn channels(&self) -> &[Arc<Channel>] {
        &self.channels
    }

    /// Topics whose messages were recorded in another version of their type, and what differs, a field each. They are given in
    /// that of this version: by the names of the fields, with what is new unset.
    pub fn migrated(&self) -> impl Iterator<Item = (&Channel, &[String])> {
        let pairs = self.channels.iter().zip(&self.migrations);
        pairs.filter_map(|(channel, migration)| Some((&**channel, migration.as_ref()?.changes())))
    }

    /// Channels of one topic.
    pub fn channels_of<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = &'a Arc<Channel>> {
        self.channels
            .iter()
            .filter(move |channel| channel.topic == topic)
    }

    /// Messages of each channel of [`Bag::channels`], repeats of latched ones included; what damage hides is not counted
    /// where the file had to be walked.
    pub fn counts(&self) -> Vec<u64> {
        let mut counts = vec![0; self.channels.len()];
        for (file, numbers) in self.files.iter().zip(&self.numbers) {
            for (id, count) in &file.counts {
                if let Some(number) = numbers.get(id) {
                    counts[*number] += count;
                }
            }
        }
        counts
    }

    /// First and last log time, ns since 1970; `None` without messages.
    pub fn bounds(&self) -> Option<(u64, u64)> {
        self.files
            .iter()
            .filter_map(Contents::bounds)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Damage known from opening. Damage inside chunks of an indexed file shows when they are read: see [`Bag::verify`].
    pub fn damage(&self) -> Vec<Damage> {
        self.missing
            .iter()
            .chain(self.files.iter().flat_map(|file| &file.damage))
            .cloned()
            .collect()
    }

    /// Reads everything once and returns all damage, including that found on opening.
    pub fn verify(&self) -> Vec<Damage> {
        let mut damage = self.damage();
        damage.extend(self.files.iter().flat_map(Contents::verify));
        damage
    }

    /// All messages.
    pub fn messages(&self) -> Messages<'_> {
        Messages::new(self, None, Position::default())
    }

    /// Messages of some topics; chunks that do not contain them are skipped by the index.
    pub fn messages_on(&self, topics: &[&str]) -> Messages<'_> {
        self.messages_after(topics, Position::default())
    }

    /// What [`Bag::messages_on`] gave, or would give, of the same topics of this recording after a [`Messages::position`]; chunks that
    /// end before are not read.
    pub fn messages_after(&self, topics: &[&str], position: Position) -> Messages<'_> {
        let wanted = self
            .channels
            .iter()
            .map(|channel| topics.contains(&channel.topic.as_str()))
            .collect();
        Messages::new(self, Some(wanted), position)
    }

    /// Attachments in file order; a damaged one is an error of its own.
    pub fn attachments(&self) -> impl Iterator<Item = Result<Attachment, Damage>> {
        let read = |file: &Contents, location: &AttachmentLocation| {
            let data = file.attachment(location)?;
            let AttachmentLocation {
                name,
                media_type,
                log_time,
                ..
            } = location.clone();
            Ok(Attachment {
                name,
                media_type,
                log_time,
                data,
            })
        };
        self.files.iter().flat_map(move |file| {
            file.attachments
                .iter()
                .map(move |location| read(file, location))
        })
    }

    /// Metadata records in file order: name and table.
    pub fn metadata(&self) -> impl Iterator<Item = (&str, &BTreeMap<String, String>)> {
        self.files
            .iter()
            .flat_map(|file| &file.metadata)
            .map(|record| (record.name.as_str(), &record.metadata))
    }

    /// Losses by topic that the recorder wrote down.
    pub fn losses(&self) -> BTreeMap<String, Losses> {
        let last = self
            .metadata()
            .filter(|(name, _)| *name == LOSSES_RECORD)
            .last();
        let table = last.into_iter().flat_map(|(_, table)| table);
        table
            .filter_map(|(topic, text)| Some((topic.clone(), serde_json::from_str(text).ok()?)))
            .collect()
    }

    pub(crate) fn contents(&self) -> &[Contents] {
        &self.files
    }
}
