//! Programs that are built in workspaces of their own and started by this one.

use std::io;
use std::path::PathBuf;

use anyhow::{Error, anyhow};

/// The program of this name beside this one; else its bare name, to be looked for on PATH.
pub(super) fn program(name: &str) -> PathBuf {
    let beside = std::env::current_exe()
        .ok()
        .map(|own| own.with_file_name(format!("{name}{}", std::env::consts::EXE_SUFFIX)));
    let there = beside.filter(|file| file.is_file());
    there.unwrap_or_else(|| PathBuf::from(name))
}

/// Why the program of this name, which is built in `folder`, could not be started.
pub(super) fn not_started(name: &str, folder: &str, error: io::Error) -> Error {
    if error.kind() == io::ErrorKind::NotFound {
        anyhow!(
            "{name} is neither in the folder of this program nor on PATH: it is built by `cargo build --release` in the folder {folder}"
        )
    } else {
        Error::new(error).context(format!("cannot start {name}"))
    }
}
