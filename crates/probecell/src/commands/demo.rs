//! `probecell demo`: three machines, each with a fault of its own, from the first part to the proof that the fault was found.

use std::path::PathBuf;

use crate::{FAILED, GOOD, demo};

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Folder of the cell files, recordings and logs; where it exists, `demo-2` and so on is taken.
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
}

/// Runs the hall; fails where a fault that was hidden is not the one that was found, or a promise was not kept.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    Ok(if demo::run(&arguments.out)? {
        GOOD
    } else {
        FAILED
    })
}
