//! What a recording holds, for people and scripts.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::channel::Qos;
use crate::damage::Damage;
use crate::reader::Bag;
use crate::recorder::{LOSSES_RECORD, Losses, ROSBAG2_RECORD};

/// One file of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileInfo {
    /// Where it is.
    pub path: PathBuf,
    /// Its size, bytes.
    pub bytes: u64,
    /// Messages in it, repeats of latched ones included.
    pub messages: u64,
}

/// One channel of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicInfo {
    /// Topic name.
    pub topic: String,
    /// Type name, `package/msg/Type`.
    pub type_name: String,
    /// `RIHS01_…`, empty if unknown.
    pub type_hash: String,
    /// Quality of service offered.
    pub qos: Qos,
    /// Messages, repeats of latched ones included.
    pub messages: u64,
    /// What the recorder knows to be missing.
    pub losses: Losses,
}

/// An attachment, its data apart.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct AttachmentInfo {
    /// Name.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// Size of its data, bytes.
    pub bytes: u64,
}

/// A recording described.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Info {
    /// What was opened.
    pub path: PathBuf,
    /// Writer, as it names itself.
    pub library: String,
    /// First log time, ns since 1970; 0 without messages.
    pub start_ns: u64,
    /// Last log time less first, ns.
    pub duration_ns: u64,
    /// Messages, repeats of latched ones included.
    pub messages: u64,
    /// Files in reading order.
    pub files: Vec<FileInfo>,
    /// Channels in order of first appearance.
    pub topics: Vec<TopicInfo>,
    /// Attachments.
    pub attachments: Vec<AttachmentInfo>,
    /// Named tables that the application wrote, those of this crate and of rosbag2 apart; the last of a name counts.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Damage found.
    pub damage: Vec<Damage>,
}

impl Bag {
    /// Describes the recording. `verify` reads every chunk to find damage that the index does not show.
    pub fn info(&self, verify: bool) -> Info {
        let losses = self.losses();
        let (start, end) = self.bounds().unwrap_or((0, 0));
        let topics: Vec<TopicInfo> = self
            .channels()
            .iter()
            .zip(self.counts())
            .map(|(channel, messages)| TopicInfo {
                topic: channel.topic.clone(),
                type_name: channel.type_name.clone(),
                type_hash: channel.type_hash.clone(),
                qos: channel.qos,
                messages,
                losses: losses.get(&channel.topic).copied().unwrap_or_default(),
            })
            .collect();
        let files = self.contents();
        Info {
            path: self.path().to_owned(),
            library: self.library().to_owned(),
            start_ns: start,
            duration_ns: end.saturating_sub(start),
            messages: topics.iter().map(|topic| topic.messages).sum(),
            files: files
                .iter()
                .map(|file| FileInfo {
                    path: file.path.clone(),
                    bytes: file.length,
                    messages: file.counts.values().sum(),
                })
                .collect(),
            topics,
            attachments: files
                .iter()
                .flat_map(|file| &file.attachments)
                .map(|location| AttachmentInfo {
                    name: location.name.clone(),
                    media_type: location.media_type.clone(),
                    bytes: location.size,
                })
                .collect(),
            metadata: self
                .metadata()
                .filter(|(name, _)| ![LOSSES_RECORD, ROSBAG2_RECORD].contains(name))
                .map(|(name, table)| (name.to_owned(), table.clone()))
                .collect(),
            damage: if verify { self.verify() } else { self.damage() },
        }
    }
}
