//! Effects of records: what the messages of a session show by themselves, whatever the deviations say, one file each.

pub mod clock_offset;
pub mod outliers;
pub mod quantisation;

use crate::effect::Effect;

/// All of them.
pub const ALL: &[&dyn Effect] = &[
    &outliers::Outliers,
    &quantisation::Quantisation,
    &clock_offset::ClockOffset,
];
