//! The graph on virtual time: nodes in one thread, no bus, no clock.
//!
//! Events happen in a total order: their instant, then the order in which they were caused. A publication reaches each
//! subscriber at the instant it is made, subscribers in the order the nodes were given. The run is therefore a function
//! of the configurations and of what is injected, and two runs are equal byte for byte.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use probecell_msgs::to_cdr;

use crate::{
    Emitted, Instance, START, Stamp, Topic,
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

/// A graph that cannot be wired.
#[derive(Debug, thiserror::Error)]
pub enum WiringError {
    /// Two nodes publish one topic.
    #[error("topic {topic} has two producers: {first} and {second}")]
    TwoProducers {
        /// The topic.
        topic: &'static str,
        /// The first producer.
        first: &'static str,
        /// The second producer.
        second: &'static str,
    },
    /// A node subscribes to a topic with another type than its producer's.
    #[error("{node} subscribes to {topic} as {expected}, but {published} is published on it")]
    TypeMismatch {
        /// The topic.
        topic: &'static str,
        /// The subscriber.
        node: &'static str,
        /// The type it expects.
        expected: &'static str,
        /// The type that is published.
        published: &'static str,
    },
}

/// The subscribers and the producer of every topic, from the ports of the nodes.
#[derive(Debug, Default)]
pub struct Wiring {
    /// Topic name to (node index, input port), in the order of the nodes.
    subscribers: BTreeMap<&'static str, Vec<(usize, usize)>>,
    /// Topic name to the node that publishes it.
    producers: BTreeMap<&'static str, usize>,
}

impl Wiring {
    /// Joins the nodes' ports by topic name.
    pub fn of(nodes: &[Box<dyn Instance>]) -> Result<Self, WiringError> {
        let mut wiring = Self::default();
        let mut types: BTreeMap<&str, &str> = BTreeMap::new();
        for (index, node) in nodes.iter().enumerate() {
            for topic in node.outputs() {
                if let Some(first) = wiring.producers.insert(topic.name, index) {
                    let first = nodes[first].name();
                    return Err(WiringError::TwoProducers {
                        topic: topic.name,
                        first,
                        second: node.name(),
                    });
                }
                types.insert(topic.name, topic.message.name);
            }
        }
        for (index, node) in nodes.iter().enumerate() {
            for (port, topic) in node.inputs().iter().enumerate() {
                let published = *types.entry(topic.name).or_insert(topic.message.name);
                if published != topic.message.name {
                    let (topic, expected) = (topic.name, topic.message.name);
                    return Err(WiringError::TypeMismatch {
                        topic,
                        node: node.name(),
                        expected,
                        published,
                    });
                }
                wiring
                    .subscribers
                    .entry(topic.name)
                    .or_default()
                    .push((index, port));
            }
        }
        Ok(wiring)
    }

    /// Node that publishes the topic, if one of the graph does.
    pub fn producer(&self, topic: &str) -> Option<usize> {
        self.producers.get(topic).copied()
    }

    /// Node index and input port of every subscriber of the topic.
    pub fn subscribers(&self, topic: &str) -> &[(usize, usize)] {
        self.subscribers.get(topic).map_or(&[], Vec::as_slice)
    }
}

enum Event {
    Timer { node: usize, id: u32 },
    External { topic: String, payload: Vec<u8> },
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
}

impl Executor {
    /// A graph whose nodes all start at `start`.
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
        };
        for node in 0..executor.nodes.len() {
            executor.schedule(start, Event::Timer { node, id: START });
        }
        Ok(executor)
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

    /// Ends the process of a node at this instant, as SIGKILL does: its state, its timers and its latched messages are lost, and
    /// nothing reaches it until [`Executor::restart`].
    pub fn kill(&mut self, name: &str) {
        let Some(node) = self.nodes.iter().position(|node| node.name() == name) else {
            return;
        };
        // What it has published is delivered.
        self.run_until(self.now);
        let journal = topics::journal_name(name);
        if let Some(message) = self.journals[node].take() {
            self.record(&journal, to_cdr(&message));
        }
        for topic in self.nodes[node].outputs() {
            self.retained.remove(topic.name);
        }
        self.queue.retain(
            |_, event| !matches!(event, Event::Timer { node: owner, .. } if *owner == node),
        );
        self.ended.insert(node);
    }

    /// Restarts a node, as the launcher does when its process has ended: its state, its timers and its latched messages
    /// are lost, and its publications are numbered from 1 again. It receives the latched messages of the others.
    pub fn restart(&mut self, fresh: Box<dyn Instance>) {
        let Some(node) = self
            .nodes
            .iter()
            .position(|node| node.name() == fresh.name())
        else {
            return;
        };
        self.kill(fresh.name());
        self.ended.remove(&node);
        self.now = Stamp(self.now.0 + 1);
        let journal = topics::journal_name(fresh.name());
        self.journals[node] = Journal::new(fresh.name(), self.journals[node].incarnation() + 1);
        for topic in fresh.outputs() {
            self.counts.remove(topic.name);
        }
        self.counts.remove(&journal);
        self.nodes[node] = fresh;
        self.run_timer(node, START);
        for port in 0..self.nodes[node].inputs().len() {
            let topic = self.nodes[node].inputs()[port].name;
            let latched = self.retained.get(topic).cloned().unwrap_or_default();
            for (sequence, payload) in latched {
                self.deliver((node, port), sequence, &payload);
            }
        }
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
        match event {
            Event::Timer { node, id } => self.run_timer(node, id),
            Event::External { topic, payload } => self.publish(&topic, &payload),
        }
    }

    fn run_timer(&mut self, node: usize, id: u32) {
        self.journals[node].push(Step {
            now: self.now,
            port: TIMER_PORT,
            sequence: u64::from(id),
        });
        let emitted = self.nodes[node].timer(self.now, id);
        self.settle(node, emitted);
    }

    fn deliver(&mut self, (node, port): (usize, usize), sequence: u64, payload: &[u8]) {
        if self.ended.contains(&node) {
            return;
        }
        // A payload that the node cannot read makes no step: the live process refuses it in the same way.
        if let Ok(emitted) = self.nodes[node].deliver(self.now, port, payload) {
            self.journals[node].push(Step {
                now: self.now,
                port: port as u16,
                sequence,
            });
            self.settle(node, emitted);
        }
    }

    fn settle(&mut self, node: usize, emitted: Emitted) {
        let outputs: &'static [Topic] = self.nodes[node].outputs();
        for (at, id) in emitted.timers {
            self.schedule(at.max(self.now), Event::Timer { node, id });
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
        self.log.push(Published {
            topic: topic.to_owned(),
            sequence,
            at: self.now,
            payload,
        });
        sequence
    }

    fn publish(&mut self, topic: &str, payload: &[u8]) {
        let sequence = self.record(topic, payload.to_vec());
        self.retain(topic, sequence, payload);
        for listener in self.wiring.subscribers(topic).to_vec() {
            self.deliver(listener, sequence, payload);
        }
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
