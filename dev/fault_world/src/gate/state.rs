//! The states of the search, and the events that lead from one to another.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    fmt,
    hash::{DefaultHasher, Hash, Hasher},
    rc::Rc,
};

use cell_tests::session::Session;
use graph::topics;
use probecell_msgs::ControllerStatus;
use serde_json::Value;

use super::{Bounds, NODES};

/// The way to the driver.
pub(super) const DRIVER: usize = NODES.len();

/// A message on its way, and the hash of its bytes.
#[derive(Clone)]
pub(super) struct Letter {
    pub(super) payload: Rc<Vec<u8>>,
    hash: u64,
}

impl Letter {
    pub(super) fn new(payload: Vec<u8>) -> Self {
        let mut hasher = DefaultHasher::new();
        payload.hash(&mut hasher);
        Self {
            hash: hasher.finish(),
            payload: Rc::new(payload),
        }
    }
}

#[derive(Clone)]
pub(super) struct Node {
    pub(super) snapshot: Rc<Value>,
    hash: u64,
    /// Steps made: no two steps of a node are at the same instant.
    pub(super) steps: u32,
}

impl Node {
    pub(super) fn new(snapshot: Rc<Value>, steps: u32) -> Self {
        let mut hasher = DefaultHasher::new();
        // A map of JSON is ordered by its keys.
        snapshot.to_string().hash(&mut hasher);
        Self {
            hash: hasher.finish(),
            snapshot,
            steps,
        }
    }
}

/// What has reached the gate that runs now.
#[derive(Clone, Default, Hash)]
pub(super) struct Heard {
    /// A correction of the measurement was rejected.
    pub(super) rejected: bool,
    /// The part has ended, or is being stopped.
    pub(super) over: bool,
    /// An operator has stopped the machine.
    pub(super) stopped: bool,
    /// Period of the last new word of `cycle` on the living part.
    pub(super) alive: u8,
    /// ns; begin of the process.
    pub(super) began: i64,
}

