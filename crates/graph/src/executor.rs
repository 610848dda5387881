//! The graph on virtual time: nodes in one thread, no bus, no clock.
//!
//! Events happen in a total order: their instant, then the order in which they were caused. A publication reaches each
//! subscriber at the instant it is made, subscribers in the order the nodes were given. The run is therefore a function
//! of the configurations and of what is injected, and two runs are equal byte for byte.

mod processes;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use probecell_msgs::to_cdr;

use crate::{
    Emitted, Instance, START, Stamp, Topic, Wiring, WiringError,
    journal::{Journal, Step, TIMER_PORT},
    topics,
};

/// One publication on a topic of the graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Published {
    /// Topic name below the cell's namespace.
    pub topic: String,
    /// Number of the publication on its topic, from 1.
    pub sequence: u64,
    /// When it was published.
    pub at: Stamp,
    /// CDR payload.
    pub payload: Vec<u8>,
}

/// The way of messages to their subscribers.
pub trait Link {
    /// Instants at which a publication of `now` reaches a subscriber, by [`Executor::now`]: none when it is lost on the way,
    /// several when it comes more than once. An earlier instant stands for now.
    fn arrivals(
        &mut self,
        now: Stamp,
        published: &Published,
        subscriber: &'static str,
    ) -> Vec<Stamp>;

    /// A publication has reached a subscriber, which has made a step of it.
    fn taken(&mut self, now: Stamp, topic: &str, payload: &[u8], subscriber: &'static str);
}

enum Event {
    Timer {
        node: usize,
        id: u32,
    },
    External {
        topic: String,
        payload: Vec<u8>,
    },
    Arrival {
        to: (usize, usize),
        sequence: u64,
        payload: Vec<u8>,
        /// Node that published it, where it is not the first to arrive.
        repeat_of: Option<usize>,
    },
}

impl Event {
    /// The node that makes a step of it.
    fn node(&self) -> Option<usize> {
        match self {
            Self::Timer { node, .. } | Self::Arrival { to: (node, _), .. } => Some(*node),
            Self::External { .. } => None,
        }
    }
}

/// Runs a graph of nodes on virtual time.
pub struct Executor {
    nodes: Vec<Box<dyn Instance>>,
    wiring: Wiring,
    journals: Vec<Journal>,
    queue: BTreeMap<(Stamp, u64), Event>,
    next_cause: u64,
    counts: BTreeMap<String, u64>,
    now: Stamp,
    log: Vec<Published>,
    /// Latched messages of each topic, number and payload, oldest first; they end with the process of their producer.
    retained: BTreeMap<String, VecDeque<(u64, Vec<u8>)>>,
    /// Nodes whose process has ended and has not been started again.
    ended: BTreeSet<usize>,
    /// Of those, the nodes that have never been started.
    unstarted: BTreeSet<usize>,
    /// Nodes whose process is paused, with the inputs that it finds when it resumes.
    paused: BTreeMap<usize, Vec<Event>>,
    /// ns by which the clock of a node is ahead.
    clocks: Vec<i64>,
    link: Option<Box<dyn Link>>,
}

impl Executor {
    /// A graph whose nodes all start at `start`.
    ///
    /// # Errors
    /// Two producers of a topic, or two types on it.
    pub fn new(nodes: Vec<Box<dyn Instance>>, start: Stamp) -> Result<Self, WiringError> {
        let wiring = Wiring::of(&nodes)?;
        let journals = nodes
            .iter()
            .map(|node| Journal::new(node.name(), 0))
            .collect();
        let mut executor = Self {
            nodes,
            wiring,
            journals,
            queue: BTreeMap::new(),
            next_cause: 0,
            counts: BTreeMap::new(),
            now: start,
            log: Vec::new(),
            retained: BTreeMap::new(),
            ended: BTreeSet::new(),
            unstarted: BTreeSet::new(),
            paused: BTreeMap::new(),
            clocks: Vec::new(),
            link: None,
        };
        executor.clocks.resize(executor.nodes.len(), 0);
        for node in 0..executor.nodes.len() {
            executor.schedule(start, Event::Timer { node, id: START });
        }
        Ok(executor)
    }

