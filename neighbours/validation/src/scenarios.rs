//! The register of known gaps between a machining cell and its model, each as a scenario that can be run.
//!
//! A scenario hides one effect of `docs/source_systems.md, F` in a simulated cell, lets the project's own kernels and
//! nodes meet it, and judges what comes out by the register's rule. Figures are computed by the run; those of the
//! source stand beside them. Some scenarios also give recorded sessions, in which [`diagnosis`] has to find the
//! effect again. Everything is a function of the seed: no files, no clock. Lengths are m inside, µm and mm in
//! [`Figure`]s, as their unit says.
//!
//! To add one: a file with `pub(crate) const SCENARIO: Scenario`, and one line in `register.rs`.

mod error;
mod figure;
mod five_axis;
mod flank;
mod outcome;
mod page;
mod probed;
mod recorded;
mod register;
mod scenario;
mod touches;
mod turn_mill;

mod blind_slots;
mod deflection;
mod elastic_loop;
mod links;
mod phantom_wear;
mod probe_offset;
mod profile;
mod separation;
mod set_up_bias;
mod shaft;
mod slip;
mod tool_runout;
mod twist;

pub use error::ScenarioError;
pub use figure::{Figure, Rule, Value};
pub use outcome::Outcome;
pub use page::page;
pub use recorded::{Expected, Recorded};
pub use register::{Unknown, find, register};
pub use scenario::{Judged, Run, Scenario, Sessions};
