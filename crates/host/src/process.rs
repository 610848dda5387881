//! Drives one node: messages and timers in, publications and the step journal out.
//!
//! One thread makes all steps, so a node is never entered twice. Messages wait in one queue in the order in which they
//! arrive; the instant given as `now` never goes back. What a step publishes goes out before the next step begins, and
//! then the step goes to the journal, in batches.

use std::{
    collections::BTreeMap,
    sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel},
    time::{Duration, Instant},
};

use graph::{
    Emitted, Instance, START, Stamp,
    journal::{Journal, Step, TIMER_PORT},
    topics,
};
use probecell_msgs::to_cdr;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tracing::{error, warn};

use crate::{
    bus::{self, Bus, BusError, Lost, Publisher, Received, Subscription, TypeId},
    clock::{self, now},
    sim_time::Member,
    topology::{bus_qos, wait_for_subscriptions},
};

/// Most descriptors of a process.
const DESCRIPTORS: u64 = 65_536;

/// Steps after which a batch of the journal goes out.
const JOURNAL_STEPS: usize = 256;
/// After which a batch goes out even if it is small.
const JOURNAL_AGE: Duration = Duration::from_millis(100);
/// Batches that a publisher keeps for a recorder behind a link that is cut: two minutes of a node that is always busy. Kept
/// by number of steps they would grow for a quarter of an hour, half a megabyte a minute.
const JOURNAL_KEPT: usize = 1_200;
/// Most messages taken before timers are checked again.
const BURST: usize = 256;
/// Timeout of the start, in which the other processes of the cell subscribe.
const START_TIMEOUT: Duration = Duration::from_secs(20);
/// Timeout of the end, in which what was published is written out.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(5);

/// Asks a process to end; clones ask the same one.
#[derive(Clone)]
pub struct Stop(Sender<Event>);

impl Stop {
    /// Ends the process after the step it is in.
    pub fn stop(&self) {
        // A process that has ended already needs no stop.
        drop(self.0.send(Event::Stop));
    }
}

/// Settings of a process.
#[derive(Clone, Debug)]
pub struct NodeProcess {
    /// Namespace of the cell, with its slash.
    pub namespace: String,
    /// Starts of this node in this session before this one.
    pub incarnation: u32,
    /// Subscriptions that each topic (relative name) must have before the first step of its publisher. With a journal among
    /// them the cell is recorded, and a node subscribes to nothing before the recorder has.
    pub awaited: BTreeMap<String, usize>,
}

/// Why a process ended.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The launcher, which keeps the simulated clock, cannot be reached.
    #[error("the simulated clock of the cell is gone: {0}")]
    Clock(#[from] std::io::Error),
}

enum Event {
    Message {
        port: usize,
        sequence: u64,
        payload: Vec<u8>,
    },
    Lost {
        port: usize,
        lost: Lost,
    },
    /// A timer is due by the simulated clock.
    Wake,
    Stop,
}

/// Runs `node` on `bus` until it is stopped. `hand_over` is given the means to stop it before anything else.
///
/// # Errors
/// What the bus says, or a recorder that does not come.
pub fn run_node(
    bus: Bus,
    node: Box<dyn Instance>,
    settings: &NodeProcess,
    hand_over: impl FnOnce(Stop),
) -> Result<(), ProcessError> {
    let (sender, receiver) = channel();
    hand_over(Stop(sender.clone()));
    let begun = Instant::now();
    // Others may publish already: what this node takes has to be in the recording.
    let recorder = awaited_of_recorder(node.as_ref(), settings);
    if let Some(topic) = wait_for_subscriptions(&bus, &recorder, START_TIMEOUT) {
        warn!(
            "{} subscribes, although nobody records {topic}",
            node.name()
        );
    }
    let mut process = Process::join(&bus, node, settings, &sender)?;
    let left = START_TIMEOUT.saturating_sub(begun.elapsed());
    if let Some(topic) = wait_for_subscriptions(&bus, &process.awaited(settings), left) {
        warn!(
            "{} starts, although subscriptions to {topic} are missing",
            process.node.name()
        );
    }
    process.run(&receiver, &sender)?;
    process.publish_journal()?;
    process.leave();
    bus.close(CLOSE_TIMEOUT)?;
    Ok(())
}

/// Absolute topic, type and number of the subscriptions that have to be there before the node subscribes, where it is
/// recorded: to its inputs, and to its journal, which the recorder subscribes to after all of them, and nobody else does.
fn awaited_of_recorder(
    node: &dyn Instance,
    settings: &NodeProcess,
) -> Vec<(String, TypeId, usize)> {
    let journal = topics::journal_name(node.name());
    if !settings.awaited.contains_key(&journal) {
        return Vec::new();
    }
    let inputs = node.inputs().iter();
    inputs
        .map(|topic| (topic.name, topic.message))
        .filter(|(name, _)| settings.awaited.contains_key(*name))
        .chain([(journal.as_str(), topics::JOURNAL.0)])
        .map(|(name, message)| {
            let name = format!("{}/{name}", settings.namespace);
            (name, TypeId::from(message), 1)
        })
        .collect()
}

