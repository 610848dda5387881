//! The bus and the processes on it, on real sessions over loopback; each test has a router on a free port.
//!
//! - `access`: a secured cell: what each user says reaches the others as the policy allows
//! - `common`: what they share: a key that answers after all that was said before it
//! - `driver`: the process of a driver passes on what its connection says and what the cell sends
//! - `parameters`: answers of the parameter services against those of rclpy
//! - `sim_time`: the simulated clock, by members that speak its protocol by themselves
//! - `start_order`: a node hears nothing that the recorder does not
//! - `strangers`: a cell that is not secured: what a stranger reads, and that it writes nothing
//! - `zenoh_bus`: delivery, late joiners, recovery, services and graph on Zenoh

mod access;
mod common;
mod driver;
mod parameters;
mod sim_time;
mod start_order;
mod strangers;
mod zenoh_bus;
