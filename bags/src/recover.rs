//! Makes a complete, indexed recording from the readable part of a damaged one, and reports what was lost.
//!
//! Channels, schemas, attachments and tables are carried over word for word; messages keep their order in the file,
//! times and numbers. Nothing is written over: the original stays as it is.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::records::Metadata;
use serde::{Deserialize, Serialize};

use crate::channel::Channel;
use crate::container::Contents;
use crate::damage::Damage;
use crate::disk::SystemDisk;
use crate::error::Error;
use crate::gaps::Gap;
use crate::metadata::FolderInformation;
use crate::reader::Bag;
use crate::split::{ChunkOptions, SplitFile};

/// What was saved and what was not.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recovery {
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Messages saved, repeats of latched ones included.
    pub messages: u64,
    /// Attachments saved.
    pub attachments: u64,
    /// Messages that are missing, by number.
    pub gaps: Vec<Gap>,
    /// What is wrong with the original.
    pub damage: Vec<Damage>,
}

impl Recovery {
    /// Whether messages of the original may be missing.
    pub fn lost_messages(&self) -> bool {
        self.damage
            .iter()
            .any(|damage| damage.kind.loses_messages())
            || !self.gaps.is_empty()
    }
}

/// Name of the MCAP metadata record with the missing messages: topic to ranges of their numbers.
const GAPS_RECORD: &str = "probecell_gaps";

/// Writes what can be read of `from` (a file or folder) into the new folder `to`, with its `metadata.yaml` and a table of
/// what is missing; a recording begun later shows what was lost at the end.
///
/// # Errors
/// Nothing readable, a folder that exists, or what the system says.
pub fn recover(
    from: impl AsRef<Path>,
    to: impl AsRef<Path>,
    later: Option<&Path>,
) -> Result<Recovery, Error> {
    let (from, to) = (from.as_ref(), to.as_ref());
    let bag = Bag::open(from)?;
    let later = later.map(Bag::open).transpose()?;
    if to.exists() {
        return Err(Error::Exists {
            path: to.to_owned(),
        });
    }
    std::fs::create_dir_all(to).map_err(|source| Error::io("make the folder", to, source))?;
    let name = to
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let chunks = ChunkOptions {
        bytes: 1 << 20,
        zstd: true,
        zstd_level: 0,
        data_crc: true,
    };
    let mut recovery = Recovery {
        files: Vec::new(),
        messages: 0,
        attachments: 0,
        gaps: bag.gaps(later.as_ref()),
        damage: bag.damage(),
    };
    let mut information = FolderInformation {
        ros_distro: "jazzy".to_owned(),
        ..FolderInformation::default()
    };
    let mut counts: BTreeMap<Channel, u64> = BTreeMap::new();
    for (number, contents) in bag.contents().iter().enumerate() {
        let path = to.join(format!("{name}_{number}.mcap"));
        let mut split = SplitFile::create(&SystemDisk, &path, &chunks, false)?;
        copy(contents, &mut split, &mut recovery, &mut counts)?;
        if recovery.damage.is_empty() {
            recovery.damage.extend(contents.contradicted_checksum());
        }
        if number + 1 == bag.contents().len() && !recovery.gaps.is_empty() {
            split.metadata(&gaps_record(&recovery.gaps))?;
        }
        let mut so_far = information.clone();
        so_far.topics = counts
            .iter()
            .map(|(channel, count)| (channel.clone(), *count))
            .collect();
        so_far.files.push(split.information.clone());
        split.metadata(&Metadata {
            name: "rosbag2".to_owned(),
            metadata: BTreeMap::from([("serialized_metadata".to_owned(), so_far.to_string())]),
        })?;
        let (file, ..) = split.finish()?;
        recovery.messages += file.message_count;
        recovery.files.push(path);
        information.files.push(file);
    }
    information.topics = counts.into_iter().collect();
    information.write(&SystemDisk, to)?;
    Ok(recovery)
}

fn gaps_record(gaps: &[Gap]) -> Metadata {
    let mut ranges: BTreeMap<String, String> = BTreeMap::new();
    for gap in gaps {
        let range = if gap.first == gap.last {
            gap.first.to_string()
        } else {
            format!("{} to {}", gap.first, gap.last)
        };
        ranges
            .entry(gap.topic.clone())
            .and_modify(|known| *known = format!("{known}, {range}"))
            .or_insert(range);
    }
    Metadata {
        name: GAPS_RECORD.to_owned(),
        metadata: ranges,
    }
}

fn copy(
    contents: &Contents,
    split: &mut SplitFile,
    recovery: &mut Recovery,
    counts: &mut BTreeMap<Channel, u64>,
) -> Result<(), Error> {
    for metadata in contents
        .metadata
        .iter()
        .filter(|metadata| metadata.name != "rosbag2")
    {
        split.metadata(metadata)?;
    }
    for location in &contents.attachments {
        match contents.attachment(location) {
            Ok(data) => {
                split.attach(
                    location.log_time,
                    &location.name,
                    &location.media_type,
                    &data,
                )?;
                recovery.attachments += 1;
            }
            Err(damage) => recovery.damage.push(damage),
        }
    }
    let mut ids = BTreeMap::new();
    for (id, channel) in &contents.channels {
        ids.insert(*id, (split.copy_channel(channel)?, 0));
    }
    for block in &contents.blocks {
        let mut messages = Vec::new();
        let records = match contents.walk(block, |message| messages.push(message)) {
            Ok(records) => records,
            Err(damage) => {
                recovery.damage.push(damage);
                continue;
            }
        };
        for message in messages {
            if let Some((id, count)) = ids.get_mut(&message.channel) {
                let times = (message.log_time, message.publish_time);
                split.write_to(
                    *id,
                    message.sequence,
                    times,
                    &records[message.start..message.end],
                )?;
                *count += 1;
            }
        }
    }
    for (id, channel) in &contents.channels {
        *counts.entry(Channel::from_mcap(channel)).or_default() +=
            ids.get(id).map_or(0, |(_, count)| *count);
    }
    Ok(())
}
