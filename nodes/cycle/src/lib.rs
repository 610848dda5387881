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
//! | `order_requests`, `kept_orders` | `orders`, `order_replies` |
//! | `machine_state/faults`, `probe_events/faults`, `path_planning/faults`, `analysis/faults`, `launcher/faults` | |
//!
//! It is the part program O0399 of the turn-mill system (`docs/source_systems.md`, A.4): rough, measure, decide; finish,
//! measure, decide. It computes nothing about sizes. A fault of severity ERROR, a refused correction or an operation that
//! fails ends the part as STOPPED, once the machine has confirmed its standstill. A request is repeated until it is taken, every
//! stage has a deadline, and a part that an earlier process has left behind is reported as STOPPED. A run that names a plan only measures it: nothing is cut, no decision is awaited, and
//! it ends as MEASURED. A run that names the plan with whose measurement the last part ended resumes that part: the rest
//! of the plan is measured and decided on together with the earlier touches. Nothing can be resumed after a cut or a
//! correction. Parts that operators have ordered are made one after the other (`orders.rs`).
//!
//! A part of one pass is requested, and the machine is asked to cut it:
//!
//! ```
//! use cycle::{Config, CycleNode, Input, Output, Pass};
//! use graph::{Node, Outbox, Stamp};
//! use probecell_msgs::{OperationRequest, OperatorRequest, PartStatus};
//!
//! let pass = Pass {
//!     name: "finish".to_owned(),
//!     operations: vec!["face".to_owned()],
//!     allowance_mm: 0.0,
//!     for_record: false,
//! };
//! let config = Config {
//!     passes: vec![pass],
//!     decision_limit: 30.0,
//!     operation_limit: 600.0,
//!     correction_limit: 60.0,
//!     answer_limit: 10.0,
//! };
//! let mut state = CycleNode::start(&config);
//! let mut out = Outbox::default();
//! let punch = OperatorRequest { subject: "punch".to_owned(), ..OperatorRequest::default() };
//! for input in [Input::Supervised(PartStatus::default()), Input::Run(punch)] {
//!     CycleNode::step(&config, &mut state, Stamp(0), input, &mut out);
//! }
//! let requests = out.messages().iter().filter_map(|output| match output {
//!     Output::Request(request) => Some((request.kind, request.operation.as_str())),
//!     _ => None,
//! });
//! assert_eq!(requests.collect::<Vec<_>>(), [(OperationRequest::CUT, "face")]);
//! ```

mod config;
mod ending;
mod orders;
mod part_name;
mod ports;
mod requests;
mod run;
mod state;
mod step;

pub use config::{Config, ConfigError, Pass, RawConfig};
pub use ports::{Input, Output};
pub use state::{OrderBook, Run, Stage, State};

graph::node! {
    /// The node.
    pub struct CycleNode { ports: ports, config: Config, state: State, step: step::step }
}
