//! Recomputes every node of a recorded session and compares what it publishes with what was recorded.
//!
//! Each node gets exactly the inputs that its journal lists, at the instants that its process passed as `now`. An input
//! on a topic of another replayed node is what that node publishes *now*; only inputs from outside come from the
//! recording. So nothing in the recording can stand in for a message that a node fails to publish in the replay. The one
//! exception is what a killed process published in its last tenth of a second, whose steps are in no journal: that is
//! taken as recorded, and the replay is called incomplete.

mod recording;
mod report;

use std::collections::BTreeMap;

use crate::{
    Emitted, Instance, START, Stamp, Topic, Wiring, WiringError,
    journal::{Step, TIMER_PORT},
};

pub use recording::Recording;
use recording::{Key, Keyed, Listed, NodeJournal, Producers, UNJOURNALED};
pub use report::{Difference, NodeReport, Report, TopicReport, Verdict};

/// A recording, and its messages by number.
struct Session<'a> {
    recording: &'a Recording,
    replayed: Producers,
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

    /// The place of a process of a node among those that left a journal.
    fn place(&self, node: &str, incarnation: u32) -> u32 {
        let journal = self.recording.journals.get(node);
        journal.map_or(0, |journal| journal.place(incarnation))
    }

    fn payload(&self, topic: &str, key: Key) -> Option<&'a [u8]> {
        Some(&self.keyed.get(topic)?.get(&key)?.payload)
    }

    /// What a step took from outside.
    fn input(&self, topic: &str, key: Key, listed: &Listed) -> Option<&'a [u8]> {
        let publication = self.keyed.get(topic)?.get(&key)?;
        (!publication.is_after(listed)).then_some(publication.payload.as_slice())
    }

    /// The recording holds this publication, from an instant on.
    fn is_published(&self, topic: &str, key: Key, now: Stamp) -> bool {
        let found = self.keyed.get(topic).and_then(|topic| topic.get(&key));
        found.is_some_and(|publication| publication.at <= now)
    }

    /// What a replayed node published after the last step of its journal, so that its subscribers can continue.
    fn unjournaled(&self, topic: &str, key: Key) -> Option<&'a [u8]> {
        let publication = self.keyed.get(topic)?.get(&key)?;
        self.producer(topic)?
            .is_behind(key.0, publication.at)
            .then_some(publication.payload.as_slice())
    }
}

/// Creates a node at its start; called once for each start in the session.
pub type Factory = Box<dyn Fn() -> Box<dyn Instance>>;

struct Player<'a> {
    node: Box<dyn Instance>,
    incarnation: u32,
    steps: &'a [Listed],
    next: usize,
    pending: BTreeMap<u32, Vec<Stamp>>,
    received: BTreeMap<u16, Key>,
    published: BTreeMap<&'static str, Key>,
    timers_not_asked_for: u64,
    waits_for: Option<String>,
}

