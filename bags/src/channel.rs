//! A recorded topic: its name, message type with full definition, type hash and quality of service.
//!
//! Quality of service is written as rosbag2 does since metadata version 9 (string enums); version 8 and older, which
//! have the integers of `rmw`, are read as well.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use probecell_msgs::migration::Migration;
use probecell_msgs::{MessageType, by_name};
use serde::{Deserialize, Serialize};
use yaml_rust2::Yaml;

use crate::yaml;

/// Samples kept of a transient local topic that offers to keep all: memory stays bounded.
const LATCHED_LIMIT: usize = 1000;

/// Whether lost samples are sent again.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Reliability {
    /// Lost samples are sent again.
    #[default]
    Reliable,
    /// Lost samples stay lost.
    BestEffort,
}

/// Whether a late subscriber gets samples from before it joined.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Durability {
    /// It does not.
    #[default]
    Volatile,
    /// It gets the last samples ("latched"); such topics are repeated at the start of every split.
    TransientLocal,
}

/// How many samples are kept for slow or late subscribers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum History {
    /// The last `n`.
    KeepLast(u32),
    /// All of them.
    KeepAll,
}

impl Default for History {
    fn default() -> Self {
        Self::KeepLast(10)
    }
}

/// Quality of service that the publisher offers; deadline, lifespan and liveliness are left at their defaults.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
pub struct Qos {
    /// Whether lost samples are sent again.
    pub reliability: Reliability,
    /// Whether late subscribers get earlier samples.
    pub durability: Durability,
    /// How many samples are kept.
    pub history: History,
}

impl Qos {
    /// Reliable, transient local, depth 1: a topic that holds a state.
    pub fn latched() -> Self {
        Self {
            durability: Durability::TransientLocal,
            history: History::KeepLast(1),
            ..Self::default()
        }
    }

    /// Samples to repeat at the start of a split: 0 for a volatile topic.
    pub(crate) fn latched_depth(self) -> usize {
        match (self.durability, self.history) {
            (Durability::Volatile, _) => 0,
            (Durability::TransientLocal, History::KeepLast(depth)) => depth.max(1) as usize,
            (Durability::TransientLocal, History::KeepAll) => LATCHED_LIMIT,
        }
    }

    /// The `offered_qos_profiles` text of one publisher.
    pub fn to_yaml(self) -> String {
        const INFINITE: &str = "    sec: 9223372036\n    nsec: 854775807\n";
        let (history, depth) = match self.history {
            History::KeepLast(depth) => ("keep_last", depth),
            History::KeepAll => ("keep_all", 0),
        };
        let reliability = match self.reliability {
            Reliability::Reliable => "reliable",
            Reliability::BestEffort => "best_effort",
        };
        let durability = match self.durability {
            Durability::Volatile => "volatile",
            Durability::TransientLocal => "transient_local",
        };
        format!(
            "- history: {history}\n  depth: {depth}\n  reliability: {reliability}\n  durability: {durability}\n  \
             deadline:\n{INFINITE}  lifespan:\n{INFINITE}  liveliness: automatic\n  \
             liveliness_lease_duration:\n{INFINITE}  avoid_ros_namespace_conventions: false\n"
        )
    }

    /// Reads `offered_qos_profiles` of any rosbag2 version. Of several publishers the strongest durability counts, so
    /// that a latched topic is not missed. Unreadable or empty text gives `None`.
    pub fn from_yaml(text: &str) -> Option<Self> {
        let documents = yaml::load(text)?;
        let profiles = documents.first()?.as_vec()?;
        profiles
            .iter()
            .map(Self::from_profile)
            .max_by_key(|qos| qos.durability)
    }

    fn from_profile(profile: &Yaml) -> Self {
        let is = |key: &str, name: &str, number: i64| {
            profile[key].as_str() == Some(name) || profile[key].as_i64() == Some(number)
        };
        let depth = profile["depth"]
            .as_i64()
            .and_then(|depth| u32::try_from(depth).ok())
            .unwrap_or(10);
        Self {
            reliability: if is("reliability", "best_effort", 2) {
                Reliability::BestEffort
            } else {
                Reliability::Reliable
            },
            durability: if is("durability", "transient_local", 1) {
                Durability::TransientLocal
            } else {
                Durability::Volatile
            },
            history: if is("history", "keep_all", 2) {
                History::KeepAll
            } else {
                History::KeepLast(depth)
            },
        }
    }
}

