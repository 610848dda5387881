//! Choices of a diagnosis.

use experiment::next::ProposalOptions;

/// Choices of a diagnosis.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Effects that are not to be considered, by identifier.
    pub without: Vec<String>,
    /// What is wanted of the touches proposed for what is not sure.
    pub next: ProposalOptions,
}
