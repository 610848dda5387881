//! LinuxCNC as the machine of a cell, over its remote shell `linuxcncrsh`.
//!
//! | module | what it holds |
//! |---|---|
//! | [`protocol`] | the words of the remote shell: pure encoder and parser |
//! | [`client`] | one connection with time-outs |
//! | [`program`] | measuring programs from a plan and its order, programs that set offsets |
//! | [`log`] | what a running program has found |
//! | [`tool_table`] | offsets of the tools |
//! | [`config`] | settings |
//! | [`driver`] | the cell's driver: status, triggers and replies out, commands in |

pub mod client;
pub mod config;
pub mod driver;
pub mod log;
pub mod program;
pub mod protocol;
mod settings;
pub mod tool_table;

/// Identifier of the driver, and of the dialect of its programs.
pub const NAME: &str = "linuxcnc";

/// The driver.
#[derive(Clone, Copy, Debug)]
pub struct LinuxCnc;

pub use config::{Config, ConfigError, RawConfig};
pub use driver::{LinuxCncConnection, LinuxCncError};
