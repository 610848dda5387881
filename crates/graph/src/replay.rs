//! Recomputes every node of a recorded session and compares what comes out with what was recorded.
//!
//! Each node is fed exactly the inputs that its journal names, with the instants its process gave it. An input whose
//! topic another replayed node publishes is taken from what that node says *now*; only inputs from outside come from
//! the recording. So nothing that a node said in the recording can make up for what it fails to say in the replay, except
//! what a killed process said in its last tenth of a second, whose steps were never published: that is taken as recorded,
//! and the replay is called incomplete.

use std::collections::BTreeMap;

use probecell_msgs::{StepJournal, from_cdr};
use serde::Serialize;

use crate::{
    Emitted, Instance, START, Stamp, Topic, Wiring, WiringError,
    journal::{self, Step, TIMER_PORT},
    topics,
};

/// Number of a publication on its topic, made unique over restarts of the publisher: (restart, number).
type Key = (u32, u64);

/// What a recording holds, sorted by topic.
#[derive(Debug, Default)]
pub struct Recording {
    topics: BTreeMap<String, Vec<Publication>>,
    journals: BTreeMap<String, NodeJournal>,
    unreadable_journals: u64,
}

#[derive(Debug)]
struct Publication {
    sequence: u64,
    at: Stamp,
    payload: Vec<u8>,
}

/// The steps of one node that can be made again: from the start of each of its processes without a gap.
#[derive(Debug, Default)]
struct NodeJournal {
    steps: Vec<(u32, Step)>,
    /// Process and number of the step that comes next.
    next: (u32, u64),
    /// Instant of the first step listed of each process, in order.
    starts: Vec<Stamp>,
    /// Instant of its last step listed.
    ends: Vec<Stamp>,
    /// Steps behind a gap: what the node knew by then cannot be told.
    beyond: u64,
    /// Where the first gap lies.
    gap: Option<String>,
}

impl NodeJournal {
    fn push(&mut self, message: &StepJournal) {
        let (process, next) = self.next;
        let listed = journal::steps(message);
        let (Some(&first), Some(&last)) = (message.now.first(), message.now.last()) else {
            return;
        };
        if message.incarnation > process || self.starts.is_empty() {
            self.starts.push(Stamp(first));
            self.ends.push(Stamp(last));
        } else if let Some(end) = self.ends.last_mut() {
            *end = Stamp(last);
        }
        let whole = (message.incarnation, message.first_step) == (process, next)
            || (message.incarnation > process && message.first_step == 0);
        if whole {
            let count = self.steps.len();
            self.steps
                .extend(listed.map(|step| (message.incarnation, step)));
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
                format!("its journal, which lacks what comes from step {missing} on")
            });
        }
    }

    /// The process that ran at this instant, counted over those that left a journal.
    fn process_at(&self, instant: Stamp) -> u32 {
        self.starts
            .partition_point(|&start| start <= instant)
            .saturating_sub(1) as u32
    }

    /// Said by a process that was killed before it had published its last steps: nobody can compute it again.
    fn is_behind(&self, process: u32, instant: Stamp) -> bool {
        self.ends
            .get(process as usize)
            .is_some_and(|&end| instant > end)
    }
}

impl Recording {
    /// Adds a message in the order recorded. `topic` is the name below the cell's namespace, `sequence` the number that
    /// its publisher gave it, `at` the instant of its publication.
    pub fn push(&mut self, topic: &str, sequence: u64, at: Stamp, payload: &[u8]) {
        if let Some(node) = topic.strip_suffix("/steps") {
            match from_cdr::<StepJournal>(payload) {
                Ok(message) => self
                    .journals
                    .entry(node.to_owned())
                    .or_default()
                    .push(&message),
                Err(_) => self.unreadable_journals += 1,
            }
            return;
        }
        self.topics
            .entry(topic.to_owned())
            .or_default()
            .push(Publication {
                sequence,
                at,
                payload: payload.to_vec(),
            });
    }

    /// Nodes that left a journal.
    pub fn journaled(&self) -> impl Iterator<Item = &str> {
        self.journals.keys().map(String::as_str)
    }

    /// The journal of the node that publishes a topic: one that is replayed, or the one that the table of topics names.
    fn producer(&self, topic: &str, replayed: &Speakers) -> Option<&NodeJournal> {
        let name = match replayed.get(topic) {
            Some(name) => name,
            None => topics::by_name(topic)?.producer,
        };
        self.journals.get(name)
    }

