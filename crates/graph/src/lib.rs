//! The graph of the cell: what a node is, which topics join nodes, and how the same nodes run live, on virtual time, and in
//! a replay.
//!
//! ```text
//!                    Node::step(config, state, now, input) -> outputs        no clock, no transport, no randomness
//!                                       |
//!                      Running<N>: an Instance, bytes in, bytes out
//!                     /                 |                  \
//!      host: bus and wall clock   Executor: virtual time   replay: inputs of a recording
//! ```
//!
//! A node is a rule on values ([`Node`]); its ports and its faults are closed lists ([`inputs!`], [`outputs!`],
//! [`faults!`]). Whoever drives it journals every step ([`journal`]): which input, in which order, at which instant. From
//! the journals [`replay::replay`] recomputes a session and compares it byte for byte. [`topics`] is the table of what
//! nodes share.
//!
//! # Example
//!
//! Two nodes on virtual time, then the replay of what they published:
//!
//! ```
//! use graph::{
//!     Executor, Instance, NoFaults, Node, Outbox, Qos, Running, START, Stamp, declare_topics, inputs,
//!     outputs,
//!     replay::{Factory, Recording, Verdict, replay},
//! };
//! use probecell_msgs::std_msgs;
//!
//! declare_topics! {
//!     TICKS = "metronome", "ticks", std_msgs::String, Qos::reliable(10);
//!     COUNTS = "counter", "counts", std_msgs::String, Qos::latched(1);
//! }
//!
//! inputs! { pub enum NoInput {} }
//! outputs! { pub enum Tick { Tick(std_msgs::String) = TICKS, } }
//!
//! struct Metronome;
//!
//! impl Node for Metronome {
//!     const NAME: &'static str = "metronome";
//!     type Config = f64; // s
//!     type State = ();
//!     type Input = NoInput;
//!     type Output = Tick;
//!     type Fault = NoFaults;
//!
//!     fn start(_period: &f64) {}
//!
//!     fn step(period: &f64, _: &mut (), now: Stamp, _: NoInput, out: &mut Outbox<Tick>) {
//!         out.send(Tick::Tick(std_msgs::String::default()));
//!         out.wake_at(now.after_s(*period), START + 1);
//!     }
//! }
//!
//! inputs! { pub enum Ticked { Tick(std_msgs::String) = TICKS, } }
//! outputs! { pub enum Count { Count(std_msgs::String) = COUNTS, } }
//!
//! struct Counter;
//!
//! impl Node for Counter {
//!     const NAME: &'static str = "counter";
//!     type Config = ();
//!     type State = u32;
//!     type Input = Ticked;
//!     type Output = Count;
//!     type Fault = NoFaults;
//!
//!     fn start((): &()) -> u32 {
//!         0
//!     }
//!
//!     fn step((): &(), ticks: &mut u32, _now: Stamp, input: Ticked, out: &mut Outbox<Count>) {
//!         if let Ticked::Tick(_) = input {
//!             *ticks += 1;
//!             let data = ticks.to_string();
//!             out.send(Count::Count(std_msgs::String { data }));
//!         }
//!     }
//! }
//!
//! let nodes: [fn() -> Box<dyn Instance>; 2] = [
//!     || Box::new(Running::<Metronome>::new(0.5)),
//!     || Box::new(Running::<Counter>::new(())),
//! ];
//! let begin = Stamp(1_767_225_600_000_000_000);
//! let mut session = Executor::new(nodes.map(|node| node()).into(), begin).unwrap();
//! session.run_until(begin.after_s(10.0));
//! let log = session.take_log();
//! let counts = log.iter().filter(|message| message.topic == "counts").count();
//! assert_eq!(counts, 21);
//!
//! let mut recording = Recording::default();
//! for message in &log {
//!     recording.push(&message.topic, message.sequence, message.at, &message.payload);
//! }
//! let factories = nodes.map(|node| Box::new(node) as Factory);
//! let report = replay(&recording, &factories).unwrap();
//! assert_eq!(report.verdict, Verdict::Equal);
//! ```

mod early;
mod executor;
mod fault;
mod instance;
pub mod journal;
mod node;
pub mod parameters;
pub mod replay;
mod stamp;
pub mod supervision;
pub mod topics;
mod wiring;

pub use early::Early;
pub use executor::{Executor, Link, Published};
pub use fault::{FaultCode, NoFaults};
pub use instance::{DeliverError, Emitted, Instance, RestoreError, Running};
pub use node::{Inputs, Node, Outbox, Outputs, START};
pub use stamp::Stamp;
pub use topics::{Qos, Topic};
pub use wiring::{Wiring, WiringError};