struct Process {
    node: Box<dyn Instance>,
    namespace: String,
    publishers: Vec<Publisher>,
    journal_publisher: Publisher,
    subscriptions: Vec<Subscription>,
    journal: Journal,
    /// When its oldest step was made.
    journal_begun: Option<Instant>,
    timers: BTreeMap<(Stamp, u64), u32>,
    timers_set: u64,
    last: Stamp,
    /// Numbers of the last messages: published, by output and then of the journal; taken, by input.
    published: Vec<u64>,
    taken: Vec<u64>,
}

impl Process {
    fn join(
        bus: &Bus,
        node: Box<dyn Instance>,
        settings: &NodeProcess,
        sender: &Sender<Event>,
    ) -> Result<Self, BusError> {
        let absolute = |name: &str| format!("{}/{name}", settings.namespace);
        let publishers: Vec<Publisher> = node
            .outputs()
            .iter()
            .map(|topic| bus.publisher(&absolute(topic.name), topic.message, bus_qos(topic.qos)))
            .collect::<Result<_, _>>()?;
        let (message, qos) = topics::JOURNAL;
        let journal_publisher = bus.publisher(
            &absolute(&topics::journal_name(node.name())),
            message,
            bus::Qos {
                history: bus::History::KeepLast(JOURNAL_KEPT),
                ..bus_qos(qos)
            },
        )?;
        let mut subscriptions: Vec<Subscription> = Vec::new();
        for (port, topic) in node.inputs().iter().enumerate() {
            let (samples, losses) = (sender.clone(), sender.clone());
            // The queue is gone only at the end, when the message is no longer needed.
            let on_sample = move |received: Received<'_>| {
                let sequence = received.sequence;
                drop(samples.send(Event::Message {
                    port,
                    sequence,
                    payload: received.payload.into_owned(),
                }));
            };
            let on_lost = move |lost| drop(losses.send(Event::Lost { port, lost }));
            subscriptions.push(bus.subscribe(
                &absolute(topic.name),
                topic.message,
                bus_qos(topic.qos),
                Box::new(on_sample),
                Box::new(on_lost),
            )?);
        }
        let journal = Journal::new(node.name(), settings.incarnation);
        let namespace = settings.namespace.clone();
        Ok(Self {
            namespace,
            published: vec![0; publishers.len() + 1],
            taken: vec![0; subscriptions.len()],
            node,
            publishers,
            journal_publisher,
            subscriptions,
            journal,
            journal_begun: None,
            timers: BTreeMap::new(),
            timers_set: 0,
            last: Stamp::default(),
        })
    }

    /// Absolute topic, type and number of subscriptions to wait for.
    fn awaited(&self, settings: &NodeProcess) -> Vec<(String, TypeId, usize)> {
        let journal = topics::journal_name(self.node.name());
        let outputs = self
            .node
            .outputs()
            .iter()
            .map(|topic| (topic.name, topic.message));
        outputs
            .chain([(journal.as_str(), topics::JOURNAL.0)])
            .filter_map(|(name, message)| {
                let count = *settings.awaited.get(name)?;
                Some((
                    format!("{}/{name}", self.namespace),
                    TypeId::from(message),
                    count,
                ))
            })
            .collect()
    }

    fn run(
        &mut self,
        receiver: &Receiver<Event>,
        sender: &Sender<Event>,
    ) -> Result<(), ProcessError> {
        let mut member = self.follow_clock(sender.clone())?;
        let first = self.clock();
        self.timer(first, START)?;
        loop {
            self.fire_due()?;
            // A node that sets a timer at once, for the next slice of long work, gets the messages that arrived meanwhile first.
            let waiting = match receiver.try_recv() {
                Ok(event) => Ok(event),
                Err(TryRecvError::Disconnected) => Err(RecvTimeoutError::Disconnected),
                Err(TryRecvError::Empty) => {
                    if let Some(member) = &mut member {
                        self.rest(member)?;
                    }
                    receiver.recv_timeout(self.time_to_next())
                }
            };
            let first = match waiting {
                Ok(event) => Some(event),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            };
            for event in first.into_iter().chain(receiver.try_iter()).take(BURST) {
                match event {
                    Event::Message {
                        port,
                        sequence,
                        payload,
                    } => self.message(port, sequence, &payload)?,
                    Event::Lost { port, lost } => {
                        self.taken[port] = self.taken[port].max(lost.first + lost.count - 1);
                        let topic = self.node.inputs()[port].name;
                        error!(
                            "{}: lost {} messages on {topic} from number {}",
                            self.node.name(),
                            lost.count,
                            lost.first
                        );
                    }
                    Event::Wake => {}
                    Event::Stop => return Ok(()),
                }
            }
            let age = self.journal_begun.map(|begun| begun.elapsed());
            if self.journal.len() >= JOURNAL_STEPS || age.is_some_and(|age| age >= JOURNAL_AGE) {
                self.publish_journal()?;
            }
        }
    }

    /// Joins the simulated clock of the cell, where it has one.
    fn follow_clock(&self, sender: Sender<Event>) -> std::io::Result<Option<Member>> {
        let names = |topics: &[graph::Topic]| -> Vec<String> {
            topics.iter().map(|topic| topic.name.to_owned()).collect()
        };
        let mut publishes = names(self.node.outputs());
        publishes.push(topics::journal_name(self.node.name()));
        let takes = names(self.node.inputs());
        Member::join(self.node.name(), publishes, takes, move || {
            sender.send(Event::Wake).is_ok()
        })
    }

    /// Reports to the simulated clock that there is nothing to do before the next timer.
    fn rest(&self, member: &mut Member) -> std::io::Result<()> {
        let wake = self.timers.keys().next().map(|&(at, _)| at);
        if wake.is_some_and(|wake| wake <= self.last) {
            return Ok(());
        }
        let (published, taken) = (self.published.iter(), self.taken.iter());
        member.rest(wake, published.copied(), taken.copied())
    }

    /// The instant now, never before the last one given.
    fn clock(&mut self) -> Stamp {
        self.last = self.last.max(now());
        self.last
    }

    /// Until the next timer, or until the journal is due.
    fn time_to_next(&self) -> Duration {
        let journal = self.journal_begun.map_or(Duration::from_secs(1), |begun| {
            JOURNAL_AGE.saturating_sub(begun.elapsed())
        });
        match self.timers.keys().next() {
            // The simulated clock says when it is due.
            Some(&(at, _)) if clock::simulated().is_some() && at > self.last => journal,
            Some(&(at, _)) => {
                journal.min(Duration::from_secs_f64(at.since_s(now()).clamp(0.0, 1.0)))
            }
            None => journal,
        }
    }

    /// Fires the timers that are due. Those that they ask for wait until messages had their turn.
    fn fire_due(&mut self) -> Result<(), BusError> {
        let instant = self.clock();
        let due: Vec<(Stamp, u64)> = (self.timers.range(..=(instant, u64::MAX)))
            .map(|(&key, _)| key)
            .collect();
        for key in due {
            if let Some(id) = self.timers.remove(&key) {
                self.timer(instant, id)?;
            }
        }
        Ok(())
    }

    fn timer(&mut self, instant: Stamp, id: u32) -> Result<(), BusError> {
        let emitted = self.node.timer(instant, id);
        self.settle(
            Step {
                now: instant,
                port: TIMER_PORT,
                sequence: u64::from(id),
            },
            emitted,
        )
    }

    fn message(&mut self, port: usize, sequence: u64, payload: &[u8]) -> Result<(), BusError> {
        let instant = self.clock();
        self.taken[port] = self.taken[port].max(sequence);
        match self.node.deliver(instant, port, payload) {
            Ok(emitted) => self.settle(
                Step {
                    now: instant,
                    port: port as u16,
                    sequence,
                },
                emitted,
            ),
            Err(refused) => {
                error!(
                    "{}: ignored an invalid message: {refused}",
                    self.node.name()
                );
                Ok(())
            }
        }
    }

    fn settle(&mut self, step: Step, emitted: Emitted) -> Result<(), BusError> {
        for (port, payload) in emitted.messages {
            self.published[port] = self.publishers[port].publish(payload, step.now.0)?;
        }
        for (at, id) in emitted.timers {
            self.timers.insert((at, self.timers_set), id);
            self.timers_set += 1;
        }
        self.journal.push(step);
        self.journal_begun.get_or_insert_with(Instant::now);
        Ok(())
    }

    fn publish_journal(&mut self) -> Result<(), BusError> {
        self.journal_begun = None;
        if let Some(message) = self.journal.take() {
            let number = (self.journal_publisher).publish(to_cdr(&message), self.last.0)?;
            self.published[self.publishers.len()] = number;
        }
        Ok(())
    }

    /// Ends the subscriptions before the bus is closed.
    fn leave(&mut self) {
        self.subscriptions.clear();
    }
}

