//! Trends with conclusions: whether a series of estimates has changed, since when, and when it will leave its tolerance.
//!
//! A series is a level under a random walk, measured with known uncertainty and a repeatability between sessions:
//! y = μ + e, e ~ N(0, u² + τ²); μ moves by N(0, q Δt) between sessions. From some session on it may have stepped, or grow
//! steadily. Each onset is a Kalman filter of level and slope of its own ([`filter`]); the sum of their likelihood ratios
//! against the series without a change is the Shiryaev–Roberts statistic R, which grows by one for each session in the mean
//! as long as there is no change, so that the mean number of sessions to a false alarm at R ≥ A is at least A (Pollak 1985).
//! After an alarm the watch begins anew with the changed series. τ and q are estimated from the first sessions of all machines
//! of a type by their likelihood. Numbers only; times in days.

mod crossing;
mod filter;
pub mod hall;
mod likelihood;
pub mod series;
pub mod watch;

pub use crossing::{Crossing, crossing};
pub use filter::Level;
pub use likelihood::{Spread, spread};
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
