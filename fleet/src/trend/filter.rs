//! The Kalman filter of a level and its slope.
//!
//! State (μ, β): μ' = μ + β Δt + N(0, q Δt), β' = β. Durbin and Koopman, Time Series Analysis by State Space Methods, 2nd ed.,
//! 4.3 (the filter) and 3.2 (the local linear trend).

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
}

impl Level {
    /// A level that one point has shown, and no slope.
    pub fn first(time: f64, value: f64, variance: f64) -> Self {
        Self {
            time,
            level: value,
            slope: 0.0,
            covariance: [variance, 0.0, 0.0],
        }
    }

    /// At a later time; `walk` is q, the variance of the level per day.
    pub fn at(&self, time: f64, walk: f64) -> Self {
        let step = (time - self.time).max(0.0);
        let [level, both, slope] = self.covariance;
        Self {
            time,
            level: self.level + self.slope * step,
            slope: self.slope,
            covariance: [
                level + 2.0 * step * both + step * step * slope + walk * step,
                both + step * slope,
                slope,
            ],
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

    /// Takes a value of this variance at its own time, and gives the logarithm of its predicted density.
    pub fn update(&mut self, value: f64, variance: f64) -> f64 {
        let [level, both, slope] = self.covariance;
        let spread = level + variance;
        let off = value - self.level;
        let gain = [level / spread, both / spread];
        self.level += gain[0] * off;
        self.slope += gain[1] * off;
        // (1 − K) P for the level, so that it stays positive.
        self.covariance = [
            level * variance / spread,
            both * variance / spread,
            slope - gain[1] * both,
        ];
        -0.5 * (off * off / spread + spread.ln() + std::f64::consts::TAU.ln())
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
        let times = [0.0, 1.0, 2.5, 3.0, 7.0, 8.5];
        let values = [1.0, 1.4, 0.9, 2.0, 2.2, 3.1];
        let variances = [0.2, 0.1, 0.3, 0.2, 0.1, 0.2];
        let (walk, prior) = (0.05, [4.0, 0.3]);
        let mut filter = Level::first(0.0, 0.5, prior[0]).loosened(0.0, prior[1]);
        let mut logarithm = 0.0;
        for (time, (value, variance)) in times.iter().zip(values.iter().zip(variances)) {
            filter = filter.at(*time, walk);
            logarithm += filter.update(*value, variance);
        }
        // Joint distribution: y = 0.5 + prior level + slope t + walk(t) + noise.
        let covariance = DMatrix::from_fn(6, 6, |a, b| {
            prior[0]
                + prior[1] * times[a] * times[b]
                + walk * times[a].min(times[b])
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
        assert!((logarithm - joint).abs() < 1e-10, "{logarithm} {joint}");
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
