//! Outliers: touches that no smooth explanation predicts, suspected before any effect is named.
//!
//! Each touch is predicted from all others by a ridge on the whole library; those whose standardised leave-one-out residual
//! (Belsley, Kuh and Welsch 1980) exceeds many robust standard deviations are suspects, the worst first. Evidence decides
//! whether they are rejected: an outlier is uniform over a wide range instead of normal around the model.

use metrology::statistics::MAD_FACTOR;
use nalgebra::{DMatrix, DVector};

use crate::linear::{add_scaled, cholesky, dot, forward, solve_cholesky};

/// Standardised residuals beyond this are suspect.
const SUSPECT: f64 = 5.0;
/// Rows with at least this share of the worst residual are suspect with it.
const ALIKE: f64 = 0.8;
/// Largest share of the touches that may be outliers.
const MOST: f64 = 0.12;
/// Prior probability that a touch is an outlier.
const OUTLIER: f64 = 0.005;
/// Width of the uniform distribution of outliers, m: half a millimetre.
const WIDTH: f64 = 5e-4;
/// Lines of a triangular matrix that are multiplied at once.
const LINES: usize = 128;

/// Log evidence that a number of outliers adds to that of the other touches.
pub fn log_evidence(outliers: usize) -> f64 {
    outliers as f64 * (OUTLIER.ln() - WIDTH.ln())
}

/// Largest number of outliers among the touches of a session.
pub fn most_outliers(touches: usize) -> usize {
    ((touches as f64 * MOST) as usize).max(1)
}

/// Rows that the columns of `blocks`, fitted to the others, do not predict.
pub fn suspects(blocks: &[&[Vec<f64>]], y: &[f64]) -> Vec<usize> {
    let mut ridge = Ridge::new(blocks, y);
    let most = most_outliers(y.len());
    let mut found = Vec::new();
    while found.len() < most {
        let Some(standardised_residuals) = ridge.standardised_residuals() else {
            break;
        };
        let worst =
            (standardised_residuals.iter()).fold(0.0_f64, |worst, &(_, own)| worst.max(own));
        if worst <= SUSPECT {
            break;
        }
        // Those nearly as far off as the worst are suspect with it.
        for (row, own) in standardised_residuals {
            if own > SUSPECT.max(ALIKE * worst) {
                ridge.remove(row);
                found.push(row);
            }
        }
    }
    found
}

/// A ridge of the values on columns, over the rows in use.
struct Ridge<'a> {
    y: &'a [f64],
    used: Vec<bool>,
    /// Values of the columns at each row.
    rows: DMatrix<f64>,
    /// Inner products of the columns with one another, row-major, and with the values; that of the values with themselves.
    gram: Vec<f64>,
    right: Vec<f64>,
    yy: f64,
}

impl<'a> Ridge<'a> {
    fn new(blocks: &[&[Vec<f64>]], y: &'a [f64]) -> Self {
        let columns: Vec<&Vec<f64>> = blocks.iter().copied().flatten().collect();
        let rows = DMatrix::from_fn(columns.len(), y.len(), |column, row| columns[column][row]);
        let gram = &rows * rows.transpose();
        let right = &rows * DVector::from_column_slice(y);
        Self {
            y,
            used: vec![true; y.len()],
            rows,
            gram: gram.data.into(),
            right: right.data.into(),
            yy: dot(y, y),
        }
    }

    fn values(&self, row: usize) -> &[f64] {
        let n = self.right.len();
        &self.rows.as_slice()[row * n..(row + 1) * n]
    }

    /// Takes a row out of use.
    fn remove(&mut self, row: usize) {
        let n = self.right.len();
        let values = self.values(row).to_vec();
        for (line, value) in self.gram.chunks_exact_mut(n.max(1)).zip(&values) {
            add_scaled(line, -value, &values);
        }
        add_scaled(&mut self.right, -self.y[row], &values);
        self.yy -= self.y[row] * self.y[row];
        self.used[row] = false;
    }

