//! Recomputes every node of a recorded session and compares what comes out with what was recorded.
//!
//! Each node is fed exactly the inputs that its journal names, with the instants its process gave it. An input whose
//! topic another replayed node publishes is taken from what that node says *now*; only inputs from outside come from
//! the recording. So nothing that a node said in the recording can make up for what it fails to say in the replay.

use std::collections::BTreeMap;

use probecell_msgs::{StepJournal, from_cdr};
use serde::Serialize;

use crate::{
    Emitted, Instance, START, Stamp, Topic, Wiring, WiringError,
    journal::{self, Step, TIMER_PORT},
};

/// Number of a publication on its topic, made unique over restarts of the publisher: (restart, number).
type Key = (u32, u64);

/// What a recording holds, sorted by topic.
#[derive(Debug, Default)]
pub struct Recording {
    topics: BTreeMap<String, BTreeMap<Key, Vec<u8>>>,
    last: BTreeMap<String, Key>,
    journals: BTreeMap<String, Vec<(u32, Step)>>,
    unreadable_journals: u64,
}

impl Recording {
    /// Adds a message in the order recorded. `topic` is the name below the cell's namespace, `sequence` the number that
    /// its publisher gave it.
    pub fn push(&mut self, topic: &str, sequence: u64, payload: &[u8]) {
        if let Some(node) = topic.strip_suffix("/steps") {
            match from_cdr::<StepJournal>(payload) {
                Ok(message) => {
                    let steps = journal::steps(&message).map(|step| (message.incarnation, step));
                    self.journals
                        .entry(node.to_owned())
                        .or_default()
                        .extend(steps);
                }
                Err(_) => self.unreadable_journals += 1,
            }
            return;
        }
        let key = match self.last.get(topic) {
            // A publisher that counts from the beginning again was started again.
            Some(&(restart, last)) if sequence < last && sequence == 1 => (restart + 1, sequence),
            Some(&(restart, _)) => (restart, sequence),
            None => (0, sequence),
        };
        self.last.insert(topic.to_owned(), key);
        self.topics
            .entry(topic.to_owned())
            .or_default()
            .insert(key, payload.to_vec());
    }

    /// Nodes that left a journal.
    pub fn journaled(&self) -> impl Iterator<Item = &str> {
        self.journals.keys().map(String::as_str)
    }

    fn payload(&self, topic: &str, key: Key) -> Option<&Vec<u8>> {
        self.topics.get(topic)?.get(&key)
    }
}

/// How a replay ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// All that was recorded was recomputed, and equal.
    Equal,
    /// Something recomputed differs from what was recorded.
    Different,
    /// Nothing differs, but part could not be compared: it was not recorded, or an input of it was not.
    Incomplete,
}

/// One node in a replay.
#[derive(Clone, Debug, Serialize)]
pub struct NodeReport {
    /// The node.
    pub node: String,
    /// Steps recomputed.
    pub steps: u64,
    /// Steps that the journal lists but that could not be made.
    pub steps_left: u64,
    /// Timers in the journal that the recomputed node had not asked for.
    pub timers_not_asked_for: u64,
    /// The input that stopped it, when steps are left.
    pub waits_for: Option<String>,
}

/// One topic of a replayed node.
#[derive(Clone, Debug, Serialize)]
pub struct TopicReport {
    /// The topic.
    pub topic: String,
    /// The node that publishes it.
    pub node: String,
    /// Messages recorded.
    pub recorded: u64,
    /// Messages equal byte for byte.
    pub equal: u64,
    /// Messages that differ.
    pub different: u64,
    /// Recorded, but not recomputed.
    pub not_recomputed: u64,
    /// Recomputed, but not recorded.
    pub not_recorded: u64,
}

/// The first message that differs, by order of recomputation.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// The topic.
    pub topic: String,
    /// The publication's number on it.
    pub sequence: u64,
    /// Instant of the step that published it.
    pub at: Stamp,
    /// CDR bytes recorded.
    #[serde(skip)]
    pub recorded: Vec<u8>,
    /// CDR bytes recomputed.
    #[serde(skip)]
    pub recomputed: Vec<u8>,
}

