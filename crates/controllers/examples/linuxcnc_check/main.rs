//! Checks the LinuxCNC driver against a LinuxCNC that runs: `linuxcnc_check SCRATCH START STOP`.
//!
//! SCRATCH is a folder with the configurations of the simulated machine, in which programs may be written; START and STOP
//! are the scripts that start LinuxCNC there and end it. It must not run yet. `halcmd` sets the hidden errors and the faults. Each check prints
//! one line; the exit status is 0 only when all hold. `tests/interop/linuxcnc/check.sh` runs it.

mod artefact;
mod checks;
mod estimate;
mod offline;
mod rig;

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, bail};

#[expect(clippy::print_stdout, reason = "the report of the check is its output")]
fn main() -> ExitCode {
    match run() {
        Ok(()) => {
            println!("all checks hold");
            ExitCode::SUCCESS
        }
        Err(error) => {
            println!("FAILED: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> anyhow::Result<()> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [scratch, start, stop] = arguments.as_slice() else {
        bail!("usage: linuxcnc_check SCRATCH START STOP");
    };
    let scratch = scratch.canonicalize().context("scratch folder")?;
    checks::all(&scratch, start, stop)
}
