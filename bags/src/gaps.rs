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

/// Numbers of one life of a publisher.
#[derive(Debug, Default)]
struct Life {
    /// First and last number of each unbroken run, in order: of a whole recording there is one.
    runs: Vec<[u32; 2]>,
    /// Latest publish time.
    latest: u64,
    /// Lowest number that was published after the time that was asked for.
    fresh: Option<u32>,
}

impl Life {
    /// True where a message cannot be of this life: it has a number that was there, or a lower one, and was published later.
    fn ends_before(&self, number: u32, published: u64) -> bool {
        self.last().is_some_and(|last| number <= last) && published > self.latest
    }

    fn add(&mut self, number: u32, published: u64, since: u64) {
        self.latest = self.latest.max(published);
        if published > since && self.fresh.is_none_or(|fresh| number < fresh) {
            self.fresh = Some(number);
        }
        // The runs that begin at this number or before.
        let before = self.runs.partition_point(|run| run[0] <= number);
        let (left, right) = self.runs.split_at_mut(before);
        let left = left
            .last_mut()
            .filter(|run| number <= run[1].saturating_add(1));
        let right = right
            .first_mut()
            .filter(|run| run[0] == number.saturating_add(1));
        match (left, right) {
            (Some(left), Some(right)) if number > left[1] => {
                left[1] = right[1];
                self.runs.remove(before);
            }
            (Some(left), _) => left[1] = left[1].max(number),
            (None, Some(right)) => right[0] = number,
            (None, None) => self.runs.insert(before, [number; 2]),
        }
    }

    fn last(&self) -> Option<u32> {
        self.runs.last().map(|run| run[1])
    }
}

impl Bag {
    /// Lives of the publishers of each topic, in order. `since`: publish time of each topic after which its first number is sought.
    fn lives(&self, since: &BTreeMap<String, u64>) -> BTreeMap<String, Vec<Life>> {
        let mut lives: BTreeMap<String, Vec<Life>> = BTreeMap::new();
        for channel in self.channels() {
            lives.entry(channel.topic.clone()).or_default();
        }
        // Damage is reported by the bag itself.
        for message in self.messages().flatten() {
            let topic = &message.channel.topic;
            let Some(of_topic) = lives.get_mut(topic) else {
                continue;
            };
            let (number, published) = (message.sequence, message.publish_time);
            if of_topic
                .last()
                .is_none_or(|life| life.ends_before(number, published))
            {
                of_topic.push(Life::default());
            }
            if let Some(life) = of_topic.last_mut() {
                life.add(number, published, since.get(topic).copied().unwrap_or(0));
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
        let own = self.lives(&BTreeMap::new());
        let latest = |lives: &Vec<Life>| lives.last().map_or(0, |life| life.latest);
        let until = own
            .iter()
            .map(|(topic, lives)| (topic.clone(), latest(lives)));
        let until = until.collect();
        let after = later.map(|later| later.lives(&until)).unwrap_or_default();
        let mut gaps = Vec::new();
        for (topic, lives) in own {
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
                for pair in life.runs.windows(2) {
                    gap(pair[0][1] + 1, pair[1][0] - 1, LossEvidence::SameRecording);
                }
            }
            let Some(next) = after.get(&topic).and_then(|lives| lives.first()) else {
                continue;
            };
            let known = lives.last().and_then(Life::last);
            let begin = known.map_or(0, |last| last.saturating_add(1));
            if let Some(first) = next.fresh
                && first > begin
            {
                gap(begin, first - 1, LossEvidence::LaterRecording);
            }
        }
        gaps
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use rand::{Rng as _, SeedableRng as _};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn runs_hold_what_a_set_of_all_numbers_does() {
        let mut random = Pcg64::seed_from_u64(5);
        for _ in 0..200 {
            let (mut life, mut set) = (Life::default(), BTreeSet::new());
            for _ in 0..random.random_range(1..80) {
                let number = random.random_range(0..60);
                life.add(number, 1, 0);
                set.insert(number);
            }
            let listed: Vec<u32> = life.runs.iter().flat_map(|run| run[0]..=run[1]).collect();
            assert_eq!(listed, set.iter().copied().collect::<Vec<_>>());
            assert!(life.runs.windows(2).all(|pair| pair[1][0] > pair[0][1] + 1));
            assert_eq!(life.fresh, set.first().copied());
        }
    }
}
