//! What can keep a scenario from being run; a scenario that runs and misses its rule is no error.

use thiserror::Error;

/// Why a scenario gave no outcome.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// A profile was not usable.
    #[error(transparent)]
    Profile(#[from] metrology::profile::ProfileError),
    /// A curve was not usable.
    #[error(transparent)]
    Spline(#[from] metrology::profile::SplineError),
    /// Passes could not be separated.
    #[error(transparent)]
    Separation(#[from] metrology::separation::SeparationError),
    /// Repeats could not be examined.
    #[error(transparent)]
    Slip(#[from] metrology::slip::SlipError),
    /// No decision could be made.
    #[error(transparent)]
    Decision(#[from] metrology::decision::DecisionError),
    /// Sizes and gaps have no law.
    #[error(transparent)]
    SizeGap(#[from] metrology::size_gap::SizeGapError),
    /// A ball passed beside the part.
    #[error(transparent)]
    Miss(#[from] metrology::probe_model::ProbeMiss),
    /// A length error was asked of a part without length.
    #[error(transparent)]
    Length(#[from] metrology::cut_model::LengthInvalid),
    /// The cell of the scenario could not be made.
    #[error(transparent)]
    Cell(#[from] cell::CellError),
    /// The nodes of the cell could not be joined.
    #[error(transparent)]
    Wiring(#[from] graph::WiringError),
    /// A message of the cell could not be read.
    #[error(transparent)]
    Message(#[from] probecell_msgs::CdrError),
    /// The machine of the scenario could not be made.
    #[error(transparent)]
    Chain(#[from] machine::ChainError),
    /// The plan of a session was not usable.
    #[error(transparent)]
    Plan(#[from] machine::DeviationError),
    /// A touch of a session is out of the machine's reach.
    #[error(transparent)]
    Reach(#[from] machine::ReachError),
    /// A recorded session could not be diagnosed.
    #[error(transparent)]
    Diagnosis(#[from] diagnosis::SessionError),
    /// A link error was misnamed.
    #[error(transparent)]
    Link(#[from] machine::LinkNameError),
    /// A test by surface mismatch could not be made.
    #[error(transparent)]
    Mismatch(#[from] machining::mismatch::MismatchError),
    /// A flank-milling case could not be made.
    #[error(transparent)]
    Flank(#[from] machining::flank::simulated::CaseError),
    /// A radius profile was not usable.
    #[error(transparent)]
    RadiusProfile(#[from] machining::flank::ProfileError),
    /// A path was not usable.
    #[error(transparent)]
    Path(#[from] machining::flank::PathError),
    /// The cell did not do what the scenario is about.
    #[error("{0}")]
    Course(String),
}
