//! Decides what the machine does next to make one part: for each pass cut, measure, decide, correct, cut again or go on.
//!
//! | hears | says |
//! |---|---|
//! | `run_requests` | `run_replies`, `part_reports` |
//! | `operation_reports`, `pass_decisions`, `correction_acknowledgements` | `operation_requests` |
//! | faults of the nodes and of the launcher | |
//!
//! It is the part program O0399 of the turn-mill system (source systems A.4): rough, measure, decide; finish, measure,
//! decide. It computes nothing about sizes. A fault of severity ERROR, a refused correction or an operation that fails
//! ends the part as STOPPED. A run of a plan only measures it: nothing is cut, no decision is waited for, and it ends as
//! MEASURED. A run of the plan at whose measurement the last part ended goes on with that part: what is left of the plan
//! is measured, and decided on with all that was measured before. That is over once anything is cut or corrected.

mod config;
mod step;

pub use config::{Config, ConfigError, Pass, RawConfig};
pub use step::{CycleNode, Input, Output, Run, Stage, State};
