//! Decides what the machine does next to make one part: cut, measure, decide, correct, then cut again or go on.
//!
//! ```text
//!                        +--------------------- NEXT: the next pass ----------------------+
//!                        v                                                                |
//!  run_requests --> [ cutting ] --> [ measuring ] --> pass_decisions --> QUALIFIED, SCRAP or STOPPED
//!                        ^                                  |
//!                        +--- every correction applied --- RECUT
//! ```
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `run_requests`, `stop_requests`, `supervised_part` | `run_replies`, `part_reports`, `part_status` |
//! | `operation_reports`, `pass_decisions`, `correction_acknowledgements` | `operation_requests` |
//! | `machine_state/faults`, `probe_events/faults`, `path_planning/faults`, `analysis/faults`, `launcher/faults` | |
//!
//! It is the part program O0399 of the turn-mill system (`docs/source_systems.md`, A.4): rough, measure, decide; finish,
//! measure, decide. It computes nothing about sizes. A fault of severity ERROR, a refused correction or an operation that
//! fails ends the part as STOPPED, once the machine has confirmed that it stands. A request is repeated until it is taken, every
//! stage has a deadline, and a part that an earlier process has left behind is reported as STOPPED. A run that names a plan only measures it: nothing is cut, no decision is awaited, and
//! it ends as MEASURED. A run that names the plan with whose measurement the last part ended resumes that part: the rest
//! of the plan is measured and decided on together with the earlier touches. Nothing can be resumed after a cut or a
//! correction.

mod asking;
mod config;
mod ending;
mod ports;
mod run;
mod state;
mod step;

pub use config::{Config, ConfigError, Pass, RawConfig};
pub use ports::{Input, Output};
pub use state::{Run, Stage, State};
pub use step::CycleNode;
