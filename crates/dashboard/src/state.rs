//! What the dashboard knows: a pure reducer from messages to the state of cells. No transport, no clock, no disk.
//!
//! [`Hall::apply`] takes the name of a topic, its bytes and the instant of their reception; a live bus and a recording are
//! read by the same code. Everything kept has a bound, which stands beside it.

mod cell;
mod course;
mod events;
mod hall;
mod last_parts;
mod ledger;
mod reduce;
pub(crate) mod wording;

pub use cell::{Attention, CellState, Characteristic, RunChartPoint, Section, Touch};
pub use course::{Course, Doing, INTERVALS, LAST_PARTS, LastPart, Signal, Trend};
pub use events::{Event, EventKind};
pub(crate) use hall::by_name;
pub(crate) use hall::{Differs, is_read, machine_state, split};
pub use hall::{Hall, kept_topics, read_topics};
pub use ledger::{Achieved, Entry};