#[derive(Clone)]
pub(super) struct State {
    pub(super) nodes: Vec<Node>,
    pub(super) ways: BTreeMap<(&'static str, usize), VecDeque<Letter>>,
    pub(super) latched: BTreeMap<&'static str, VecDeque<Letter>>,
    pub(super) left: Bounds,
    pub(super) period: u8,
    /// Restarts of the driver.
    pub(super) driver: u8,
    /// Wear of each tool, m, in bits.
    pub(super) wear: BTreeMap<u32, u64>,
    /// Numbers of the commands that the driver has taken.
    pub(super) taken: BTreeSet<u64>,
    /// Corrections on the bus so far.
    pub(super) published: Vec<Letter>,
    /// Corrections that were written, and answers that were given.
    pub(super) written: BTreeSet<String>,
    pub(super) answered: BTreeSet<(usize, &'static str)>,
    pub(super) heard: Heard,
}

/// What happens next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Event {
    Arrive(&'static str, usize),
    Lose(&'static str, usize),
    Repeat(&'static str, usize),
    Answer(usize, &'static str, bool),
    Stop,
    Restart(usize),
    Forge(Forged),
    Period,
}

/// What a stranger puts on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Forged {
    Unsigned,
    OutOfBounds,
    NoSource,
    Session,
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

impl State {
    pub(super) fn new(snapshots: [Value; 3], session: &Session) -> Self {
        let mut latched: BTreeMap<&str, VecDeque<Letter>> = BTreeMap::new();
        for topic in [
            topics::OPERATOR_KEYS,
            topics::RECORDING_STATUS,
            topics::TOOL_OFFSETS,
            topics::CORRECTIONS,
            topics::PASS_DECISIONS,
            topics::PART_STATUS,
            topics::SUPERVISED_PART,
        ] {
            let all = session.log().iter().filter(|one| one.topic == topic.name);
            let all: Vec<Letter> = all.map(|one| Letter::new(one.payload.clone())).collect();
            let depth = topic.qos.depth.unwrap_or(1) as usize;
            let kept = all.into_iter().rev().take(depth).collect::<Vec<_>>();
            latched.insert(topic.name, kept.into_iter().rev().collect());
        }
        let sample: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
        let published = latched[topics::CORRECTIONS.name].iter().cloned().collect();
        let wear = sample.tool_wear.iter().map(|wear| wear.to_bits());
        Self {
            nodes: (snapshots.into_iter())
                .map(|snapshot| Node::new(Rc::new(snapshot), 0))
                .collect(),
            ways: BTreeMap::new(),
            latched,
            left: Bounds::default(),
            period: 0,
            driver: 0,
            wear: sample.tool_numbers.iter().copied().zip(wear).collect(),
            taken: BTreeSet::new(),
            published,
            written: BTreeSet::new(),
            answered: BTreeSet::new(),
            heard: Heard::default(),
        }
    }

    /// What two states are told apart by, in 128 bits.
    pub(super) fn key(&self) -> u128 {
        let half = |salt: u8| {
            let mut hasher = DefaultHasher::new();
            salt.hash(&mut hasher);
            for node in &self.nodes {
                (node.hash, node.steps).hash(&mut hasher);
            }
            for (way, letters) in &self.ways {
                if !letters.is_empty() {
                    way.hash(&mut hasher);
                    for letter in letters {
                        letter.hash.hash(&mut hasher);
                    }
                    u8::MAX.hash(&mut hasher);
                }
            }
            for (topic, letters) in &self.latched {
                topic.hash(&mut hasher);
                for letter in letters {
                    letter.hash.hash(&mut hasher);
                }
            }
            let published: Vec<u64> = self.published.iter().map(|letter| letter.hash).collect();
            (published, self.left, self.period, self.driver).hash(&mut hasher);
            (&self.wear, &self.taken, &self.written).hash(&mut hasher);
            (&self.answered, &self.heard).hash(&mut hasher);
            u128::from(hasher.finish())
        };
        (half(0) << 64) | half(1)
    }

    /// Everything that can happen in this state.
    pub(super) fn events(&self) -> Vec<Event> {
        let mut events = Vec::new();
        let under_way = self.ways.iter().filter(|(_, letters)| !letters.is_empty());
        for (&(topic, to), _) in under_way {
            events.push(Event::Arrive(topic, to));
            if self.left.losses > 0 {
                events.push(Event::Lose(topic, to));
            }
            if self.left.repeats > 0 {
                events.push(Event::Repeat(topic, to));
            }
        }
        if self.left.answers > 0 {
            for (index, by) in [(0, "Ada"), (1, "Grace")] {
                if !self.answered.contains(&(index, by)) {
                    events.push(Event::Answer(index, by, true));
                    events.push(Event::Answer(index, by, false));
                }
            }
        }
        if self.left.stops > 0 {
            events.push(Event::Stop);
        }
        if self.left.restarts > 0 {
            events.extend((0..=DRIVER).map(Event::Restart));
        }
        if self.left.forgeries > 0 {
            let all = [
                Forged::Unsigned,
                Forged::OutOfBounds,
                Forged::NoSource,
                Forged::Session,
            ];
            events.extend(all.map(Event::Forge));
        }
        if self.left.periods > 0 {
            events.push(Event::Period);
        }
        events
    }

    /// Puts a message on its ways.
    pub(super) fn post(&mut self, topic: &'static str, payload: &[u8], to: &[usize]) {
        let letter = Letter::new(payload.to_vec());
        for &node in to {
            let way = self.ways.entry((topic, node)).or_default();
            way.push_back(letter.clone());
        }
        if topic == topics::CORRECTIONS.name {
            self.published.push(letter.clone());
        }
        let known = topics::by_name(topic).filter(|known| known.qos.transient_local);
        if let Some(depth) = known.and_then(|known| known.qos.depth) {
            let kept = self.latched.entry(topic).or_default();
            kept.push_back(letter);
            while kept.len() > depth as usize {
                kept.pop_front();
            }
        }
    }
}
