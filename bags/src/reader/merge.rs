//! Messages of all chunks of all files, in order of log time.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};

use bytes::Bytes;

use super::{Bag, Recorded};
use crate::container::{Block, MessageLocation};
use crate::damage::Damage;

/// Messages in order of log time. A damaged chunk is one `Err`; reading continues after it.
#[derive(Debug)]
pub struct Messages<'a> {
    bag: &'a Bag,
    wanted: Option<Vec<bool>>,
    /// Blocks not loaded yet, by their first log time.
    waiting: VecDeque<(usize, &'a Block)>,
    /// Loaded blocks by file and offset.
    open: BTreeMap<(usize, u64), OpenBlock>,
    /// The next message of each open block.
    next: BinaryHeap<Reverse<Key>>,
    repeats: Repeats,
    damage: VecDeque<Damage>,
    /// First and last log time that is wanted.
    during: (u64, u64),
    /// What was given last, here or before the reading that is gone on with.
    last: Option<Key>,
}

/// A place in the messages of some topics, to go on from with [`Bag::messages_after`].
#[derive(Debug, Clone, Default)]
pub struct Position {
    last: Option<Key>,
    repeats: Repeats,
}

/// Log time, file, offset of the block, position in the block.
type Key = (u64, usize, u64, usize);

#[derive(Debug)]
struct OpenBlock {
    records: Bytes,
    /// In order of log time, equal ones as written.
    messages: Vec<MessageLocation>,
}

/// Tells latched messages that a recorder wrote again at the start of a split.
#[derive(Debug, Clone, Default)]
struct Repeats {
    /// What was given last on each latched channel.
    given: BTreeMap<usize, VecDeque<(u32, u64, Bytes)>>,
    /// Channels that have had a message of their own in a file: no repeats follow.
    begun: BTreeSet<(usize, usize)>,
}

impl Repeats {
    fn is_repeat(&mut self, file: usize, number: usize, message: &Recorded) -> bool {
        let depth = message.channel.qos.latched_depth();
        if depth == 0 {
            return false;
        }
        let given = self.given.entry(number).or_default();
        let identity = (
            message.sequence,
            message.publish_time,
            message.payload.clone(),
        );
        if file > 0 && !self.begun.contains(&(file, number)) && given.contains(&identity) {
            return true;
        }
        self.begun.insert((file, number));
        if given.len() == depth {
            given.pop_front();
        }
        // A copy: the view would keep its whole chunk in memory for as long as the topic is silent.
        given.push_back((identity.0, identity.1, Bytes::copy_from_slice(&identity.2)));
        false
    }
}

impl<'a> Messages<'a> {
    pub(super) fn new(bag: &'a Bag, wanted: Option<Vec<bool>>, from: Position) -> Self {
        let mut waiting: Vec<(usize, &Block)> = Vec::new();
        for (number, file) in bag.files.iter().enumerate() {
            let has_wanted = |block: &&Block| match (&wanted, &block.channels) {
                (Some(wanted), Some(ids)) => ids.iter().any(|id| {
                    bag.numbers[number]
                        .get(id)
                        .is_some_and(|channel| wanted[*channel])
                }),
                _ => true,
            };
            let is_ahead = |block: &&Block| from.last.is_none_or(|last| block.bounds.1 >= last.0);
            waiting.extend(
                file.blocks
                    .iter()
                    .filter(has_wanted)
                    .filter(is_ahead)
                    .map(|block| (number, block)),
            );
        }
        waiting.sort_by_key(|(file, block)| (block.bounds.0, *file, block.offset));
        Self {
            bag,
            wanted,
            waiting: waiting.into(),
            open: BTreeMap::new(),
            next: BinaryHeap::new(),
            repeats: from.repeats,
            damage: VecDeque::new(),
            during: (0, u64::MAX),
            last: from.last,
        }
    }

    /// Those of them received from one log time to another, both included.
    pub(super) fn during(mut self, (from, to): (u64, u64)) -> Self {
        let overlaps = |block: &Block| block.bounds.1 >= from && block.bounds.0 <= to;
        self.waiting.retain(|(_, block)| overlaps(block));
        self.during = (from, to);
        self
    }

    /// The place behind what was given last.
    pub fn position(&self) -> Position {
        Position {
            last: self.last,
            repeats: self.repeats.clone(),
        }
    }

    fn load(&mut self, file: usize, block: &Block) {
        let contents = &self.bag.files[file];
        let numbers = &self.bag.numbers[file];
        let mut messages = Vec::new();
        let take = |message: MessageLocation| {
            // Messages of unknown channels are reported as damage by the scan of the file.
            let channel = numbers.get(&message.channel);
            let during = self.during.0..=self.during.1;
            if during.contains(&message.log_time)
                && channel.is_some_and(|channel| {
                    self.wanted.as_ref().is_none_or(|wanted| wanted[*channel])
                })
            {
                messages.push(message);
            }
        };
        let records = match contents.walk(block, take) {
            Ok(records) => records,
            Err(damage) => return self.damage.push_back(damage),
        };
        messages.sort_by_key(|message| message.log_time);
        // Of a block that was begun before, what is left.
        let key = |(position, message): (usize, &MessageLocation)| {
            (message.log_time, file, block.offset, position)
        };
        let mut keys = messages.iter().enumerate().map(key);
        let is_ahead = |one: &Key| self.last.is_none_or(|last| *one > last);
        if let Some(first) = keys.find(is_ahead) {
            self.next.push(Reverse(first));
            self.open
                .insert((file, block.offset), OpenBlock { records, messages });
        }
    }

    /// Loads every block that may hold the next message.
    fn load_due(&mut self) {
        while let Some(&(file, block)) = self.waiting.front() {
            let next = self.next.peek();
            // Where all times are equal as well, a block waits for those before it.
            let first = (block.bounds.0, file, block.offset);
            if next.is_some_and(|Reverse((time, file, offset, _))| first > (*time, *file, *offset))
            {
                return;
            }
            self.waiting.pop_front();
            self.load(file, block);
        }
    }

    fn take(&mut self, (_, file, offset, position): Key) -> Option<Recorded> {
        let open = self.open.get(&(file, offset))?;
        let location = open.messages[position];
        let payload = open.records.slice(location.start..location.end);
        match open.messages.get(position + 1) {
            Some(following) => {
                self.next
                    .push(Reverse((following.log_time, file, offset, position + 1)));
            }
            None => drop(self.open.remove(&(file, offset))),
        }
        let number = *self.bag.numbers[file].get(&location.channel)?;
        let mut message = Recorded {
            channel: self.bag.channels[number].clone(),
            sequence: location.sequence,
            log_time: location.log_time,
            publish_time: location.publish_time,
            payload,
        };
        if self.repeats.is_repeat(file, number, &message) {
            return None;
        }
        if let Some(migration) = &self.bag.migrations[number]
            && let Ok(migrated) = migration.migrate(&message.payload)
        {
            message.payload = migrated.into();
        }
        Some(message)
    }
}

impl Iterator for Messages<'_> {
    type Item = Result<Recorded, Damage>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            self.load_due();
            if let Some(damage) = self.damage.pop_front() {
                return Some(Err(damage));
            }
            let Reverse(key) = self.next.pop()?;
            self.last = Some(key);
            if let Some(message) = self.take(key) {
                return Some(Ok(message));
            }
        }
    }
}
