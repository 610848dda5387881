//! What a cell publishes, as lines of JSON on a pipe: for programs that hand it on in another protocol.
//!
//! ```text
//! bus or recording --> probecell stream TOPIC... --> lines --> probecell-opcua, probecell-mtconnect, probecell-sparkplug, yours
//! ```
//!
//! The reader needs neither the bus nor a key of the cell: [`Stream::start`] runs `probecell stream` and reads its lines.
//!
//! | line | meaning |
//! |---|---|
//! | `{"cell":{"name":"turn_mill","version":"0.1.0","is_simulated":true}}` | the first: whose messages follow |
//! | `{"message":{"topic":"verdicts","type":"probecell_msgs/msg/Verdict","cdr":"AAEAAA..."}}` | a message: its topic below the name of the cell, its ROS 2 type, its CDR bytes in base64 (RFC 4648) |
//! | `{"present":{"is_present":true,"at":1767225600000000000}}` | whether the state of the machine has a publisher, at a time in ns since 1970; of a running cell, five times a second |
//! | `{"complete":{}}` | all messages that a recording holds have been sent; of a running cell, right after the first line |
//!
//! ```
//! use terminal::cell_stream::{Line, Message};
//! use probecell_msgs::Verdict;
//!
//! let verdict = Verdict { feature_id: "D1".to_owned(), ..Verdict::default() };
//! let line = Line::Message(Message::new("verdicts", &verdict));
//! let Ok(Line::Message(read)) = Line::read(&line.to_string()) else { unreachable!() };
//! assert_eq!(read.decode::<Verdict>().unwrap(), verdict);
//! ```

mod reader;

use std::fmt;

use base64::{Engine, prelude::BASE64_STANDARD};
use probecell_msgs::{CdrError, from_cdr, to_cdr};
use serde::{Deserialize, Serialize};

pub use reader::{
    DEFAULT_CELL, Following, PROGRAM_VARIABLE, ROS_ARGUMENTS_VARIABLE, Source, Stream,
};

/// One line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Line {
    /// Whose messages follow.
    Cell(Cell),
    /// A message.
    Message(Message),
    /// Whether the state of the machine has a publisher.
    Present(Present),
    /// What the source held at the start has been sent.
    Complete {},
}

/// A cell.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cell {
    /// Its name.
    pub name: String,
    /// Version of the program that measures.
    pub version: String,
    /// Its machine is simulated; `None`: not known.
    pub is_simulated: Option<bool>,
}

/// A message of the cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Message {
    /// Topic, without the name of the cell.
    pub topic: String,
    /// ROS 2 type, such as `probecell_msgs/msg/Verdict`.
    #[serde(rename = "type")]
    pub message_type: String,
    /// CDR bytes with their header.
    #[serde(with = "base64_text")]
    pub cdr: Vec<u8>,
}

/// Presence of the cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Present {
    /// The state of the machine has a publisher.
    pub is_present: bool,
    /// ns since 1970, of the clock of the cell.
    pub at: i64,
}

impl Message {
    /// A message on a topic.
    pub fn new<M: probecell_msgs::Message>(topic: &str, message: &M) -> Self {
        Self {
            topic: topic.to_owned(),
            message_type: M::TYPE.name.to_owned(),
            cdr: to_cdr(message),
        }
    }

    /// The message, as its type.
    ///
    /// # Errors
    /// The bytes are not of this type.
    pub fn decode<M: probecell_msgs::Message>(&self) -> Result<M, CdrError> {
        from_cdr(&self.cdr)
    }
}

impl Line {
    /// A line, with or without its end.
    ///
    /// # Errors
    /// It is none of this stream.
    pub fn read(line: &str) -> serde_json::Result<Self> {
        serde_json::from_str(line)
    }
}

impl fmt::Display for Line {
    /// Without an end of line.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = serde_json::to_string(self).map_err(|_| fmt::Error)?;
        formatter.write_str(&text)
    }
}

mod base64_text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use super::{BASE64_STANDARD, Engine};

    pub(super) fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&BASE64_STANDARD.encode(bytes))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(deserializer)?;
        BASE64_STANDARD.decode(text).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use probecell_msgs::{FeatureResult, Verdict};

    use super::*;

    #[test]
    fn every_line_is_read_back_as_it_was() {
        let result = FeatureResult {
            feature_id: "Ø 20 \"h6\"\n\u{202e}".to_owned(),
            size: f64::NAN,
            size_deviation: f64::NEG_INFINITY,
            standard_uncertainty: 0.1 + 0.2,
            ..FeatureResult::default()
        };
        let message = Message::new("feature_results", &result);
        assert_eq!(message.message_type, "probecell_msgs/msg/FeatureResult");
        for line in [
            Line::Cell(Cell {
                name: "turn_mill".to_owned(),
                version: "0.1.0".to_owned(),
                is_simulated: None,
            }),
            Line::Message(message.clone()),
            Line::Present(Present {
                is_present: true,
                at: i64::MAX,
            }),
            Line::Complete {},
        ] {
            let text = line.to_string();
            assert!(!text.contains('\n'), "{text}");
            assert_eq!(Line::read(&text).expect("a line"), line);
            assert_eq!(Line::read(&format!("{text}\n")).expect("a line"), line);
        }
        // To the bit, which JSON numbers could not do.
        let read: FeatureResult = message.decode().expect("its type");
        assert!(read.size.is_nan() && read.size_deviation == f64::NEG_INFINITY);
        assert_eq!(
            read.standard_uncertainty.to_bits(),
            (0.1f64 + 0.2).to_bits()
        );
        assert_eq!(read.feature_id, result.feature_id);
    }

    #[test]
    fn the_lines_are_those_of_the_table_above() {
        let cell = r#"{"cell":{"name":"turn_mill","version":"0.1.0","is_simulated":true}}"#;
        let present = r#"{"present":{"is_present":true,"at":1767225600000000000}}"#;
        for text in [cell, present, r#"{"complete":{}}"#] {
            assert_eq!(Line::read(text).expect("a line").to_string(), text);
        }
    }

    #[test]
    fn what_is_no_line_or_no_message_of_its_type_is_an_error() {
        for text in [
            "",
            "{}",
            "[]",
            r#"{"verdict":{}}"#,
            r#"{"message":{"topic":"verdicts","type":"probecell_msgs/msg/Verdict","cdr":"?"}}"#,
            r#"{"message":{"topic":"verdicts"}}"#,
            r#"{"complete":{}} {"complete":{}}"#,
        ] {
            assert!(Line::read(text).is_err(), "{text}");
        }
        let mut message = Message::new("verdicts", &Verdict::default());
        message.cdr.truncate(7);
        assert!(message.decode::<Verdict>().is_err());
    }
}
