//! The only live shell of the cell: bus, clock and processes.
//!
//! [`bus`] speaks Zenoh or DDS. [`process`] drives one node from the bus and the clock and writes its step journal;
//! [`recording`] is the recorder. Nothing else of the project knows a transport or asks for the time.

pub mod bus;
pub mod driver;
pub mod process;
pub mod recording;
mod topology;

pub use driver::run_driver;
pub use process::{NodeProcess, ProcessError, Stop, run_node};
pub use recording::{RecorderProcess, RecordingSettings};
pub use topology::{bus_qos, endpoint_answers, now, wait_until_heard};
