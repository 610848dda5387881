//! Least squares of many rows on few columns by normal equations, accumulated part by part.
//!
//! Columns are scaled to unit length before the Cholesky factorisation, so that units do not matter, and a small ridge
//! keeps equal columns apart. A column without energy takes no part: its coefficient is 0 and has no variance.

use thiserror::Error;

use crate::linear::{cholesky, dot, inverse_diagonal, solve_cholesky};

/// Normal equations that have no unique solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the normal equations of {columns} columns over {rows} rows are singular or not finite")]
pub struct Singular {
    /// Number of columns with energy.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
}

/// AᵀA, Aᵀy and yᵀy of the rows added so far.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    gram: Vec<f64>,
    projections: Vec<f64>,
    yy: f64,
    rows: usize,
}

/// The solution of normal equations.
#[derive(Debug, Clone, Default)]
pub struct Solution {
    /// One coefficient for each column, in the unit of the data over that of the column.
    pub coefficients: Vec<f64>,
    /// Mean square of the residuals, in the unit of the data squared; divisor: the number of rows.
    pub mean_square: f64,
    /// Variance of each coefficient for unit variance of independent rows.
    pub unit_variances: Vec<f64>,
}

impl NormalEquations {
    /// No rows yet, of this many columns.
    pub fn new(columns: usize) -> Self {
        Self {
            gram: vec![0.0; columns * columns],
            projections: vec![0.0; columns],
            yy: 0.0,
            rows: 0,
        }
    }

    /// Adds rows: as many columns as there are, each as long as `y`.
    pub fn add(&mut self, columns: &[Vec<f64>], y: &[f64]) {
        let n = self.projections.len();
        self.rows += y.len();
        self.yy += dot(y, y);
        for (i, column) in columns.iter().enumerate() {
            for (k, other) in columns.iter().enumerate().take(i + 1) {
                self.gram[i * n + k] += dot(column, other);
            }
            self.projections[i] += dot(column, y);
        }
    }

    /// Number of rows added so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The solution with a ridge relative to the power of each column.
    ///
    /// # Errors
    /// [`Singular`] where a product is not finite or the columns depend on one another beyond what the ridge parts.
    pub fn solve(&self, ridge: f64) -> Result<Solution, Singular> {
        let all = self.projections.len();
        let used: Vec<usize> = (0..all).filter(|i| self.gram[i * all + i] != 0.0).collect();
        let lengths: Vec<f64> = (used.iter())
            .map(|i| self.gram[i * all + i].sqrt())
            .collect();
        let n = used.len();
        let singular = Singular {
            columns: n,
            rows: self.rows,
        };
        let mut factor = vec![0.0; n * n];
        for (i, a) in used.iter().enumerate() {
            for (k, b) in used.iter().enumerate().take(i + 1) {
                factor[i * n + k] = self.gram[a * all + b] / (lengths[i] * lengths[k]);
            }
            factor[i * n + i] += ridge;
        }
        cholesky(&mut factor, n).ok_or(singular)?;
        let mut solved: Vec<f64> = (used.iter().zip(&lengths))
            .map(|(&i, length)| self.projections[i] / length)
            .collect();
        solve_cholesky(&factor, n, &mut solved);
        let variances = inverse_diagonal(&factor, n, &mut vec![0.0; n * n]);
        let mut solution = Solution {
            coefficients: vec![0.0; all],
            mean_square: 0.0,
            unit_variances: vec![0.0; all],
        };
        for (index, &column) in used.iter().enumerate() {
            let length = lengths[index];
            solution.coefficients[column] = solved[index] / length;
            solution.unit_variances[column] = variances[index] / (length * length);
        }
        let explained = dot(&self.projections, &solution.coefficients);
        let residual = (self.yy - explained).max(1e-12 * self.yy);
        solution.mean_square = residual / (self.rows as f64).max(1.0);
        if !solution.coefficients.iter().all(|value| value.is_finite()) {
            return Err(singular);
        }
        Ok(solution)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A straight line through five points against the textbook formulas, in two parts.
    #[test]
    fn a_straight_line_is_that_of_the_textbook() {
        let x = [0.0, 1.0, 2.0, 3.0, 4.0];
        let y = [1.1, 2.9, 5.2, 7.1, 8.8];
        let mut normal = NormalEquations::new(2);
        for part in [0..2, 2..5] {
            let columns = [vec![1.0; part.len()], x[part.clone()].to_vec()];
            normal.add(&columns, &y[part]);
        }
        let line = normal.solve(0.0).expect("two columns");
        // Slope Σ(x−x̄)(y−ȳ)/Σ(x−x̄)² = 19.6/10, variance of the slope 1/10, of the intercept 1/5 + 4/10.
        let expected = [(1.1, 0.6), (1.96, 0.1)];
        for (index, (value, variance)) in expected.into_iter().enumerate() {
            assert!((line.coefficients[index] - value).abs() < 1e-12);
            assert!((line.unit_variances[index] - variance).abs() < 1e-12);
        }
        let residuals = x.iter().zip(&y).map(|(x, y)| y - 1.1 - 1.96 * x);
        let mean_square = residuals.map(|r| r * r).sum::<f64>() / 5.0;
        assert!((line.mean_square - mean_square).abs() < 1e-12);
    }

    /// A column without energy takes no part and leaves the others alone; columns that are not finite are reported.
    #[test]
    fn columns_without_energy_take_no_part_and_bad_ones_are_reported() {
        let y = [1.0, 2.0, 2.0];
        let mut normal = NormalEquations::new(2);
        normal.add(&[vec![0.0; 3], vec![1.0, 2.0, 2.0]], &y);
        let solution = normal.solve(1e-9).expect("one column with energy");
        assert!(solution.coefficients[0] == 0.0 && (solution.coefficients[1] - 1.0).abs() < 1e-8);
        let mut bad = NormalEquations::new(1);
        bad.add(&[vec![1.0, f64::NAN, 1.0]], &y);
        let refusal = bad.solve(1e-9).expect_err("not finite").to_string();
        assert!(refusal.contains("1 columns over 3 rows"), "{refusal}");
        let mut equal = NormalEquations::new(2);
        equal.add(&[vec![1.0; 3], vec![1.0; 3]], &y);
        assert!(equal.solve(0.0).is_err());
        assert!(equal.solve(1e-9).is_ok());
    }
}
