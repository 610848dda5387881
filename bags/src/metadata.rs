//! rosbag2's `metadata.yaml`, version 9: what a folder of splits holds.
//!
//! Times in nanoseconds (since 1970 where an instant). Keys and their order are those of `rosbag2_storage`. The file is
//! replaced by rename, so that a reader never sees half of it.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter, Write as _};
use std::io::Write as _;
use std::path::Path;

use crate::channel::{Channel, quoted};
use crate::disk::{Disk, Stream};
use crate::error::Error;
use crate::yaml;

/// Name of the metadata file in the folder of the splits.
pub(crate) const FILE_NAME: &str = "metadata.yaml";

/// One split.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct FileInformation {
    pub(crate) path: String,
    /// First and last log time; `None` without messages.
    pub(crate) bounds: Option<(u64, u64)>,
    pub(crate) message_count: u64,
}

/// The whole recording.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct FolderInformation {
    pub(crate) topics: Vec<(Channel, u64)>,
    pub(crate) files: Vec<FileInformation>,
    pub(crate) custom_data: BTreeMap<String, String>,
    pub(crate) ros_distro: String,
}

impl FolderInformation {
    fn bounds(&self) -> Option<(u64, u64)> {
        self.files
            .iter()
            .filter_map(|file| file.bounds)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// `metadata.yaml`.
    pub(crate) fn to_file_text(&self) -> String {
        let mut text = "rosbag2_bagfile_information:\n".to_owned();
        for line in self.to_string().lines() {
            text.push_str("  ");
            text.push_str(line);
            text.push('\n');
        }
        text
    }

    /// Writes `metadata.yaml` into `folder`, atomically and durably.
    pub(crate) fn write(&self, disk: &dyn Disk, folder: &Path) -> Result<(), Error> {
        let path = folder.join(FILE_NAME);
        let temporary = folder.join(".metadata.yaml.new");
        let attempt = || {
            let mut file = Stream::new(disk.create(&temporary, false)?);
            file.write_all(self.to_file_text().as_bytes())?;
            file.sync()?;
            disk.rename(&temporary, &path)?;
            disk.sync_folder(folder)
        };
        attempt().map_err(|source| Error::io("write the recording's metadata", &path, source))
    }
}

/// The body below `rosbag2_bagfile_information`; also the `serialized_metadata` of the MCAP record `rosbag2`.
impl Display for FolderInformation {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (start, end) = self.bounds().unwrap_or((0, 0));
        let count: u64 = self.files.iter().map(|file| file.message_count).sum();
        writeln!(f, "version: 9\nstorage_identifier: mcap")?;
        writeln!(f, "duration:\n  nanoseconds: {}", end - start)?;
        writeln!(f, "starting_time:\n  nanoseconds_since_epoch: {start}")?;
        writeln!(f, "message_count: {count}")?;
        f.write_str("topics_with_message_count:")?;
        // A channel stands in a file with its first message only; a reader that finds fewer than listed refuses the bag.
        let present = || self.topics.iter().filter(|(_, count)| *count > 0);
        if present().next().is_none() {
            f.write_str(" []")?;
        }
        f.write_char('\n')?;
        for (channel, count) in present() {
            write_topic(f, channel, *count)?;
        }
        f.write_str("compression_format: \"\"\ncompression_mode: \"\"\nrelative_file_paths:")?;
        if self.files.is_empty() {
            f.write_str(" []")?;
        }
        f.write_char('\n')?;
        for file in &self.files {
            writeln!(f, "  - {}", quoted(&file.path))?;
        }
        f.write_str("files:")?;
        if self.files.is_empty() {
            f.write_str(" []")?;
        }
        f.write_char('\n')?;
        for file in &self.files {
            let (start, end) = file.bounds.unwrap_or((0, 0));
            writeln!(f, "  - path: {}", quoted(&file.path))?;
            writeln!(
                f,
                "    starting_time:\n      nanoseconds_since_epoch: {start}"
            )?;
            writeln!(f, "    duration:\n      nanoseconds: {}", end - start)?;
            writeln!(f, "    message_count: {}", file.message_count)?;
        }
        if self.custom_data.is_empty() {
            f.write_str("custom_data: ~\n")?;
        } else {
            f.write_str("custom_data:\n")?;
            for (key, value) in &self.custom_data {
                writeln!(f, "  {}: {}", quoted(key), quoted(value))?;
            }
        }
        writeln!(f, "ros_distro: {}", quoted(&self.ros_distro))
    }
}

