//! What is followed, and its estimates of single sessions.

/// µs of a day.
const DAY: f64 = 86_400e6;

/// What is followed: an effect, one of its parameters, and the unit.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Quantity {
    /// Identifier of the effect, or `sensor.` and the name of the signal.
    pub effect: String,
    /// Parameter of the effect; `mean` of a sensor.
    pub parameter: String,
    /// Unit of the values.
    pub unit: String,
}

/// A point with what its uncertainty is made of.
pub(super) struct Estimate {
    pub(super) time: f64,
    pub(super) value: f64,
    pub(super) uncertainty: f64,
    pub(super) noise: f64,
    pub(super) freedom: f64,
}

/// Days since 1970 of an instant (µs).
pub(super) fn days(time: i64) -> f64 {
    time as f64 / DAY
}
