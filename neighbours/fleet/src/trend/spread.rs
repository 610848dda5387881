//! How the series of one kind vary when nothing happens.

use super::Point;
use super::errors::Errors;

/// What moves an estimate from one session to the next when nothing happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Repeatability between sessions, variance beyond the points' own uncertainty.
    pub repeatability: f64,
    /// Repeatability between days beyond that between sessions, variance.
    pub daily: f64,
    /// Variance of the level per day.
    pub walk: f64,
    /// Degrees of freedom of Student's t of the errors of sessions; infinite: normal.
    pub freedom: f64,
}

impl Spread {
    /// Nothing beyond the points' own uncertainty.
    pub const NONE: Self = Self {
        repeatability: 0.0,
        daily: 0.0,
        walk: 0.0,
        freedom: f64::INFINITY,
    };

    /// Variance of a point about the level of its day.
    pub fn variance(&self, point: &Point) -> f64 {
        point.uncertainty.powi(2) + self.repeatability
    }

    /// Distribution of the errors of sessions.
    pub fn errors(&self) -> Errors {
        Errors::student(self.freedom)
    }
}
