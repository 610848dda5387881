//! Why a correction is refused.

/// The refusal of a correction: outcome of the acknowledgement, and one sentence.
pub(crate) struct Refusal {
    pub(crate) outcome: u8,
    pub(crate) text: String,
}

pub(crate) fn refusal(outcome: u8, text: impl Into<String>) -> Refusal {
    Refusal {
        outcome,
        text: text.into(),
    }
}

pub(crate) fn refuse<T>(outcome: u8, text: impl Into<String>) -> Result<T, Refusal> {
    Err(refusal(outcome, text))
}