    /// Every message by topic and number. A publisher with a journal tells its restarts by their instants; another one by
    /// counting from the beginning again, which a latched message that was recorded twice does not.
    fn keyed(&self, replayed: &Speakers) -> Keyed<'_> {
        self.topics
            .iter()
            .map(|(topic, publications)| {
                let journal = self.producer(topic, replayed);
                let (mut restart, mut first) = (0, None);
                let by_key = publications.iter().map(|one| {
                    restart = match journal {
                        Some(journal) => journal.process_at(one.at),
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

/// The node that publishes each topic of the replayed ones.
type Speakers = BTreeMap<&'static str, &'static str>;

type Keyed<'a> = BTreeMap<&'a str, BTreeMap<Key, &'a Publication>>;

/// A recording, and its messages by number.
struct Session<'a> {
    recording: &'a Recording,
    replayed: Speakers,
    keyed: Keyed<'a>,
}

impl<'a> Session<'a> {
    fn new(recording: &'a Recording, nodes: &[Box<dyn Instance>]) -> Self {
        let replayed = nodes
            .iter()
            .flat_map(|node| node.outputs().iter().map(|topic| (topic.name, node.name())))
            .collect();
        let keyed = recording.keyed(&replayed);
        Self {
            recording,
            replayed,
            keyed,
        }
    }

    fn producer(&self, topic: &str) -> Option<&NodeJournal> {
        self.recording.producer(topic, &self.replayed)
    }

    fn payload(&self, topic: &str, key: Key) -> Option<&'a [u8]> {
        Some(&self.keyed.get(topic)?.get(&key)?.payload)
    }

    /// What a replayed node said after the last step of its journal, so that those who heard it can go on.
    fn unjournaled(&self, topic: &str, key: Key) -> Option<&'a [u8]> {
        let publication = self.keyed.get(topic)?.get(&key)?;
        self.producer(topic)?
            .is_behind(key.0, publication.at)
            .then_some(publication.payload.as_slice())
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

struct Player<'a> {
    node: Box<dyn Instance>,
    incarnation: u32,
    steps: &'a [(u32, Step)],
    next: usize,
    pending: BTreeMap<u32, Vec<Stamp>>,
    heard: BTreeMap<u16, Key>,
    said: BTreeMap<&'static str, Key>,
    timers_not_asked_for: u64,
    waits_for: Option<String>,
}

impl Player<'_> {
    fn restart(&mut self, node: Box<dyn Instance>, incarnation: u32, session: &Session<'_>) {
        self.node = node;
        self.incarnation = incarnation;
        self.pending.clear();
        // A new process hears latched messages again. Whom it hears is told by the journals, or else as it was.
        let inputs = self.node.inputs();
        self.heard.retain(|&port, key| {
            key.1 = 0;
            session.producer(inputs[usize::from(port)].name).is_none()
        });
        for key in self.said.values_mut() {
            *key = (key.0 + 1, 0);
        }
    }

    /// The key of a heard number: within one process numbers grow, and one that begins again is another process.
    fn key(&self, step: Step, topic: &str, session: &Session<'_>) -> Key {
        match self.heard.get(&step.port) {
            Some(&(restart, last)) if step.sequence <= last && step.sequence == 1 => {
                (restart + 1, 1)
            }
            Some(&(restart, _)) => (restart, step.sequence),
            None => {
                let restart = session
                    .producer(topic)
                    .map_or(0, |journal| journal.process_at(step.now));
                (restart, step.sequence)
            }
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
    let session = Session::new(recording, &nodes);
    let mut players: Vec<Player<'_>> = nodes
        .into_iter()
        .map(|node| Player {
            steps: recording
                .journals
                .get(node.name())
                .map_or(&[], |journal| journal.steps.as_slice()),
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
    let mut comparison = Comparison::new(&session);
    let mut said: BTreeMap<(&'static str, Key), Vec<u8>> = BTreeMap::new();
    let mut progress = true;
    while progress {
        progress = false;
        for index in 0..players.len() {
            while let Some(emitted) = advance(
                &mut players[index],
                &factories[index],
                &session,
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
    player: &mut Player<'_>,
    factory: &Factory,
    session: &Session<'_>,
    wiring: &Wiring,
    said: &BTreeMap<(&'static str, Key), Vec<u8>>,
) -> Option<Emitted> {
    let &(incarnation, step) = player.steps.get(player.next)?;
    if incarnation != player.incarnation {
        player.restart(factory(), incarnation, session);
    }
    let emitted = if step.port == TIMER_PORT {
        let id = step.sequence as u32;
        player.take_timer(step.now, id);
        player.node.timer(step.now, id)
    } else {
        let topic = player.node.inputs().get(usize::from(step.port))?;
        let key = player.key(step, topic.name, session);
        let payload = if wiring.producer(topic.name).is_some() {
            said.get(&(topic.name, key))
                .map(Vec::as_slice)
                .or_else(|| session.unjournaled(topic.name, key))
        } else {
            session.payload(topic.name, key)
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
    player: &mut Player<'_>,
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
    session: &'a Session<'a>,
    compared: BTreeMap<&'static str, (u64, u64, u64)>,
    first: Option<Difference>,
}

impl<'a> Comparison<'a> {
    fn new(session: &'a Session<'a>) -> Self {
        Self {
            session,
            compared: BTreeMap::new(),
            first: None,
        }
    }

    fn compare(&mut self, topic: &Topic, key: Key, at: Stamp, recomputed: &[u8]) {
        let (topic, message) = (topic.name, topic.message);
        let counts = self.compared.entry(topic).or_default();
        let Some(recorded) = self.session.payload(topic, key) else {
            counts.2 += 1;
            return;
        };
        // DDS pads the end of a payload, so a message that differs is looked at in its canonical bytes.
        if recorded == recomputed
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
                recorded: recorded.to_vec(),
                recomputed: recomputed.to_vec(),
            });
        }
    }

    fn report(self, players: &[Player<'_>]) -> Report {
        let nodes: Vec<NodeReport> = players
            .iter()
            .map(|player| {
                let journal = self.session.recording.journals.get(player.node.name());
                let beyond = journal.map_or(0, |journal| journal.beyond);
                let gap = journal.and_then(|journal| journal.gap.clone());
                NodeReport {
                    node: player.node.name().to_owned(),
                    steps: player.next as u64,
                    steps_left: (player.steps.len() - player.next) as u64 + beyond,
                    timers_not_asked_for: player.timers_not_asked_for,
                    waits_for: player.waits_for.clone().or(gap),
                }
            })
            .collect();
        let mut topics = Vec::new();
        for player in players {
            for topic in player.node.outputs() {
                let (equal, different, not_recorded) =
                    self.compared.get(topic.name).copied().unwrap_or_default();
                let recorded = self
                    .session
                    .keyed
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
            || self.session.recording.unreadable_journals > 0;
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
