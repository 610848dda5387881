//! `probecell-formats`: recordings as files of other measuring systems, and the reverse. `probecell export`, `import plan` and
//! `import reference` hand over to it.

mod commands;

use std::process::ExitCode;

use clap::Parser;

use commands::Command;

/// Writes and reads formats of other measuring systems.
#[derive(Parser)]
#[command(version, bin_name = "probecell")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    terminal::exit("probecell", Arguments::parse().command.run())
}
