//! The Kalman filter of a level and its slope.
//!
//! State (μ, β): μ' = μ + β Δt + N(0, q Δt), β' = β. Durbin and Koopman, Time Series Analysis by State Space Methods, 2nd ed.,
//! 4.3 (the filter) and 3.2 (the local linear trend). A third part of the state is what a day adds to all of its sessions;
//! the next day it is another.

use super::Point;
use super::errors::Errors;
use super::spread::Spread;

/// Level and slope with their covariance, at the time of the last point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Days.
    pub time: f64,
    /// Level.
    pub level: f64,
    /// Slope, per day.
    pub slope: f64,
    /// Covariance: of the level, of level and slope, of the slope.
    pub covariance: [f64; 3],
    /// What the day adds to all of its sessions: value, covariance with level and slope, variance.
    pub day: [f64; 4],
}

impl Level {
    /// A level that one point has shown, and no slope.
    pub fn first(time: f64, value: f64, variance: f64) -> Self {
        Self {
            time,
            level: value,
            slope: 0.0,
            covariance: [variance, 0.0, 0.0],
            day: [0.0; 4],
        }
    }

    /// A level after one point of a series with this spread.
    pub(super) fn after(point: &Point, spread: &Spread) -> Self {
        let variance = spread.variance(point).max(f64::MIN_POSITIVE);
        let mut level = Self::first(point.time, point.value, variance + spread.daily);
        // What this day adds is in the level and is taken off again.
        level.day = [0.0, -spread.daily, 0.0, spread.daily];
        level
    }

    /// At a later time.
    pub fn at(&self, time: f64, spread: &Spread) -> Self {
        let step = (time - self.time).max(0.0);
        let [level, both, slope] = self.covariance;
        let [offset, with_level, with_slope, variance] = self.day;
        let day = if time.floor() > self.time.floor() {
            [0.0, 0.0, 0.0, spread.daily]
        } else {
            [offset, with_level + step * with_slope, with_slope, variance]
        };
        Self {
            time,
            level: self.level + self.slope * step,
            slope: self.slope,
            covariance: [
                level + 2.0 * step * both + step * step * slope + spread.walk * step,
                both + step * slope,
                slope,
            ],
            day,
        }
    }

    /// The same with these variances added to those of level and slope.
    pub fn loosened(&self, of_level: f64, of_slope: f64) -> Self {
        let [level, both, slope] = self.covariance;
        Self {
            covariance: [level + of_level, both, slope + of_slope],
            ..*self
        }
    }

    /// Takes a value with errors of this variance at its own time, and gives the logarithm of its predicted density. Of errors that
    /// are a mixture of normal ones the density is exact for a normal level, whose posterior mixture becomes one normal
    /// distribution of the same mean and covariance (Harrison and Stevens 1976).
    pub fn update(&mut self, value: f64, variance: f64, errors: &Errors) -> f64 {
        let [level, both, slope] = self.covariance;
        let [offset, with_level, with_slope, of_day] = self.day;
        // Covariance of the predicted value with level, slope and day.
        let with = [level + with_level, both + with_slope, with_level + of_day];
        let predicted = with[0] + with[2];
        let off = value - self.level - offset;
        let (density, mean, variation) = errors.density(off, predicted, variance);
        let gain = with.map(|one| one * mean * off);
        self.level += gain[0];
        self.slope += gain[1];
        self.covariance = [
            (level - variation * with[0] * with[0]).max(0.0),
            both - variation * with[0] * with[1],
            (slope - variation * with[1] * with[1]).max(0.0),
        ];
        self.day = [
            offset + gain[2],
            with_level - variation * with[0] * with[2],
            with_slope - variation * with[1] * with[2],
            (of_day - variation * with[2] * with[2]).max(0.0),
        ];
        density
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

    /// The filter's last state is that of generalised least squares on all points at once, and the product of its predicted
    /// densities is the joint density of the points: two other ways to the same numbers.
    #[test]
    fn the_filter_agrees_with_generalised_least_squares_and_the_joint_density() {
        let times = [0.0, 1.0, 2.5, 2.75, 8.0, 8.5];
        let values = [1.0, 1.4, 0.9, 2.0, 2.2, 3.1];
        let variances = [0.2, 0.1, 0.3, 0.2, 0.1, 0.2];
        let (walk, daily, prior) = (0.05, 0.4, [4.0, 0.3]);
        let spread = Spread {
            daily,
            walk,
            ..Spread::NONE
        };
        let mut filter = Level::first(0.0, 0.5, prior[0]).loosened(0.0, prior[1]);
        filter.day[3] = daily;
        let mut logarithm = 0.0;
        for (time, (value, variance)) in times.iter().zip(values.iter().zip(variances)) {
            filter = filter.at(*time, &spread);
            logarithm += filter.update(*value, variance, &Errors::NORMAL);
        }
        // Joint distribution: y = 0.5 + prior level + slope t + walk(t) + day + noise.
        let covariance = DMatrix::from_fn(6, 6, |a, b| {
            prior[0]
                + prior[1] * times[a] * times[b]
                + walk * times[a].min(times[b])
                + f64::from(times[a].floor() == times[b].floor()) * daily
                + if a == b { variances[a] } else { 0.0 }
        });
        let off = DVector::from_iterator(6, values.iter().map(|value| value - 0.5));
        let cholesky = covariance.cholesky().expect("positive definite");
        let solved = cholesky.solve(&off);
        let determinant: f64 = cholesky
            .l()
            .diagonal()
            .iter()
            .map(|one| 2.0 * one.ln())
            .sum();
        let joint = -0.5 * (off.dot(&solved) + determinant + 6.0 * std::f64::consts::TAU.ln());
        assert!((logarithm - joint).abs() < 1e-9, "{logarithm} {joint}");
        // Posterior of level and slope at the last time.
        let cross = |row: usize| {
            let level = prior[0] + prior[1] * 8.5 * times[row] + walk * times[row];
            Vector2::new(level, prior[1] * times[row])
        };
        let mean: Vector2<f64> = (0..6)
            .map(|row| cross(row) * solved[row])
            .sum::<Vector2<f64>>()
            + Vector2::new(0.5, 0.0);
        assert!((filter.level - mean.x).abs() < 1e-10 && (filter.slope - mean.y).abs() < 1e-10);
        let prior_last = Matrix2::new(
            prior[0] + prior[1] * 8.5 * 8.5 + walk * 8.5,
            prior[1] * 8.5,
            prior[1] * 8.5,
            prior[1],
        );
        let rows = DMatrix::from_fn(6, 2, |row, column| cross(row)[column]);
        let explained = rows.transpose() * cholesky.solve(&rows);
        for (place, (row, column)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            let expected = prior_last[(row, column)] - explained[(row, column)];
            assert!((filter.covariance[place] - expected).abs() < 1e-10);
        }
    }
}