    /// The same with another way of messages than the one without delay or loss.
    #[must_use]
    pub fn over(mut self, link: Box<dyn Link>) -> Self {
        self.link = Some(link);
        self
    }

    /// The instant of the last event.
    pub fn now(&self) -> Stamp {
        self.now
    }

    /// The nodes, in the order given.
    pub fn nodes(&self) -> &[Box<dyn Instance>] {
        &self.nodes
    }

    /// Replaces the state of node `name` by a snapshot.
    ///
    /// # Errors
    /// A snapshot that is not a state of the node.
    pub fn restore(
        &mut self,
        name: &str,
        snapshot: serde_json::Value,
    ) -> Result<(), crate::RestoreError> {
        for node in &mut self.nodes {
            if node.name() == name {
                return node.restore(snapshot);
            }
        }
        Ok(())
    }

    fn position(&self, name: &str) -> Option<usize> {
        self.nodes.iter().position(|node| node.name() == name)
    }

    /// Publishes a message from outside the graph at `at` (never before [`Executor::now`]).
    pub fn inject(&mut self, at: Stamp, topic: impl Into<String>, payload: Vec<u8>) {
        self.schedule(
            at.max(self.now),
            Event::External {
                topic: topic.into(),
                payload,
            },
        );
    }

    /// Runs events in order until the next one is later than `until`, or none remains. True when events remain.
    pub fn run_until(&mut self, until: Stamp) -> bool {
        while let Some((&(at, order), _)) = self.queue.first_key_value() {
            if at > until {
                return true;
            }
            self.run_event((at, order));
        }
        false
    }

    /// Runs the next event, unless it is later than `until`. True when there was one.
    pub fn step(&mut self, until: Stamp) -> bool {
        let next = self.queue.first_key_value().map(|(&key, _)| key);
        let due = next.filter(|(at, _)| *at <= until);
        if let Some(key) = due {
            self.run_event(key);
        }
        due.is_some()
    }

    /// Publications that [`Executor::take_log`] has not taken yet, in the order made.
    pub fn log(&self) -> &[Published] {
        &self.log
    }

    /// Runs until a message is published on `topic`, the queue is empty or `until` has passed. True when it was published.
    pub fn run_until_published(&mut self, topic: &str, until: Stamp) -> bool {
        let before = self.counts.get(topic).copied().unwrap_or(0);
        while let Some((&(at, order), _)) = self.queue.first_key_value() {
            if at > until {
                return false;
            }
            self.run_event((at, order));
            if self.counts.get(topic).copied().unwrap_or(0) > before {
                return true;
            }
        }
        false
    }

    /// Takes all publications so far, journals included, in the order made.
    pub fn take_log(&mut self) -> Vec<Published> {
        for index in 0..self.journals.len() {
            if let Some(message) = self.journals[index].take() {
                let topic = topics::journal_name(self.nodes[index].name());
                self.record(&topic, to_cdr(&message));
            }
        }
        std::mem::take(&mut self.log)
    }

    fn schedule(&mut self, at: Stamp, event: Event) {
        self.queue.insert((at, self.next_cause), event);
        self.next_cause += 1;
    }

    fn run_event(&mut self, key: (Stamp, u64)) {
        let Some(event) = self.queue.remove(&key) else {
            return;
        };
        self.now = key.0;
        if let Some(held) = event.node().and_then(|node| self.paused.get_mut(&node)) {
            held.push(event);
            return;
        }
        match event {
            Event::Timer { node, id } => self.run_timer(node, id),
            Event::External { topic, payload } => self.publish(&topic, &payload),
            Event::Arrival {
                to,
                sequence,
                payload,
                ..
            } => self.deliver(to, sequence, &payload),
        }
    }

    /// Now, by the clock of a node.
    fn clock(&self, node: usize) -> Stamp {
        Stamp(self.now.0 + self.clocks[node])
    }

