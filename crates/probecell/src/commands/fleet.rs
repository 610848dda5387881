//! `probecell lake` and `probecell fleet`: hand over to the program `probecell-fleet`, which is built in a workspace of its
//! own.

use std::ffi::OsString;
use std::process::Command;

use super::companion;
use crate::FAILED;

/// Name of the program.
const PROGRAM: &str = "probecell-fleet";

/// What the user asks for: everything goes to the other program as it is.
#[derive(clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    /// Arguments of `probecell-fleet`; `--help` lists them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs the program with `before` and the arguments, and gives its exit status.
pub(crate) fn run(before: &[&str], arguments: &Arguments) -> anyhow::Result<u8> {
    let mut command = Command::new(companion::program(PROGRAM));
    command.args(before).args(&arguments.arguments);
    let status = command.status();
    let status = status.map_err(|error| companion::not_started(PROGRAM, "fleet", error))?;
    // Ended by a signal: no status of its own.
    Ok(status
        .code()
        .and_then(|code| u8::try_from(code).ok())
        .unwrap_or(FAILED))
}
