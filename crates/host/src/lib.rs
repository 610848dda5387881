//! The only live shell of the cell: bus, clock and processes.

pub mod bus;
