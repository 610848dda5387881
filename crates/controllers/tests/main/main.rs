//! Drivers without a machine: what is sent to controllers and read of them.
//!
//! - `driver`: each fault of LinuxCNC, by a scripted remote shell on loopback
//! - `protocol`: lines recorded from LinuxCNC 2.9, and garbage, in the parser of the remote shell
//! - `robot_endpoints`: the driver of a robot subscribes to and calls what its settings name

mod driver;
mod protocol;
mod robot_endpoints;
