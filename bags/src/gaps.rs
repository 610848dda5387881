//! Which messages a recording lacks, by topic and number, as far as later evidence shows.
//!
//! Publishers number what they publish on a topic. A number that is missing between two others was published and not
//! recorded. What a recorder lost when it died stands after its last number, where only a recording begun later can show it: of
//! the same publisher, its first number bounds the loss. A publisher that was restarted counts from 1 again, which shows by
//! a lower number published later; numbers are compared within one life of it. Messages before the first number, and
//! after the last without a later recording, are not reported.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::reader::Bag;
use crate::split::LIBRARY;

/// Evidence that messages are missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LossEvidence {
    /// A later message of the same recording.
    SameRecording,
    /// The first message of the recording that was begun later.
    LaterRecording,
}

/// Messages that were published and are not there.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gap {
    /// Topic name.
    pub topic: String,
    /// Number of the first.
    pub first: u32,
    /// Number of the last.
    pub last: u32,
    /// The evidence.
    pub evidence: LossEvidence,
}

impl std::fmt::Display for Gap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let by = match self.evidence {
            LossEvidence::SameRecording => "later numbers are there",
            LossEvidence::LaterRecording => "the later recording begins after them",
        };
        let Self {
            topic, first, last, ..
        } = self;
        if first == last {
            write!(f, "{topic}: message {first} is missing: {by}")
        } else {
            write!(f, "{topic}: messages {first} to {last} are missing: {by}")
        }
    }
}

/// Numbers of one life of a publisher, each with its publish time.
#[derive(Debug, Default)]
struct Life {
    numbers: BTreeMap<u32, u64>,
    /// Latest publish time.
    latest: u64,
}

impl Life {
    /// True where a message cannot be of this life: a number again at another time, or a lower one published later.
    fn ends_before(&self, number: u32, published: u64) -> bool {
        match self.numbers.get(&number) {
            Some(known) => *known != published,
            None => self.last().is_some_and(|last| number < last) && published > self.latest,
        }
    }

    fn add(&mut self, number: u32, published: u64) {
        self.numbers.insert(number, published);
        self.latest = self.latest.max(published);
    }

    fn last(&self) -> Option<u32> {
        self.numbers.last_key_value().map(|(number, _)| *number)
    }
}

impl Bag {
    /// Lives of the publishers of each topic, in order.
    fn lives(&self) -> BTreeMap<String, Vec<Life>> {
        let mut lives: BTreeMap<String, Vec<Life>> = BTreeMap::new();
        for channel in self.channels() {
            lives.entry(channel.topic.clone()).or_default();
        }
        // Damage is reported by the bag itself.
        for message in self.messages().flatten() {
            let of_topic = lives.entry(message.channel.topic.clone()).or_default();
            let (number, published) = (message.sequence, message.publish_time);
            if of_topic
                .last()
                .is_none_or(|life| life.ends_before(number, published))
            {
                of_topic.push(Life::default());
            }
            if let Some(life) = of_topic.last_mut() {
                life.add(number, published);
            }
        }
        lives
    }

    /// The messages that are missing, in the order of topics and numbers: between those that are there, and where `later`
    /// is a recording of the same session begun after this one, between both.
    ///
    /// None in a recording that another program wrote: what it numbers is not known.
    pub fn gaps(&self, later: Option<&Self>) -> Vec<Gap> {
        if !self.library().starts_with(LIBRARY) {
            return Vec::new();
        }
        let after = later.map(Self::lives).unwrap_or_default();
        let mut gaps = Vec::new();
        for (topic, lives) in self.lives() {
            let mut gap = |first: u32, last: u32, evidence| {
                let topic = topic.clone();
                gaps.push(Gap {
                    topic,
                    first,
                    last,
                    evidence,
                });
            };
            for life in &lives {
                let numbers: Vec<u32> = life.numbers.keys().copied().collect();
                for pair in numbers.windows(2) {
                    if pair[1] > pair[0] + 1 {
                        gap(pair[0] + 1, pair[1] - 1, LossEvidence::SameRecording);
                    }
                }
            }
            let Some(next) = after.get(&topic).and_then(|lives| lives.first()) else {
                continue;
            };
            let (known, latest) = lives
                .last()
                .map_or((None, 0), |life| (life.last(), life.latest));
            let fresh = next
                .numbers
                .iter()
                .find(|(_, published)| **published > latest);
            let begin = known.map_or(0, |last| last.saturating_add(1));
            if let Some((&first, _)) = fresh
                && first > begin
            {
                gap(begin, first - 1, LossEvidence::LaterRecording);
            }
        }
        gaps
    }
}
