//! Optimal design of further touches: candidates on the features of a plan, the remaining explanations with their
//! predictions, and the expected information.
//!
//! Metres, radians, seconds. Which touches a report proposes is decided in [`crate::next`].

pub(crate) mod candidates;
pub(crate) mod extended_rows;
pub(crate) mod hypotheses;
pub(crate) mod information;
