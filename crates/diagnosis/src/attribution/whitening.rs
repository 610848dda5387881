//! Rows whitened for their noise and for the process of an unknown cause together: what is left has independent errors of one
//! variance, so that least squares on it are generalised least squares. Metres.

use inference::columns::Rows;
use inference::linear::{add_scaled, dot};
use inference::posterior::ModelPosterior;
use nalgebra::{DMatrix, DVector};

use super::candidate_pool::Shapes;

/// Directions of a process below this share of the power of the largest are rounding.
const ROUNDING: f64 = 1e-12;

/// The rows in use, whitened: independent errors of one variance.
pub(super) struct Whitened {
    rows: Rows,
    process: Option<Process>,
    /// The weighted deviations.
    pub(super) y: DVector<f64>,
}

impl Whitened {
    /// Beside a process: its index and its variance over that of the noise.
    pub(super) fn new(
        shapes: &Shapes<'_>,
        attribution: &ModelPosterior,
        unknown: Option<(usize, f64)>,
    ) -> Self {
        let rows = Rows {
            active: attribution.active.clone(),
            touches: shapes.observations.touches(),
            lag1_correlation: attribution.lag1_correlation,
        };
        let process = unknown.and_then(|(index, power)| Process::new(attribution, index, power));
        let mut whitened = Self {
            rows,
            process,
            y: DVector::zeros(0),
        };
        whitened.y = DVector::from_vec(whitened.white(&attribution.y));
        whitened
    }

    /// Values of all rows, whitened.
    pub(super) fn white(&self, values: &[f64]) -> Vec<f64> {
        let values = self.rows.white(values);
        match &self.process {
            Some(process) => process.whiten(values),
            None => values,
        }
    }
}

/// The process of an unknown cause, or of noise that differs from touch to touch, over the rows in use.
pub(crate) struct Process {
    /// Orthonormal directions over the rows.
    directions: Vec<Vec<f64>>,
    /// Standard deviation of the noise over that of noise and process together, along each.
    shares: Vec<f64>,
    /// Standard deviation of each row over that of the noise, where they differ.
    widening: Option<Vec<f64>>,
}

impl Process {
    /// Of this variance over that of the noise.
    fn new(attribution: &ModelPosterior, index: usize, power: f64) -> Option<Self> {
        let discrepancy = &attribution.discrepancies[index];
        if let Some(widening) = discrepancy.widening(power) {
            return Some(Self {
                directions: Vec::new(),
                shares: Vec::new(),
                widening: Some(widening),
            });
        }
        Self::of_columns(&discrepancy.columns()?, power)
    }

    /// Of the kernel that the outer products of columns sum to.
    pub(crate) fn of_columns(columns: &[Vec<f64>], power: f64) -> Option<Self> {
        let rows = columns.first()?.len();
        let down = DMatrix::from_vec(rows, columns.len(), columns.concat());
        let eigen = down.tr_mul(&down).symmetric_eigen();
        let most = eigen.eigenvalues.max();
        let along = down * eigen.eigenvectors;
        let pairs = along.column_iter().zip(&eigen.eigenvalues);
        let kept = pairs.filter(|(_, value)| **value > ROUNDING * most);
        let (directions, shares) = kept
            .map(|(column, &value)| {
                let length = value.sqrt();
                let direction: Vec<f64> = column.iter().map(|part| part / length).collect();
                (direction, 1.0 / (1.0 + power * value).sqrt())
            })
            .unzip();
        Some(Self {
            directions,
            shares,
            widening: None,
        })
    }

    /// (I + power·K)^(−1/2) times values over the rows in use.
    pub(crate) fn whiten(&self, mut values: Vec<f64>) -> Vec<f64> {
        let along: Vec<f64> = (self.directions.iter())
            .map(|direction| dot(direction, &values))
            .collect();
        for ((direction, share), along) in self.directions.iter().zip(&self.shares).zip(along) {
            add_scaled(&mut values, (share - 1.0) * along, direction);
        }
        if let Some(widening) = &self.widening {
            for (value, wider) in values.iter_mut().zip(widening) {
                *value /= wider;
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whitened twice, values are those that the dense matrix I + p·K takes to them.
    #[test]
    fn whitening_is_the_inverse_root_of_the_covariance() {
        let (rows, power) = (12, 7.0);
        let value =
            |row: usize, column: usize| ((row * 37 + column * 101 + 7) % 23) as f64 / 23.0 - 0.4;
        let columns: Vec<Vec<f64>> = (0..4)
            .map(|column| (0..rows).map(|row| value(row, column)).collect())
            .collect();
        let process = Process::of_columns(&columns, power).expect("columns");
        let down = DMatrix::from_vec(rows, 4, columns.concat());
        let covariance = DMatrix::identity(rows, rows) + &down * down.transpose() * power;
        let values: Vec<f64> = (0..rows).map(|row| value(row, 9)).collect();
        let twice = process.whiten(process.whiten(values.clone()));
        let back = covariance * DVector::from_vec(twice);
        for (found, expected) in back.iter().zip(&values) {
            assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
        }
    }
}
