//! Messages as the structs of `probecell_msgs`.

use std::marker::PhantomData;

use probecell_msgs::{Message, from_cdr};

use super::{Bag, Messages, Recorded};
use crate::error::Error;

/// First bytes of what zstd has compressed; no encapsulation header of CDR begins so.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// A decoded message with its position in the recording.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Stamped<T> {
    /// Publication number, low 32 bits.
    pub sequence: u32,
    /// Reception, ns since 1970.
    pub log_time: u64,
    /// Source time, ns since 1970.
    pub publish_time: u64,
    /// The message.
    pub message: T,
}

/// Decoded messages of one topic, in order of log time. Reading continues after an `Err`.
#[derive(Debug)]
pub struct Typed<'a, T> {
    bag: &'a Bag,
    messages: Messages<'a>,
    marker: PhantomData<T>,
}

impl Bag {
    /// Messages of a topic as `T`. Fails if the topic is not there or carries another type, by name or by type hash.
    ///
    /// # Errors
    /// No topic of that name, or messages of another type on it.
    pub fn typed<T: Message>(&self, topic: &str) -> Result<Typed<'_, T>, Error> {
        let mut there = false;
        for channel in self.channels_of(topic) {
            there = true;
            let of_hash = |name: &str, hash: &str| format!("{name} ({hash})");
            let other = |found, expected| {
                Err(Error::OtherType {
                    topic: topic.to_owned(),
                    found,
                    expected,
                    path: self.path.clone(),
                })
            };
            if channel.type_name != T::TYPE.name || channel.message_encoding != "cdr" {
                let found = format!("{} as {}", channel.type_name, channel.message_encoding);
                return other(found, format!("{} as cdr", T::TYPE.name));
            }
            if !channel.type_hash.is_empty() && channel.type_hash != T::TYPE.type_hash {
                return other(
                    of_hash(&channel.type_name, &channel.type_hash),
                    of_hash(T::TYPE.name, T::TYPE.type_hash),
                );
            }
        }
        if !there {
            return Err(Error::NoTopic {
                topic: topic.to_owned(),
                path: self.path.clone(),
            });
        }
        Ok(Typed {
            bag: self,
            messages: self.messages_on(&[topic]),
            marker: PhantomData,
        })
    }
}

impl<T> Typed<'_, T> {
    /// Those received from one log time to another, both included; chunks that end before or begin after are not read.
    #[must_use]
    pub fn during(mut self, times: (u64, u64)) -> Self {
        self.messages = self.messages.during(times);
        self
    }
}

impl<T: Message> Iterator for Typed<'_, T> {
    type Item = Result<Stamped<T>, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        let Recorded {
            channel,
            sequence,
            log_time,
            publish_time,
            payload,
        } = match self.messages.next()? {
            Ok(message) => message,
            Err(damage) => return Some(Err(damage.into())),
        };
        Some(match from_cdr(&payload) {
            Ok(message) => Ok(Stamped {
                sequence,
                log_time,
                publish_time,
                message,
            }),
            Err(reason) => Err(Error::Decode {
                topic: channel.topic.clone(),
                sequence,
                expected: T::TYPE.name.to_owned(),
                reason: if payload.starts_with(&ZSTD) {
                    "it is compressed by zstd (rosbag2's compression mode MESSAGE), which `ros2 bag convert` undoes".to_owned()
                } else {
                    reason.to_string()
                },
                path: self.bag.path.clone(),
            }),
        })
    }
}
