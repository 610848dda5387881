//! `probecell lake` and `probecell fleet`: hand over to the program `probecell-fleet`, which is built in a workspace of its
//! own. It is looked for beside this program, then on PATH.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, bail};

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
    let program = in_own_folder().unwrap_or_else(|| PathBuf::from(PROGRAM));
    let mut command = Command::new(&program);
    command.args(before).args(&arguments.arguments);
    match command.status() {
        // Ended by a signal: no status of its own.
        Ok(status) => Ok(status
            .code()
            .and_then(|code| u8::try_from(code).ok())
            .unwrap_or(FAILED)),
        Err(error) if error.kind() == ErrorKind::NotFound => bail!(
            "{PROGRAM} is neither in the folder of this program nor on PATH: it is built by `cargo build --release` in the folder fleet"
        ),
        Err(error) => Err(error).with_context(|| format!("cannot start {}", program.display())),
    }
}

/// The program in the folder of this one.
fn in_own_folder() -> Option<PathBuf> {
    let own = std::env::current_exe().ok()?;
    let file = own.with_file_name(format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX));
    file.is_file().then_some(file)
}
