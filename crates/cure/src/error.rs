//! Why nothing is written.

/// Why nothing is written; each is one sentence.
#[derive(Debug, thiserror::Error)]
pub enum CureError {
    /// A cause that is not certain, or not the machine's.
    #[error("{effect} is not written: {why}")]
    Refused {
        /// The cause.
        effect: String,
        /// Why.
        why: String,
    },
    /// The report as a whole.
    #[error("{0}")]
    Report(String),
    /// No cause of the report fits the format.
    #[error(
        "{format} holds none of the causes of this report ({causes}); without --as each is listed with what mends it"
    )]
    Nothing {
        /// The format.
        format: &'static str,
        /// What was found.
        causes: String,
    },
    /// An option that the format needs.
    #[error("{format} needs {option}: {what}")]
    Missing {
        /// The format.
        format: &'static str,
        /// The option.
        option: &'static str,
        /// What it is.
        what: &'static str,
    },
    /// A file of the machine that cannot be changed.
    #[error("{file}: {what}")]
    File {
        /// Its name.
        file: String,
        /// What is wrong with it, and what to do.
        what: String,
    },
    /// An effect that the library cannot predict.
    #[error(transparent)]
    Declared(#[from] effects::DeclaredError),
    /// A machine that cannot be read.
    #[error("robot description: {0}")]
    Chain(#[from] machine::ChainError),
}
