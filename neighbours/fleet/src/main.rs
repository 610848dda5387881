//! `probecell-fleet`: the sessions of many machines.
//!
//! Exit status: 0 success, 1 failure, 2 wrong input or usage, 3 finished with some recordings left out.

mod commands;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    match commands::run(commands::Arguments::parse()) {
        Ok(status) => ExitCode::from(status),
        Err(error) => {
            commands::remark(&format!(
                "probecell-fleet: {}",
                probecell_fleet::sentence(&error)
            ));
            ExitCode::from(2)
        }
    }
}
