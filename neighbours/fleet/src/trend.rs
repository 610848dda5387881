//! Trends with conclusions: whether a series of estimates has changed, since when, and when it will leave its tolerance.
//!
//! A series is a level under a random walk, measured with known uncertainty, a repeatability between sessions and one between
//! days: y = μ + d + e, d ~ N(0, δ²) new each day, e of variance u² + τ² with the tails of Student's t and one false session in
//! a hundred ([`errors`]); μ moves by N(0, q Δt) between sessions. From some session on it may have stepped, or grow steadily. Each such
//! onset is a Kalman filter of level and slope of its own ([`filter`]); the sum of their likelihood ratios against the series without a
//! change is the Shiryaev–Roberts statistic R, which grows by one for each session in the mean as long as there is no change, so
//! that the mean number of sessions to a false alarm at R ≥ A is at least A (Pollak 1985); by how much more is simulated
//! ([`calibrate`]). After an alarm the watch begins anew with the changed series; onset and size are then told from all
//! sessions ([`onset`]). τ, δ, q and the tails are estimated from the first days of all machines of a type by their
//! likelihood. The values of a series are estimated jointly with all effects that are followed, and alike in every session
//! ([`joint`]). Numbers only; times in days.

pub mod calibrate;
mod crossing;
pub mod errors;
mod filter;
pub mod hall;
mod joint;
mod likelihood;
pub mod onset;
mod quantity;
pub mod series;
mod spread;
pub mod watch;

pub use crossing::{Crossing, crossing};
pub use filter::Level;
pub use likelihood::spread;
pub use quantity::Quantity;
pub use spread::Spread;
pub use watch::{Change, Watch};

/// One estimate of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Days.
    pub time: f64,
    /// In the unit of the series.
    pub value: f64,
    /// Standard uncertainty of the value.
    pub uncertainty: f64,
}
