//! What further touches would tell: candidates that a plan's features offer, whether the stylus gets there, and how much
//! they say about explanations that are still possible.
//!
//! Metres, radians, seconds. What to propose in a report is decided in [`crate::next`].

pub(crate) mod candidates;
pub(crate) mod hypotheses;
pub(crate) mod imagined;
pub(crate) mod information;