fn write_topic(f: &mut Formatter<'_>, channel: &Channel, count: u64) -> fmt::Result {
    writeln!(f, "  - topic_metadata:")?;
    writeln!(f, "      name: {}", quoted(&channel.topic))?;
    writeln!(f, "      type: {}", quoted(&channel.type_name))?;
    writeln!(
        f,
        "      serialization_format: {}",
        quoted(&channel.message_encoding)
    )?;
    writeln!(f, "      offered_qos_profiles:")?;
    for line in channel.qos.to_yaml().lines() {
        writeln!(f, "        {line}")?;
    }
    writeln!(
        f,
        "      type_description_hash: {}",
        quoted(&channel.type_hash)
    )?;
    writeln!(f, "    message_count: {count}")
}

/// What a reader needs of a `metadata.yaml`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Folder {
    /// Names of the files, in order.
    pub(crate) relative_file_paths: Vec<String>,
    /// What each message is compressed by, if it is.
    pub(crate) compressed_messages: Option<String>,
}

/// Reads a `metadata.yaml`; `None` if the text is not one.
pub(crate) fn read(text: &str) -> Option<Folder> {
    let documents = yaml::load(text)?;
    let body = &documents.first()?["rosbag2_bagfile_information"];
    let paths = body["relative_file_paths"].as_vec()?;
    let word = |key: &str| body[key].as_str().unwrap_or_default();
    let by_message = word("compression_mode").eq_ignore_ascii_case("message");
    Some(Folder {
        relative_file_paths: paths
            .iter()
            .map(|path| path.as_str().map(str::to_owned))
            .collect::<Option<_>>()?,
        compressed_messages: by_message.then(|| word("compression_format").to_owned()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::Qos;

    fn folder() -> FolderInformation {
        FolderInformation {
            topics: vec![(
                Channel::new(
                    "/a: b",
                    "std_msgs/msg/String",
                    "string data",
                    "RIHS01_ab",
                    Qos::latched(),
                ),
                3,
            )],
            files: vec![
                FileInformation {
                    path: "x_0.mcap".to_owned(),
                    bounds: Some((5, 9)),
                    message_count: 1,
                },
                FileInformation {
                    path: "x_1.mcap".to_owned(),
                    bounds: Some((7, 30)),
                    message_count: 2,
                },
                FileInformation {
                    path: "x_2.mcap".to_owned(),
                    bounds: None,
                    message_count: 0,
                },
            ],
            custom_data: BTreeMap::from([("k".to_owned(), "v \"w\"".to_owned())]),
            ros_distro: "jazzy".to_owned(),
        }
    }

    #[test]
    fn a_yaml_parser_finds_every_key_of_version_9() {
        let documents = yaml::load(&folder().to_file_text()).unwrap();
        let body = &documents[0]["rosbag2_bagfile_information"];
        assert_eq!(body["version"].as_i64(), Some(9));
        assert_eq!(body["duration"]["nanoseconds"].as_i64(), Some(25));
        assert_eq!(
            body["starting_time"]["nanoseconds_since_epoch"].as_i64(),
            Some(5)
        );
        assert_eq!(body["message_count"].as_i64(), Some(3));
        let topic = &body["topics_with_message_count"][0];
        assert_eq!(topic["topic_metadata"]["name"].as_str(), Some("/a: b"));
        assert_eq!(
            topic["topic_metadata"]["offered_qos_profiles"][0]["durability"].as_str(),
            Some("transient_local")
        );
        assert_eq!(
            topic["topic_metadata"]["offered_qos_profiles"][0]["lifespan"]["sec"].as_i64(),
            Some(9223372036)
        );
        assert_eq!(topic["message_count"].as_i64(), Some(3));
        assert_eq!(
            body["files"][1]["duration"]["nanoseconds"].as_i64(),
            Some(23)
        );
        assert_eq!(body["custom_data"]["k"].as_str(), Some("v \"w\""));
        assert_eq!(body["compression_mode"].as_str(), Some(""));
        assert_eq!(
            read(&folder().to_file_text()).unwrap().relative_file_paths,
            ["x_0.mcap", "x_1.mcap", "x_2.mcap"].map(str::to_owned)
        );
    }

    #[test]
    fn an_empty_recording_is_described_too() {
        let documents = yaml::load(&FolderInformation::default().to_file_text()).unwrap();
        let body = &documents[0]["rosbag2_bagfile_information"];
        assert_eq!(
            body["topics_with_message_count"].as_vec().map(Vec::len),
            Some(0)
        );
        assert!(body["custom_data"].is_null());
    }
}