/// What a replay found.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The whole in a word.
    pub verdict: Verdict,
    /// Each node.
    pub nodes: Vec<NodeReport>,
    /// Each topic of a replayed node.
    pub topics: Vec<TopicReport>,
    /// The first difference.
    pub first_difference: Option<Difference>,
    /// Instant of the first and of the last step.
    pub span: Option<(Stamp, Stamp)>,
}

/// Makes a node at its start, as often as it was started in the session.
pub type Factory = Box<dyn Fn() -> Box<dyn Instance>>;

struct Player {
    node: Box<dyn Instance>,
    incarnation: u32,
    steps: Vec<(u32, Step)>,
    next: usize,
    pending: BTreeMap<u32, Vec<Stamp>>,
    heard: BTreeMap<u16, Key>,
    said: BTreeMap<&'static str, Key>,
    timers_not_asked_for: u64,
    waits_for: Option<String>,
}

impl Player {
    fn restart(&mut self, node: Box<dyn Instance>, incarnation: u32) {
        self.node = node;
        self.incarnation = incarnation;
        self.pending.clear();
        for key in self.said.values_mut() {
            *key = (key.0 + 1, 0);
        }
    }

    /// The key of a heard sequence number: it counts the publisher's restarts as the recording does.
    fn key(&self, step: Step) -> Key {
        match self.heard.get(&step.port) {
            Some(&(restart, last)) if step.sequence < last && step.sequence == 1 => {
                (restart + 1, 1)
            }
            Some(&(restart, _)) => (restart, step.sequence),
            None => (0, step.sequence),
        }
    }

    fn take_timer(&mut self, now: Stamp, id: u32) {
        let due = self.pending.get_mut(&id).and_then(|asked| {
            let position = asked.iter().position(|&at| at <= now)?;
            Some(asked.swap_remove(position))
        });
        if due.is_none() && id != START {
            self.timers_not_asked_for += 1;
        }
    }
}

