//! `probecell-validation`: is the diagnosis right? `probecell blind` and `probecell scenario` start it.

mod commands;

use std::process::ExitCode;

use clap::Parser;

use commands::Command;

/// Judges the diagnosis on sessions whose cause is known.
#[derive(Parser)]
#[command(version, bin_name = "probecell")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    terminal::exit("probecell", Arguments::parse().command.run())
}