impl Player<'_> {
    fn restart(&mut self, node: Box<dyn Instance>, incarnation: u32, session: &Session<'_>) {
        self.node = node;
        self.incarnation = incarnation;
        self.pending.clear();
        // A new process receives latched messages again. Their publisher's process is known from its journal; without one
        // it stays the same.
        let inputs = self.node.inputs();
        self.received.retain(|&port, key| {
            key.1 = 0;
            session.producer(inputs[usize::from(port)].name).is_none()
        });
        let place = session.place(self.node.name(), incarnation);
        for key in self.published.values_mut() {
            *key = (place, 0);
        }
    }

    /// The key of a number received: within one process numbers increase, and one that begins again is another process.
    fn key(&self, step: Step, topic: &str, session: &Session<'_>) -> Key {
        let at = || {
            let journal = session.producer(topic)?;
            Some(journal.process_at(step.now))
        };
        match self.received.get(&step.port) {
            // Of a process that was killed before its first journal.
            Some(&(restart, last))
                if step.sequence == 1
                    && step.sequence <= last
                    && session.is_published(topic, (restart | UNJOURNALED, 1), step.now)
                    && at().is_some_and(|process| process == restart) =>
            {
                (restart | UNJOURNALED, 1)
            }
            // From the latest process that has published this number: all that processes in between published may have been lost on
            // the way. Otherwise it is a repetition, or the next message of the process before.
            Some(&(restart, last)) => {
                let former = restart & !UNJOURNALED;
                let running = at();
                let published = |process: &u32| {
                    session.is_published(topic, (*process, step.sequence), step.now)
                };
                let later = running.and_then(|latest| (former + 1..=latest).rev().find(published));
                // The recording may lack the first message of the next process.
                let begins = step.sequence == 1
                    && step.sequence <= last
                    && running.is_none_or(|process| process > former);
                let next = begins.then_some(former + 1);
                (later.or(next).unwrap_or(restart), step.sequence)
            }
            None => (at().unwrap_or(0), step.sequence),
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
///
/// # Errors
/// Two producers of a topic, or two types on it.
pub fn replay(recording: &Recording, factories: &[Factory]) -> Result<Report, WiringError> {
    let nodes: Vec<Box<dyn Instance>> = factories.iter().map(|make| make()).collect();
    let wiring = Wiring::of(&nodes)?;
    let session = Session::new(recording, &nodes);
    let mut players: Vec<Player<'_>> = nodes
        .into_iter()
        .map(|node| {
            let steps = recording
                .journals
                .get(node.name())
                .map_or(&[][..], |journal| journal.steps.as_slice());
            // A recording may begin with a process that is not the first of its node.
            let incarnation = steps.first().map_or(0, |listed| listed.incarnation);
            let place = session.place(node.name(), incarnation);
            Player {
                steps,
                incarnation,
                next: 0,
                pending: BTreeMap::new(),
                received: BTreeMap::new(),
                published: node
                    .outputs()
                    .iter()
                    .map(|topic| (topic.name, (place, 0)))
                    .collect(),
                timers_not_asked_for: 0,
                waits_for: None,
                node,
            }
        })
        .collect();
    let mut comparison = Comparison::new(&session);
    let mut published = Published::default();
    let mut progress = true;
    while progress {
        progress = false;
        for index in 0..players.len() {
            while let Some(emitted) = advance(
                &mut players[index],
                &factories[index],
                &session,
                &wiring,
                &published,
            ) {
                progress = true;
                let now = players[index].steps[players[index].next - 1].step.now;
                settle(
                    &mut players[index],
                    emitted,
                    now,
                    &mut comparison,
                    &mut published,
                );
            }
        }
    }
    Ok(comparison.report(&players))
}

/// What the nodes have published. What is equal to the recording is not kept a second time.
#[derive(Default)]
struct Published {
    /// Number of the last message of each process of the producer of a topic.
    last: BTreeMap<(&'static str, u32), u64>,
    /// Messages that are other than recorded, or not recorded.
    other: BTreeMap<(&'static str, Key), Vec<u8>>,
}

impl Published {
    fn payload<'a>(
        &'a self,
        topic: &'static str,
        key: Key,
        session: &Session<'a>,
    ) -> Option<&'a [u8]> {
        let other = self.other.get(&(topic, key)).map(Vec::as_slice);
        let is_there = || {
            self.last
                .get(&(topic, key.0))
                .is_some_and(|&last| key.1 <= last)
        };
        other.or_else(|| session.payload(topic, key).filter(|_| is_there()))
    }
}

/// One step of a player, or `None` when its next input is not there (yet).
fn advance(
    player: &mut Player<'_>,
    factory: &Factory,
    session: &Session<'_>,
    wiring: &Wiring,
    published: &Published,
) -> Option<Emitted> {
    let listed = player.steps.get(player.next)?;
    let &Listed {
        incarnation, step, ..
    } = listed;
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
            published
                .payload(topic.name, key, session)
                .or_else(|| session.unjournaled(topic.name, key))
        } else {
            session.input(topic.name, key, listed)
        };
        let Some(payload) = payload else {
            player.waits_for = Some(format!("message {} on {}", step.sequence, topic.name));
            return None;
        };
        player.received.insert(step.port, key);
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
    published: &mut Published,
) {
    for (at, id) in emitted.timers {
        player.pending.entry(id).or_default().push(at.max(now));
    }
    for (port, payload) in emitted.messages {
        let described = &player.node.outputs()[port];
        let topic = described.name;
        let key = player.published.entry(topic).or_insert((0, 0));
        key.1 += 1;
        published.last.insert((topic, key.0), key.1);
        if !comparison.compare(described, *key, now, &payload) {
            published.other.insert((topic, *key), payload);
        }
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

    /// True where the recording has the same bytes.
    fn compare(&mut self, topic: &Topic, key: Key, at: Stamp, recomputed: &[u8]) -> bool {
        let (topic, message) = (topic.name, topic.message);
        let counts = self.compared.entry(topic).or_default();
        let Some(recorded) = self.session.payload(topic, key) else {
            counts.2 += 1;
            return false;
        };
        let same = recorded == recomputed;
        // DDS pads the end of a payload, so a message that differs is looked at in its canonical bytes.
        if same
            || message
                .canonical(recorded)
                .is_ok_and(|canonical| canonical == recomputed)
        {
            counts.0 += 1;
            return same;
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
        false
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
                .flat_map(|player| player.steps.iter().map(|listed| listed.step.now))
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
