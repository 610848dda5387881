//! A recorded session: messages by topic and number, and the step journals.

use std::collections::BTreeMap;

use probecell_msgs::{StepJournal, from_cdr};

use crate::{
    Stamp,
    journal::{self, Step},
    topics,
};

/// Number of a publication on its topic, made unique over restarts of the publisher: (restart, number).
pub(super) type Key = (u32, u64);

/// Marks, in the restart of a key, a process that was killed before its first journal: it began after the process of the place
/// in the other bits had ended.
pub(super) const UNJOURNALED: u32 = 1 << 31;

/// The node that publishes each topic of the replayed ones.
pub(super) type Producers = BTreeMap<&'static str, &'static str>;

pub(super) type Keyed<'a> = BTreeMap<&'a str, BTreeMap<Key, &'a Publication>>;

/// The content of a recording, by topic.
#[derive(Debug, Default)]
pub struct Recording {
    topics: BTreeMap<String, Vec<Publication>>,
    pub(super) journals: BTreeMap<String, NodeJournal>,
    pub(super) unreadable_journals: u64,
    /// Messages so far.
    recorded: u64,
}

#[derive(Debug)]
pub(super) struct Publication {
    sequence: u64,
    /// How many messages were recorded before it.
    recorded: u64,
    pub(super) at: Stamp,
    pub(super) payload: Vec<u8>,
}

impl Publication {
    /// A step cannot have taken what was recorded after the journal that lists it, and was published after it as well. Either
    /// alone is possible: a recorder behind a link that was cut, a publisher whose clock is ahead.
    pub(super) fn is_after(&self, listed: &Listed) -> bool {
        self.recorded > listed.recorded && self.at > listed.step.now
    }
}

/// A step of a journal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Listed {
    /// How often its node had been started before.
    pub(super) incarnation: u32,
    /// How many messages were recorded before the journal.
    recorded: u64,
    pub(super) step: Step,
}

/// The steps of one node that can be repeated: from the start of each of its processes up to the first gap.
#[derive(Debug, Default)]
pub(super) struct NodeJournal {
    pub(super) steps: Vec<Listed>,
    /// Process and number of the step that comes next.
    next: (u32, u64),
    /// The processes that left a journal: of each, how often the node had been started before.
    processes: Vec<u32>,
    /// Instant of the first step listed of each process, in order.
    starts: Vec<Stamp>,
    /// Instant of its last step listed.
    ends: Vec<Stamp>,
    /// Steps after a gap: the state of the node there is unknown.
    pub(super) beyond: u64,
    /// Where the first gap lies.
    pub(super) gap: Option<String>,
}

impl NodeJournal {
    fn push(&mut self, message: &StepJournal, recorded: u64) {
        let (process, next) = self.next;
        let listed = journal::steps(message);
        let (Some(&first), Some(&last)) = (message.now.first(), message.now.last()) else {
            return;
        };
        if (self.processes.last()).is_none_or(|&known| message.incarnation > known) {
            self.processes.push(message.incarnation);
            self.starts.push(Stamp(first));
            self.ends.push(Stamp(last));
        } else if let Some(end) = self.ends.last_mut() {
            *end = Stamp(last);
        }
        let whole = (message.incarnation, message.first_step) == (process, next)
            || (message.incarnation > process && message.first_step == 0);
        if whole {
            let count = self.steps.len();
            self.steps.extend(listed.map(|step| Listed {
                incarnation: message.incarnation,
                recorded,
                step,
            }));
            let added = (self.steps.len() - count) as u64;
            self.next = (message.incarnation, message.first_step + added);
        } else {
            self.beyond += listed.count() as u64;
            let missing = if message.incarnation > process {
                0
            } else {
                next
            };
            self.gap.get_or_insert_with(|| {
                format!("its journal, which is incomplete from step {missing} on")
            });
        }
    }

    /// The process that ran at this instant, counted over those that left a journal.
    pub(super) fn process_at(&self, instant: Stamp) -> u32 {
        self.starts
            .partition_point(|&start| start <= instant)
            .saturating_sub(1) as u32
    }

