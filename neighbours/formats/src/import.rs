//! What comes in: plans and results of other measuring systems.

pub mod dmis;
pub mod plan;
pub mod qif;
