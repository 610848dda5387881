//! The graph of the cell: what a node is, which topics join nodes, and how the same nodes run without a bus.
//!
//! A node is a rule `step(config, state, now, input) -> outputs` and knows no transport, clock or file. This crate
//! holds that rule's shape ([`Node`]), the table of topics ([`topics`]), the node behind bytes that a live process
//! or a replay drives ([`Instance`]), the journal that says which inputs a process took ([`journal`]), an executor on
//! virtual time ([`Executor`]) and the replay of a recording ([`replay`]).

mod executor;
mod instance;
pub mod journal;
mod node;
pub mod replay;
mod stamp;
pub mod topics;

pub use executor::{Executor, Published, Wiring, WiringError};
pub use instance::{DeliverError, Emitted, Instance, RestoreError, Running};
pub use node::{Inputs, Node, Outbox, Outputs, START};
pub use stamp::Stamp;
pub use topics::{Qos, Topic};
