//! Who publishes and who subscribes to each topic, from the ports of the nodes.

use std::collections::BTreeMap;

use crate::Instance;

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
    pub(crate) subscribers: BTreeMap<&'static str, Vec<(usize, usize)>>,
    /// Topic name to the node that publishes it.
    producers: BTreeMap<&'static str, usize>,
}

impl Wiring {
    /// Joins the nodes' ports by topic name.
    ///
    /// # Errors
    /// Two producers of a topic, or two types on it.
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
