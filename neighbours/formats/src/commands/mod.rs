//! The commands, named as they are typed. Their help is that of `probecell`, which checks their arguments first.

mod export;
mod plan;
mod reference;

/// What is asked for.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Write sizes and touches of a recording in the format of another system.
    Export(export::Arguments),
    /// Import files of other systems as a recorded session.
    #[command(subcommand)]
    Import(Import),
}

/// What is imported.
#[derive(clap::Subcommand)]
pub(crate) enum Import {
    /// Features, tolerances and points, as the plan of a session without touches.
    Plan(plan::Arguments),
    /// Results of an independent instrument for the points of a recording.
    Reference(reference::Arguments),
}

/// A format that comes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// QIF 3 (ISO 23952).
    Qif,
    /// DMIS (ISO 22093).
    Dmis,
}

impl Command {
    /// Runs it; the exit status.
    pub(crate) fn run(&self) -> anyhow::Result<u8> {
        match self {
            Self::Export(arguments) => export::run(arguments),
            Self::Import(Import::Plan(arguments)) => plan::run(arguments),
            Self::Import(Import::Reference(arguments)) => reference::run(arguments),
        }
    }
}