/// Descriptors that this process and those it starts may open: so many as the system allows, at most [`DESCRIPTORS`]. A router holds
/// one for each connection, of strangers too.
pub fn raise_limits() {
    let limit = getrlimit(Resource::Nofile);
    let most = limit
        .maximum
        .map_or(DESCRIPTORS, |most| most.min(DESCRIPTORS));
    if limit.current.is_some_and(|current| current < most) {
        let raised = Rlimit {
            current: Some(most),
            ..limit
        };
        // A system that refuses leaves the process with what it has.
        let _refused = setrlimit(Resource::Nofile, raised);
    }
}

#[cfg(test)]
mod tests {
    use probecell_msgs::StepJournal;

    use super::*;

    /// Two minutes of batches at their usual rate, and at most 8 MiB where every batch is full.
    #[test]
    fn journals_kept_for_recovery_are_bounded_in_time_and_bytes() {
        let full = StepJournal {
            now: vec![0; JOURNAL_STEPS],
            port: vec![0; JOURNAL_STEPS],
            sequence: vec![0; JOURNAL_STEPS],
            ..StepJournal::default()
        };
        assert!(JOURNAL_AGE * JOURNAL_KEPT as u32 >= Duration::from_secs(119));
        assert!(to_cdr(&full).len() * JOURNAL_KEPT <= 8 << 20);
    }
}
