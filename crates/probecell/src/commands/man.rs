//! `probecell man`: man pages of the program and of each command, from the texts of `--help`.

use std::{fs, path::Path};

use anyhow::Context;

use crate::{GOOD, output};

/// Writes `probecell.1`, and `probecell-COMMAND.1` for each command and each of its own.
pub(crate) fn run(command: clap::Command, folder: &Path) -> anyhow::Result<u8> {
    let cannot = || format!("man pages cannot be written to {}", folder.display());
    fs::create_dir_all(folder).with_context(cannot)?;
    clap_mangen::generate_to(command, folder).with_context(cannot)?;
    output::line(&format!("man pages written to {}", folder.display()));
    Ok(GOOD)
}