/// Replays `recording` through the nodes that `factories` make.
pub fn replay(recording: &Recording, factories: &[Factory]) -> Result<Report, WiringError> {
    let nodes: Vec<Box<dyn Instance>> = factories.iter().map(|make| make()).collect();
    let wiring = Wiring::of(&nodes)?;
    let mut players: Vec<Player> = nodes
        .into_iter()
        .map(|node| Player {
            steps: recording
                .journals
                .get(node.name())
                .cloned()
                .unwrap_or_default(),
            incarnation: 0,
            next: 0,
            pending: BTreeMap::new(),
            heard: BTreeMap::new(),
            said: node
                .outputs()
                .iter()
                .map(|topic| (topic.name, (0, 0)))
                .collect(),
            timers_not_asked_for: 0,
            waits_for: None,
            node,
        })
        .collect();
    let mut comparison = Comparison::new(recording);
    let mut said: BTreeMap<(&'static str, Key), Vec<u8>> = BTreeMap::new();
    let mut progress = true;
    while progress {
        progress = false;
        for index in 0..players.len() {
            while let Some(emitted) = advance(
                &mut players[index],
                &factories[index],
                recording,
                &wiring,
                &said,
            ) {
                progress = true;
                let now = players[index].steps[players[index].next - 1].1.now;
                settle(
                    &mut players[index],
                    emitted,
                    now,
                    &mut comparison,
                    &mut said,
                );
            }
        }
    }
    Ok(comparison.report(&players))
}

/// One step of a player, or `None` when its next input is not there (yet).
fn advance(
    player: &mut Player,
    factory: &Factory,
    recording: &Recording,
    wiring: &Wiring,
    said: &BTreeMap<(&'static str, Key), Vec<u8>>,
) -> Option<Emitted> {
    let &(incarnation, step) = player.steps.get(player.next)?;
    if incarnation != player.incarnation {
        player.restart(factory(), incarnation);
    }
    let emitted = if step.port == TIMER_PORT {
        let id = step.sequence as u32;
        player.take_timer(step.now, id);
        player.node.timer(step.now, id)
    } else {
        let topic = player.node.inputs().get(usize::from(step.port))?;
        let key = player.key(step);
        let payload = if wiring.producer(topic.name).is_some() {
            said.get(&(topic.name, key))
        } else {
            recording.payload(topic.name, key)
        };
        let Some(payload) = payload else {
            player.waits_for = Some(format!("message {} on {}", step.sequence, topic.name));
            return None;
        };
        player.heard.insert(step.port, key);
        // A message that a process could not read made no step, and so stands in no journal; one that cannot be read
        // now differs from what was recorded, and what should have come of it will be missing.
        player
            .node
            .deliver(step.now, usize::from(step.port), payload)
            .unwrap_or_default()
    };
    player.waits_for = None;
    player.next += 1;
    Some(emitted)
}

fn settle(
    player: &mut Player,
    emitted: Emitted,
    now: Stamp,
    comparison: &mut Comparison<'_>,
    said: &mut BTreeMap<(&'static str, Key), Vec<u8>>,
) {
    for (at, id) in emitted.timers {
        player.pending.entry(id).or_default().push(at.max(now));
    }
    for (port, payload) in emitted.messages {
        let described = &player.node.outputs()[port];
        let topic = described.name;
        let key = player.said.entry(topic).or_insert((0, 0));
        key.1 += 1;
        comparison.compare(described, *key, now, &payload);
        said.insert((topic, *key), payload);
    }
}

struct Comparison<'a> {
    recording: &'a Recording,
    compared: BTreeMap<&'static str, (u64, u64, u64)>,
    first: Option<Difference>,
}

impl<'a> Comparison<'a> {
    fn new(recording: &'a Recording) -> Self {
        Self {
            recording,
            compared: BTreeMap::new(),
            first: None,
        }
    }

    fn compare(&mut self, topic: &Topic, key: Key, at: Stamp, recomputed: &[u8]) {
        let (topic, message) = (topic.name, topic.message);
        let counts = self.compared.entry(topic).or_default();
        let Some(recorded) = self.recording.payload(topic, key) else {
            counts.2 += 1;
            return;
        };
        // DDS pads the end of a payload, so a message that differs is looked at in its canonical bytes.
        if recorded.as_slice() == recomputed
            || message
                .canonical(recorded)
                .is_ok_and(|canonical| canonical == recomputed)
        {
            counts.0 += 1;
            return;
        }
        counts.1 += 1;
        if self.first.as_ref().is_none_or(|first| at < first.at) {
            self.first = Some(Difference {
                topic: topic.to_owned(),
                sequence: key.1,
                at,
                recorded: recorded.clone(),
                recomputed: recomputed.to_vec(),
            });
        }
    }

    fn report(self, players: &[Player]) -> Report {
        let nodes: Vec<NodeReport> = players
            .iter()
            .map(|player| NodeReport {
                node: player.node.name().to_owned(),
                steps: player.next as u64,
                steps_left: (player.steps.len() - player.next) as u64,
                timers_not_asked_for: player.timers_not_asked_for,
                waits_for: player.waits_for.clone(),
            })
            .collect();
        let mut topics = Vec::new();
        for player in players {
            for topic in player.node.outputs() {
                let (equal, different, not_recorded) =
                    self.compared.get(topic.name).copied().unwrap_or_default();
                let recorded = self
                    .recording
                    .topics
                    .get(topic.name)
                    .map_or(0, |messages| messages.len() as u64);
                topics.push(TopicReport {
                    topic: topic.name.to_owned(),
                    node: player.node.name().to_owned(),
                    recorded,
                    equal,
                    different,
                    not_recomputed: recorded - equal - different,
                    not_recorded,
                });
            }
        }
        let differs = topics.iter().any(|topic| topic.different > 0)
            || nodes.iter().any(|node| node.timers_not_asked_for > 0);
        let incomplete = topics
            .iter()
            .any(|topic| topic.not_recomputed + topic.not_recorded > 0)
            || nodes
                .iter()
                .any(|node| node.steps_left > 0 || node.steps == 0)
            || self.recording.unreadable_journals > 0;
        let verdict = match (differs, incomplete) {
            (true, _) => Verdict::Different,
            (false, true) => Verdict::Incomplete,
            (false, false) => Verdict::Equal,
        };
        let instants = || {
            players
                .iter()
                .flat_map(|player| player.steps.iter().map(|(_, step)| step.now))
        };
        let span = instants().min().zip(instants().max());
        Report {
            verdict,
            nodes,
            topics,
            first_difference: self.first,
            span,
        }
    }
}