    /// The place of a process among those that left a journal.
    pub(super) fn place(&self, incarnation: u32) -> u32 {
        self.processes.partition_point(|&known| known < incarnation) as u32
    }

    /// The key of a publication in the time of a process. Numbers that begin again after its last step are those of a process
    /// that was killed before its first journal; `newest`: the key of the publication before, and its instant.
    fn key(&self, process: u32, one: &Publication, newest: Option<(Key, Stamp)>) -> Key {
        let unjournaled = process | UNJOURNALED;
        let begins = |((restart, last), at): (Key, Stamp)| {
            restart == unjournaled
                || restart == process
                    && one.sequence == 1
                    && one.sequence <= last
                    && one.at > at
                    && self.is_behind(process, one.at)
        };
        let restart = if newest.is_some_and(begins) {
            unjournaled
        } else {
            process
        };
        (restart, one.sequence)
    }

    /// Published by a process that was killed before it had published its last steps: it cannot be recomputed.
    pub(super) fn is_behind(&self, process: u32, instant: Stamp) -> bool {
        process & UNJOURNALED != 0
            || (self.ends.get(process as usize)).is_some_and(|&end| instant > end)
    }
}

impl Recording {
    /// Adds a message in the order recorded. `topic` is the name below the cell's namespace, `sequence` the number that
    /// its publisher gave it, `at` the instant of its publication.
    pub fn push(&mut self, topic: &str, sequence: u64, at: Stamp, payload: &[u8]) {
        let recorded = self.recorded;
        self.recorded += 1;
        if let Some(node) = topic.strip_suffix("/steps") {
            match from_cdr::<StepJournal>(payload) {
                Ok(message) => self
                    .journals
                    .entry(node.to_owned())
                    .or_default()
                    .push(&message, recorded),
                Err(_) => self.unreadable_journals += 1,
            }
            return;
        }
        self.topics
            .entry(topic.to_owned())
            .or_default()
            .push(Publication {
                sequence,
                recorded,
                at,
                payload: payload.to_vec(),
            });
    }

    /// What was published on a topic, in CDR.
    pub fn payloads(&self, topic: &str) -> impl Iterator<Item = &[u8]> {
        let published = self.topics.get(topic).into_iter().flatten();
        published.map(|one| one.payload.as_slice())
    }

    /// Nodes with a journal.
    pub fn journaled(&self) -> impl Iterator<Item = &str> {
        self.journals.keys().map(String::as_str)
    }

    /// The journal of the node that publishes a topic: the replayed one, or the one in the table of topics.
    pub(super) fn producer(&self, topic: &str, replayed: &Producers) -> Option<&NodeJournal> {
        let name = match replayed.get(topic) {
            Some(name) => name,
            None => topics::by_name(topic)?.producer,
        };
        self.journals.get(name)
    }

    /// Every message by topic and number. Restarts of a publisher with a journal are known by their instants; those of
    /// another one by numbers that begin at 1 again, other than of a latched message that was recorded twice.
    pub(super) fn keyed(&self, replayed: &Producers) -> Keyed<'_> {
        self.topics
            .iter()
            .map(|(topic, publications)| {
                let journal = self.producer(topic, replayed);
                let (mut restart, mut first) = (0, None);
                let mut newest: Option<(Key, Stamp)> = None;
                let by_key = publications.iter().map(|one| {
                    restart = match journal {
                        Some(journal) => {
                            let process = journal.process_at(one.at);
                            let key = journal.key(process, one, newest);
                            if newest.is_none_or(|(_, at)| one.at > at) {
                                newest = Some((key, one.at));
                            }
                            key.0
                        }
                        None if one.sequence == 1 && first.is_some_and(|at| at != one.at) => {
                            restart + 1
                        }
                        None => restart,
                    };
                    if one.sequence == 1 {
                        first = Some(one.at);
                    }
                    ((restart, one.sequence), one)
                });
                (topic.as_str(), by_key.collect())
            })
            .collect()
    }
}
