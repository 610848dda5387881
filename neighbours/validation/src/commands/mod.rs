//! The commands, named as they are typed.

mod blind;
mod refine;
mod scenario;

use std::path::PathBuf;

/// What is asked for.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Validate the diagnosis on sessions with hidden effects, and print the score card.
    #[command(after_help = "Examples:\n  \
        probecell blind --trials 60 --json\n  \
        probecell blind --on my_cell.toml")]
    Blind {
        /// Number of sessions, distributed evenly over the kinds of hidden effects.
        #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
        trials: u64,
        /// Instead compare eight additional touches (chosen, random, repeated) on this many sessions whose first diagnosis is
        /// wrong or uncertain.
        #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
        refine: Option<u64>,
        /// Seed of the sessions.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Cell file or bag whose machine and plan are used instead of generated ones.
        #[arg(long, value_name = "CELL_OR_BAG", conflicts_with = "refine")]
        on: Option<PathBuf>,
        /// Write every session and its hidden effects as a recording below this folder.
        #[arg(long, value_name = "DIR", conflicts_with = "refine")]
        keep: Option<PathBuf>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Run the register of known gaps between a cell and its model, and judge each against its source.
    #[command(subcommand)]
    Scenario(scenario::Command),
}

impl Command {
    /// Runs it; the exit status.
    pub(crate) fn run(&self) -> anyhow::Result<u8> {
        match self {
            Self::Blind {
                refine: Some(wanted),
                seed,
                json,
                ..
            } => refine::run(*wanted, *seed, *json),
            Self::Blind {
                trials,
                seed,
                on,
                keep,
                json,
                ..
            } => blind::run(*trials, *seed, on.as_deref(), keep.as_deref(), *json),
            Self::Scenario(command) => scenario::run(command),
        }
    }
}