/// A topic as it is recorded. Any type can be recorded, known to this project or not.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Channel {
    /// Full topic name with its leading slash.
    pub topic: String,
    /// Type name, `package/msg/Type`; empty if the channel has no schema.
    pub type_name: String,
    /// Full `ros2msg` definition: the type's own text, then each dependency after a line of 80 `=` and `MSG: package/Type`.
    pub definition: String,
    /// `RIHS01_` and 64 hexadecimal digits; empty if unknown.
    pub type_hash: String,
    /// Quality of service the publisher offers.
    pub qos: Qos,
    /// Encoding of the payload: `cdr` for everything ROS 2.
    pub message_encoding: String,
}

impl Channel {
    /// A `cdr` channel.
    pub fn new(
        topic: impl Into<String>,
        type_name: impl Into<String>,
        definition: impl Into<String>,
        type_hash: impl Into<String>,
        qos: Qos,
    ) -> Self {
        Self {
            topic: topic.into(),
            type_name: type_name.into(),
            definition: definition.into(),
            type_hash: type_hash.into(),
            qos,
            message_encoding: "cdr".to_owned(),
        }
    }

    /// Becomes a channel of this version of its type, where it is of another one; gives how its messages become so, where their
    /// bytes change. A type that cannot be read as that of this version stays as it is.
    pub(crate) fn migrated(&mut self) -> Option<Migration> {
        let now = by_name(&self.type_name)?;
        if self.type_hash == now.type_hash
            || self.definition.is_empty()
            || self.message_encoding != "cdr"
        {
            return None;
        }
        let migration = Migration::new(&self.definition, now).ok()?;
        now.definition.clone_into(&mut self.definition);
        now.type_hash.clone_into(&mut self.type_hash);
        (!migration.is_identity()).then_some(migration)
    }

    /// A channel of a type of the project's messages.
    pub fn of(topic: impl Into<String>, message_type: &MessageType, qos: Qos) -> Self {
        Self::new(
            topic,
            message_type.name,
            message_type.definition,
            message_type.type_hash,
            qos,
        )
    }

    /// Metadata of the MCAP channel record, as rosbag2 writes it.
    pub(crate) fn mcap_metadata(&self) -> BTreeMap<String, String> {
        let mut metadata = BTreeMap::new();
        metadata.insert("offered_qos_profiles".to_owned(), self.qos.to_yaml());
        metadata.insert("topic_type_hash".to_owned(), self.type_hash.clone());
        metadata
    }

    pub(crate) fn from_mcap(channel: &mcap::Channel<'_>) -> Self {
        let text = |key: &str| channel.metadata.get(key).map_or("", String::as_str);
        let (type_name, definition) =
            channel
                .schema
                .as_ref()
                .map_or((String::new(), String::new()), |schema| {
                    (
                        schema.name.clone(),
                        String::from_utf8_lossy(&schema.data).into_owned(),
                    )
                });
        Self {
            topic: channel.topic.clone(),
            type_name,
            definition,
            type_hash: text("topic_type_hash").to_owned(),
            qos: Qos::from_yaml(text("offered_qos_profiles")).unwrap_or_default(),
            message_encoding: channel.message_encoding.clone(),
        }
    }
}

/// A YAML double-quoted scalar (every JSON string is one).
pub(crate) fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for character in text.chars() {
        match character {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            control if (control as u32) < 0x20 || control as u32 == 0x7f => {
                // Writing into a String cannot fail.
                write!(out, "\\x{:02x}", control as u32).unwrap_or_default();
            }
            other => out.push(other),
        }
    }
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quality_of_service_survives_its_yaml() {
        for reliability in [Reliability::Reliable, Reliability::BestEffort] {
            for durability in [Durability::Volatile, Durability::TransientLocal] {
                for history in [
                    History::KeepLast(1),
                    History::KeepLast(1000),
                    History::KeepAll,
                ] {
                    let qos = Qos {
                        reliability,
                        durability,
                        history,
                    };
                    assert_eq!(Qos::from_yaml(&qos.to_yaml()), Some(qos));
                }
            }
        }
    }

    #[test]
    fn integer_enums_of_older_recorders_are_read() {
        let text = "- history: 1\n  depth: 7\n  reliability: 2\n  durability: 2\n- history: 2\n  depth: 0\n  \
                    reliability: 1\n  durability: 1\n";
        let qos = Qos::from_yaml(text).unwrap();
        assert_eq!(qos.durability, Durability::TransientLocal);
        assert_eq!(qos.history, History::KeepAll);
        assert_eq!(Qos::from_yaml(""), None);
        assert_eq!(Qos::from_yaml("{{{"), None);
    }

    #[test]
    fn quoted_text_is_read_back_by_a_yaml_parser() {
        let nasty = "a \"b\" \\ c\nd: - # \u{1}é";
        let documents = yaml::load(&quoted(nasty)).unwrap();
        assert_eq!(documents[0].as_str(), Some(nasty));
    }
}
