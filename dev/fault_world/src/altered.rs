//! Nodes that are wrong in one respect: a real node whose inputs, outputs or state are altered on their way.

use graph::{DeliverError, Emitted, Instance, RestoreError, Stamp, Topic};
use serde_json::Value;

/// What is altered of a node; by default nothing.
pub trait Alteration: Send + 'static {
    /// One step on a message of input port `port`.
    ///
    /// # Errors
    /// As of [`Instance::deliver`].
    fn deliver(
        &mut self,
        node: &mut dyn Instance,
        now: Stamp,
        port: usize,
        cdr: &[u8],
    ) -> Result<Emitted, DeliverError> {
        node.deliver(now, port, cdr)
    }

    /// One step on timer `id`.
    fn timer(&mut self, node: &mut dyn Instance, now: Stamp, id: u32) -> Emitted {
        node.timer(now, id)
    }

    /// The whole state.
    fn snapshot(&self, node: &dyn Instance) -> Value {
        node.snapshot()
    }
}

/// The node, altered where it has that name.
pub fn altered(
    node: Box<dyn Instance>,
    name: &str,
    alteration: impl Alteration,
) -> Box<dyn Instance> {
    if node.name() != name {
        return node;
    }
    Box::new(Altered { node, alteration })
}

struct Altered<A> {
    node: Box<dyn Instance>,
    alteration: A,
}

impl<A: Alteration> Instance for Altered<A> {
    fn name(&self) -> &'static str {
        self.node.name()
    }

    fn inputs(&self) -> &'static [Topic] {
        self.node.inputs()
    }

    fn outputs(&self) -> &'static [Topic] {
        self.node.outputs()
    }

    fn fault_codes(&self) -> Vec<&'static str> {
        self.node.fault_codes()
    }

    fn deliver(&mut self, now: Stamp, port: usize, cdr: &[u8]) -> Result<Emitted, DeliverError> {
        self.alteration.deliver(&mut *self.node, now, port, cdr)
    }

    fn timer(&mut self, now: Stamp, id: u32) -> Emitted {
        self.alteration.timer(&mut *self.node, now, id)
    }

    fn snapshot(&self) -> Value {
        self.alteration.snapshot(&*self.node)
    }

    fn restore(&mut self, snapshot: Value) -> Result<(), RestoreError> {
        self.node.restore(snapshot)
    }
}