    fn run_timer(&mut self, node: usize, id: u32) {
        let now = self.clock(node);
        self.journals[node].push(Step {
            now,
            port: TIMER_PORT,
            sequence: u64::from(id),
        });
        let emitted = self.nodes[node].timer(now, id);
        self.settle(node, emitted);
    }

    fn deliver(&mut self, (node, port): (usize, usize), sequence: u64, payload: &[u8]) {
        if self.ended.contains(&node) {
            return;
        }
        // A payload that the node cannot read makes no step: the live process refuses it in the same way.
        let now = self.clock(node);
        if let Ok(emitted) = self.nodes[node].deliver(now, port, payload) {
            self.journals[node].push(Step {
                now,
                port: port as u16,
                sequence,
            });
            if let Some(link) = &mut self.link {
                let topic = self.nodes[node].inputs()[port].name;
                link.taken(self.now, topic, payload, self.nodes[node].name());
            }
            self.settle(node, emitted);
        }
    }

    fn settle(&mut self, node: usize, emitted: Emitted) {
        let outputs: &'static [Topic] = self.nodes[node].outputs();
        for (at, id) in emitted.timers {
            let at = Stamp(at.0 - self.clocks[node]).max(self.now);
            self.schedule(at, Event::Timer { node, id });
        }
        for (port, payload) in emitted.messages {
            // Through the queue, at this instant, so that a step ends before what it caused begins.
            self.schedule(
                self.now,
                Event::External {
                    topic: outputs[port].name.to_owned(),
                    payload,
                },
            );
        }
    }

    fn record(&mut self, topic: &str, payload: Vec<u8>) -> u64 {
        let count = self.counts.entry(topic.to_owned()).or_insert(0);
        *count += 1;
        let sequence = *count;
        let node = topic
            .strip_suffix("/steps")
            .and_then(|name| self.position(name));
        let producer = node.or_else(|| self.wiring.producer(topic));
        let at = producer.map_or(self.now, |node| self.clock(node));
        self.log.push(Published {
            topic: topic.to_owned(),
            sequence,
            at,
            payload,
        });
        sequence
    }

    fn publish(&mut self, topic: &str, payload: &[u8]) {
        let sequence = self.record(topic, payload.to_vec());
        self.retain(topic, sequence, payload);
        let listeners = self.wiring.subscribers(topic).to_vec();
        let Some(mut link) = self.link.take() else {
            for listener in listeners {
                self.deliver(listener, sequence, payload);
            }
            return;
        };
        let published = self.log[self.log.len() - 1].clone();
        for to in listeners {
            if self.ended.contains(&to.0) {
                continue;
            }
            let arrivals = link.arrivals(self.now, &published, self.nodes[to.0].name());
            for (index, at) in arrivals.into_iter().enumerate() {
                let event = Event::Arrival {
                    to,
                    sequence,
                    payload: payload.to_vec(),
                    repeat_of: self.wiring.producer(topic).filter(|_| index > 0),
                };
                self.schedule(at.max(self.now), event);
            }
        }
        self.link = Some(link);
    }

    /// Keeps a message of a latched topic for late subscribers.
    fn retain(&mut self, topic: &str, sequence: u64, payload: &[u8]) {
        let declared = self.nodes.iter().flat_map(|node| node.outputs());
        let declared = declared.copied().find(|known| known.name == topic);
        let Some(qos) = topics::by_name(topic).or(declared).map(|topic| topic.qos) else {
            return;
        };
        if let (true, Some(depth)) = (qos.transient_local, qos.depth) {
            let kept = self.retained.entry(topic.to_owned()).or_default();
            kept.push_back((sequence, payload.to_vec()));
            while kept.len() > depth as usize {
                kept.pop_front();
            }
        }
    }

    /// Topics with subscribers but without a producer among the nodes of the graph.
    pub fn external_topics(&self) -> BTreeSet<&'static str> {
        self.wiring
            .subscribers
            .keys()
            .copied()
            .filter(|topic| self.wiring.producer(topic).is_none())
            .collect()
    }
}
