//! The commands, named as they are typed.

mod controller_files;
mod correct;
mod program;
mod results;

/// What is asked for.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Write the measuring program of a plan for a controller.
    Program(program::Arguments),
    /// Read the result files of a controller and compute sizes from their touches.
    Results(results::Arguments),
    /// Compute the tool-path correction of the next part of a free-form profile, and write its program.
    Correct(correct::Arguments),
}

impl Command {
    /// Runs it; the exit status.
    pub(crate) fn run(&self) -> anyhow::Result<u8> {
        match self {
            Self::Program(arguments) => program::run(arguments),
            Self::Results(arguments) => results::run(arguments),
            Self::Correct(arguments) => correct::run(arguments),
        }
    }
}
