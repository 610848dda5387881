//! A node behind bytes: what a live process and a replay drive alike.

use probecell_msgs::CdrError;

use crate::{FaultCode, Inputs, Node, Outbox, Outputs, Stamp, Topic};

/// The outputs of one step: publications in order, and timers requested.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Emitted {
    /// Output port and CDR payload, in the order published.
    pub messages: Vec<(usize, Vec<u8>)>,
    /// Instant and number of each timer requested.
    pub timers: Vec<(Stamp, u32)>,
}

/// A message that a node could not decode.
#[derive(Debug, thiserror::Error)]
#[error("a message on {topic} is not a {message}")]
pub struct DeliverError {
    topic: &'static str,
    message: &'static str,
    #[source]
    source: CdrError,
}

/// A state that does not belong to the node.
#[derive(Debug, thiserror::Error)]
#[error("the snapshot is not a state of {node}")]
pub struct RestoreError {
    node: &'static str,
    #[source]
    source: serde_json::Error,
}

/// A running node, its types erased.
pub trait Instance: Send {
    /// The node's name.
    fn name(&self) -> &'static str;
    /// Topics it subscribes to, in the order of the port numbers.
    fn inputs(&self) -> &'static [Topic];
    /// Topics it publishes, in the order of the port numbers.
    fn outputs(&self) -> &'static [Topic];
    /// Codes of the faults that it can report.
    fn fault_codes(&self) -> Vec<&'static str>;
    /// One step on a message of input port `port`.
    fn deliver(&mut self, now: Stamp, port: usize, cdr: &[u8]) -> Result<Emitted, DeliverError>;
    /// One step on timer `id`.
    fn timer(&mut self, now: Stamp, id: u32) -> Emitted;
    /// The whole state as JSON.
    fn snapshot(&self) -> serde_json::Value;
    /// Goes back to a state that [`Instance::snapshot`] gave.
    fn restore(&mut self, snapshot: serde_json::Value) -> Result<(), RestoreError>;
}

/// A node with its settings and its state.
pub struct Running<N: Node> {
    config: N::Config,
    state: N::State,
}

impl<N: Node> Running<N> {
    /// A node at its start.
    pub fn new(config: N::Config) -> Self {
        let state = N::start(&config);
        Self { config, state }
    }

    /// Its current state.
    pub fn state(&self) -> &N::State {
        &self.state
    }

    fn step(&mut self, now: Stamp, input: N::Input) -> Emitted {
        let mut outbox = Outbox::default();
        N::step(&self.config, &mut self.state, now, input, &mut outbox);
        Emitted {
            messages: outbox.messages.iter().map(Outputs::write).collect(),
            timers: outbox.timers,
        }
    }
}

impl<N: Node> Instance for Running<N> {
    fn name(&self) -> &'static str {
        N::NAME
    }

    fn inputs(&self) -> &'static [Topic] {
        N::Input::topics()
    }

    fn outputs(&self) -> &'static [Topic] {
        N::Output::topics()
    }

    fn fault_codes(&self) -> Vec<&'static str> {
        N::Fault::ALL.iter().map(|fault| fault.code()).collect()
    }

    fn deliver(&mut self, now: Stamp, port: usize, cdr: &[u8]) -> Result<Emitted, DeliverError> {
        let input = N::Input::read(port, cdr).map_err(|source| {
            let topic = &N::Input::topics()[port];
            DeliverError {
                topic: topic.name,
                message: topic.message.name,
                source,
            }
        })?;
        Ok(self.step(now, input))
    }

    fn timer(&mut self, now: Stamp, id: u32) -> Emitted {
        self.step(now, N::Input::timer(id))
    }

    fn snapshot(&self) -> serde_json::Value {
        serde_json::to_value(&self.state).unwrap_or_else(|error| {
            panic!(
                "the state of {} must serialise: it is plain data: {error}",
                N::NAME
            )
        })
    }

    fn restore(&mut self, snapshot: serde_json::Value) -> Result<(), RestoreError> {
        self.state = serde_json::from_value(snapshot).map_err(|source| RestoreError {
            node: N::NAME,
            source,
        })?;
        Ok(())
    }
}