    /// Rows in use.
    fn in_use(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.used.len()).filter(|&row| self.used[row])
    }

    /// Squared lengths of the rows, each multiplied by a lower triangular matrix.
    fn leverages(&self, triangle: &DMatrix<f64>) -> Vec<f64> {
        let n = triangle.nrows();
        let mut leverages = vec![0.0; self.y.len()];
        for first in (0..n).step_by(LINES) {
            // Nothing of the triangle stands right of its diagonal.
            let last = (first + LINES).min(n);
            let white = triangle.view((first, 0), (last - first, last)) * self.rows.rows(0, last);
            for (leverage, white) in leverages.iter_mut().zip(white.column_iter()) {
                *leverage += white.norm_squared();
            }
        }
        leverages
    }

    /// Absolute leave-one-out residuals of the rows in use over their robust standard deviation, at the strength of the ridge
    /// that maximises the evidence.
    fn standardised_residuals(&self) -> Option<Vec<(usize, f64)>> {
        let n = self.right.len();
        let count = self.in_use().count();
        if count == 0 {
            return None;
        }
        let mut best: Option<(f64, Vec<f64>, Vec<f64>)> = None;
        for power in [1.0, 10.0, 100.0, 1e3, 1e4] {
            let mut factor = self.gram.clone();
            for i in 0..n {
                factor[i * n + i] += 1.0 / power;
            }
            let log_determinant = cholesky(&mut factor, n)?;
            let mut mean = self.right.clone();
            solve_cholesky(&factor, n, &mut mean);
            let residual = (self.yy - dot(&self.right, &mean)).max(1e-30);
            let evidence = -0.5 * count as f64 * residual.ln()
                - 0.5 * (log_determinant + n as f64 * f64::ln(power));
            if best.as_ref().is_none_or(|(known, _, _)| evidence > *known) {
                best = Some((evidence, factor, mean));
            }
        }
        let (_, factor, mean) = best?;
        let mut inverse = DMatrix::identity(n, n);
        for mut column in inverse.column_iter_mut() {
            forward(&factor, n, column.as_mut_slice());
        }
        let leverages = self.leverages(&inverse);
        let residual = |row: usize| {
            let predicted = dot(self.values(row), &mean);
            let free = (1.0 - leverages[row]).max(1e-3).sqrt();
            (row, ((self.y[row] - predicted) / free).abs())
        };
        let mut residuals: Vec<(usize, f64)> = self.in_use().map(residual).collect();
        let mut sizes: Vec<f64> = residuals.iter().map(|&(_, size)| size).collect();
        let middle = count / 2;
        let (_, &mut median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        let deviation = MAD_FACTOR * median.max(1e-12);
        for (_, residual) in &mut residuals {
            *residual /= deviation;
        }
        Some(residuals)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    const ROWS: usize = 90;

    fn drawn(random: &mut Pcg64Mcg, size: f64) -> Vec<f64> {
        (0..ROWS)
            .map(|_| size * random.sample::<f64, _>(StandardNormal))
            .collect()
    }

    /// Three columns of about unit length without order, and what two of them, 30 and 60 µm at a row, and 1 µm of noise add up to.
    fn session() -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut random = Pcg64Mcg::seed_from_u64(31);
        let unit = 1.0 / (ROWS as f64).sqrt();
        let columns: Vec<Vec<f64>> = (0..3).map(|_| drawn(&mut random, unit)).collect();
        let noise = drawn(&mut random, 1e-6);
        let size = 3e-5 / unit;
        let y = (0..ROWS).map(|row| size * (columns[0][row] - 2.0 * columns[2][row]) + noise[row]);
        let y = y.collect();
        (columns, y)
    }

    /// A ridge from which rows were taken is that of the others: no product of theirs is left in it.
    #[test]
    fn a_row_that_is_taken_out_leaves_the_ridge_of_the_others() {
        let (columns, y) = session();
        let mut some = Ridge::new(&[&columns], &y);
        let taken = [4, 17, 60];
        for row in taken {
            some.remove(row);
        }
        let kept = |values: &[f64]| -> Vec<f64> {
            let rows = values.iter().enumerate();
            let kept = rows.filter(|(row, _)| !taken.contains(row));
            kept.map(|(_, value)| *value).collect()
        };
        let rest: Vec<Vec<f64>> = columns.iter().map(|column| kept(column)).collect();
        let (others, alone) = (kept(&y), some.standardised_residuals().expect("solvable"));
        let expected = Ridge::new(&[&rest], &others).standardised_residuals();
        for ((row, own), (_, other)) in alone.into_iter().zip(expected.expect("solvable")) {
            assert!(
                (own - other).abs() < 1e-9 * other.max(1.0),
                "{row}: {own}, {other}"
            );
        }
    }

    /// Touches that are off by many times the noise are suspects, whatever smooth signal they lie on; no others are.
    #[test]
    fn what_no_column_predicts_is_suspect() {
        let (columns, mut y) = session();
        assert_eq!(suspects(&[&columns], &y), []);
        for (row, off) in [(12, 4e-5), (71, -9e-5)] {
            y[row] += off;
        }
        assert_eq!(suspects(&[&columns], &y), [71, 12]);
    }
}
