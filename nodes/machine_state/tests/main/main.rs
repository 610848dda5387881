//! The node `machine_state`, the gate to the machine.
//!
//! - `common`: a gate, what its machine reports, and a correction that it takes
//! - `late`: what a link delivers late, twice or not at all, and clocks that were set
//! - `signals`: signals beside the machine: what is refused, reported once, and heals
//! - `steps`: step by step: what is told of the machine, and what the machine is told

mod common;
mod late;
mod signals;
mod steps;
