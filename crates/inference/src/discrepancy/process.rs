//! A Gaussian-process discrepancy over the rows of a session, and the part of columns that it explains.
//!
//! A smooth process is a low-rank kernel MᵀM with MMᵀ = QTQᵀ, where T is tridiagonal ([`super::tridiagonal`]); scatter is a diagonal kernel, an independent variance for each row (Rasmussen and Williams 2006, 2.7 and 8.3). Variances
//! are relative to that of the noise. Kernels are over deviations in m.

use std::cell::OnceCell;

use nalgebra::{DMatrix, DVector};

use super::kind::Kind;
use super::tridiagonal::Tridiagonal;
use crate::columns::{Rows, matrix_of};
use crate::linear::{add_scaled, scale, whiten};

/// Directions whose power beside a basis is below this share of the largest are dropped.
const MIN_POWER: f64 = 1e-3;
/// Kernels that differ by less than this share are one.
const ALIKE: f64 = 0.02;
/// A pivoted factorisation ends when no row keeps more than this share of the largest variance.
const NEGLIGIBLE: f64 = 1e-3;

/// A discrepancy process over the rows of a session.
#[derive(Debug, Clone)]
pub struct Discrepancy {
    /// What it depends on.
    pub kind: Kind,
    form: Form,
    /// Natural logarithm of its prior probability among the discrepancies.
    pub log_prior: f64,
}

/// The kernel over the weighted active rows, for unit variance.
#[derive(Debug, Clone)]
enum Form {
    /// MᵀM.
    Smooth(Factor),
    /// A diagonal kernel: these variances, independent from row to row.
    Scatter(Vec<f64>),
}

/// The factor of a kernel MᵀM.
#[derive(Debug, Clone)]
struct Factor {
    /// M, with a row for each direction.
    lines: DMatrix<f64>,
    /// Made when it is first asked for.
    rotated: OnceCell<Rotated>,
}

/// MMᵀ = QTQᵀ.
#[derive(Debug, Clone)]
struct Rotated {
    /// Q.
    rotation: DMatrix<f64>,
    /// T.
    products: Tridiagonal,
}

impl Factor {
    fn new(lines: DMatrix<f64>) -> Self {
        Self {
            lines,
            rotated: OnceCell::new(),
        }
    }

    fn rotated(&self) -> &Rotated {
        self.rotated.get_or_init(|| {
            let products = &self.lines * self.lines.transpose();
            let (rotation, diagonal, off_diagonal) = products.symmetric_tridiagonalize().unpack();
            Rotated {
                rotation,
                products: Tridiagonal {
                    diagonal: diagonal.data.into(),
                    off_diagonal: off_diagonal.data.into(),
                },
            }
        })
    }
}

/// Principal directions of the span of the rows of a matrix, again a row for each, with their powers.
fn leading(lines: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let eigen = (lines * lines.transpose()).symmetric_eigen();
    (eigen.eigenvectors.transpose() * lines, eigen.eigenvalues)
}

/// Leading columns of a covariance over the rows by a pivoted Cholesky factorisation, at most `most`.
///
/// `variances` is its diagonal; `column` gives the covariances of all rows with one row. `None` for a diagonal of zeros.
pub fn leading_columns(
    mut variances: Vec<f64>,
    most: usize,
    column: impl Fn(usize) -> Vec<f64>,
) -> Option<Vec<Vec<f64>>> {
    let largest = variances
        .iter()
        .fold(0.0_f64, |most, &value| most.max(value));
    if largest <= 0.0 {
        return None;
    }
    let mut columns: Vec<Vec<f64>> = Vec::new();
    while columns.len() < most {
        let (pivot, &value) = variances
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))?;
        if value < NEGLIGIBLE * largest {
            break;
        }
        let mut column = column(pivot);
        for known in &columns {
            add_scaled(&mut column, -known[pivot], known);
        }
        scale(&mut column, 1.0 / value.sqrt());
        for (rest, value) in variances.iter_mut().zip(&column) {
            *rest -= value * value;
        }
        variances[pivot] = 0.0;
        columns.push(column);
    }
    Some(columns)
}

/// Share of a variance in units of the noise's in both together.
fn share(variance_ratio: f64) -> f64 {
    variance_ratio / (1.0 + variance_ratio)
}

/// Columns projected onto the basis of a discrepancy.
pub enum Projected<'a> {
    /// Inner products of each column with the directions of a smooth process.
    Smooth(DMatrix<f64>, &'a Tridiagonal),
    /// The columns, and the variances of the rows.
    Scatter(&'a DMatrix<f64>, &'a [f64]),
}

impl Projected<'_> {
    /// Explained part of the columns' Gram matrix at a variance ratio p, and the log-determinant of I + p·K.
    pub fn explained_gram(&self, variance_ratio: f64) -> (DMatrix<f64>, f64) {
        match self {
            Self::Smooth(crossed, lines) => {
                let factor = lines.factorise(variance_ratio);
                let whitened = factor.forward(crossed.clone());
                (&whitened * whitened.transpose(), factor.log_determinant)
            }
            Self::Scatter(columns, variances) => {
                let mut weighted = (*columns).clone();
                for mut column in weighted.column_iter_mut() {
                    for (value, variance) in column.iter_mut().zip(*variances) {
                        *value *= share(variance_ratio * variance).sqrt();
                    }
                }
                let log_determinant = variances
                    .iter()
                    .map(|variance| (variance_ratio * variance).ln_1p())
                    .sum();
                (weighted.transpose() * weighted, log_determinant)
            }
        }
    }
}

impl Discrepancy {
    /// The process whose kernel is the sum of the outer products of columns over the active rows, at least one.
    pub fn new(kind: Kind, columns: &[Vec<f64>], log_prior: f64) -> Self {
        let rows = columns.first().map_or(0, Vec::len);
        Self::from_lines(kind, matrix_of(rows, columns).transpose(), log_prior)
    }

    /// The process of these independent variances of the rows.
    pub fn scatter(kind: Kind, variances: Vec<f64>, log_prior: f64) -> Self {
        Self {
            kind,
            form: Form::Scatter(variances),
            log_prior,
        }
    }

    /// The process of columns that are the rows of a matrix, at least one.
    fn from_lines(kind: Kind, across: DMatrix<f64>, log_prior: f64) -> Self {
        Self {
            kind,
            form: Form::Smooth(Factor::new(across)),
            log_prior,
        }
    }

    /// Restricts the process to a subset of its rows.
    pub fn restricted_to(&self, kept: &[usize]) -> Self {
        match &self.form {
            Form::Smooth(factor) => Self::from_lines(
                self.kind.clone(),
                factor.lines.select_columns(kept),
                self.log_prior,
            ),
            Form::Scatter(variances) => Self {
                form: Form::Scatter(kept.iter().map(|&row| variances[row]).collect()),
                ..self.clone()
            },
        }
    }

    /// The process over rows whose noise is correlated, whitened for it.
    ///
    /// Larger scatter is that of the innovations.
    pub fn whitened_for(&self, rows: &Rows) -> Self {
        match &self.form {
            Form::Smooth(factor) => {
                let mut down = factor.lines.transpose();
                let correlated = rows.correlated();
                for mut column in down.column_iter_mut() {
                    whiten(
                        &mut column.as_mut_slice()[..correlated],
                        rows.lag1_correlation,
                    );
                }
                Self::from_lines(self.kind.clone(), down.transpose(), self.log_prior)
            }
            Form::Scatter(_) => self.clone(),
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        match &self.form {
            Form::Smooth(factor) => factor.lines.ncols(),
            Form::Scatter(variances) => variances.len(),
        }
    }

    /// True for two smooth processes that depend on the same and whose kernels are proportional but for the share [`ALIKE`].
    pub fn is_alike(&self, other: &Self) -> bool {
        let (Form::Smooth(own), Form::Smooth(others)) = (&self.form, &other.form) else {
            return false;
        };
        let power = |of: &Tridiagonal| -> f64 {
            let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
            squares(&of.diagonal) + 2.0 * squares(&of.off_diagonal)
        };
        self.kind == other.kind
            && (&own.lines * others.lines.transpose()).norm_squared()
                > (1.0 - ALIKE)
                    * (power(&own.rotated().products) * power(&others.rotated().products)).sqrt()
    }

    /// Trace of the kernel.
    pub fn trace(&self) -> f64 {
        match &self.form {
            Form::Smooth(factor) => factor.lines.norm_squared(),
            Form::Scatter(variances) => variances.iter().sum(),
        }
    }

    /// Effective degrees of freedom at a variance ratio p: the trace of p·K·(I + p·K)⁻¹.
    pub fn effective_dof(&self, variance_ratio: f64) -> f64 {
        match &self.form {
            Form::Smooth(factor) => (factor.rotated().products)
                .factorise(variance_ratio)
                .effective_dof(variance_ratio),
            Form::Scatter(variances) => variances
                .iter()
                .map(|variance| share(variance_ratio * variance))
                .sum(),
        }
    }

    /// Slopes of the log likelihoods of some columns of residuals, whose noise has unit variance, by the variance of the process where that
    /// is nothing: the scores of Lin (1997, Biometrika 84, 309–326, eq. 3).
    pub fn scores(&self, residuals: &DMatrix<f64>) -> Vec<f64> {
        let powers: Vec<f64> = match &self.form {
            Form::Smooth(factor) => {
                let along = &factor.lines * residuals;
                along.column_iter().map(|own| own.norm_squared()).collect()
            }
            Form::Scatter(variances) => (residuals.column_iter())
                .map(|own| {
                    let rows = own.iter().zip(variances);
                    rows.map(|(value, variance)| variance * value * value).sum()
                })
                .collect(),
        };
        let trace = self.trace();
        powers.iter().map(|power| 0.5 * (power - trace)).collect()
    }

    /// Posterior mean of the process given values over the rows, at this variance ratio.
    pub fn posterior_mean(&self, variance_ratio: f64, values: &[f64]) -> Vec<f64> {
        match &self.form {
            Form::Smooth(factor) => {
                let Rotated { rotation, products } = factor.rotated();
                let along = &factor.lines * DVector::from_column_slice(values);
                let mut along = rotation.tr_mul(&along);
                (products.factorise(variance_ratio)).solve(along.as_mut_slice());
                factor.lines.tr_mul(&(rotation * along)).data.into()
            }
            Form::Scatter(variances) => (variances.iter().zip(values))
                .map(|(variance, value)| share(variance_ratio * variance) * value)
                .collect(),
        }
    }

    /// Standard deviation of each row over that of the noise at this variance ratio; `None` for a smooth process.
    pub fn widening(&self, variance_ratio: f64) -> Option<Vec<f64>> {
        match &self.form {
            Form::Smooth(..) => None,
            Form::Scatter(variances) => Some(
                (variances.iter())
                    .map(|variance| (1.0 + variance_ratio * variance).sqrt())
                    .collect(),
            ),
        }
    }

    /// Projects columns over the same rows onto the basis of the process.
    pub fn project<'a>(&'a self, columns: &'a DMatrix<f64>) -> Projected<'a> {
        match &self.form {
            Form::Smooth(factor) => {
                let Rotated { rotation, products } = factor.rotated();
                let crossed = (&factor.lines * columns).transpose() * rotation;
                Projected::Smooth(crossed, products)
            }
            Form::Scatter(variances) => Projected::Scatter(columns, variances),
        }
    }

    /// The rows of M: columns over the session's rows whose outer products sum to the kernel; `None` for scatter.
    pub fn columns(&self) -> Option<Vec<Vec<f64>>> {
        let Form::Smooth(Factor { lines, .. }) = &self.form else {
            return None;
        };
        let line = |line: nalgebra::RowDVector<f64>| line.data.into();
        Some((lines.row_iter().map(|row| line(row.into_owned()))).collect())
    }

    /// Share of the kernel's trace that an orthonormal basis, the columns of a matrix over the active rows, leaves; `None` for
    /// scatter.
    pub fn share_beside(&self, basis: &DMatrix<f64>) -> Option<f64> {
        let Form::Smooth(Factor { lines, .. }) = &self.form else {
            return None;
        };
        Some(1.0 - (lines * basis).norm_squared() / self.trace())
    }

    /// The process orthogonal to an orthonormal basis, the columns of a matrix over the active rows; `None` where nothing remains.
    pub fn orthogonal_to(&self, basis: &DMatrix<f64>) -> Option<Self> {
        let Form::Smooth(Factor { lines, .. }) = &self.form else {
            return None;
        };
        let most = (lines * lines.transpose()).symmetric_eigenvalues().max();
        let left = lines - (lines * basis) * basis.transpose();
        let (directions, powers) = leading(&left);
        let kept: Vec<usize> = (0..powers.len())
            .filter(|&number| powers[number] > MIN_POWER * most)
            .collect();
        let kept = directions.select_rows(&kept);
        (kept.nrows() > 0).then(|| Self::from_lines(self.kind.clone(), kept, self.log_prior))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::{dot, unwhiten};

    /// Columns without order, and values over the same rows.
    fn columns(rows: usize, count: usize) -> Vec<Vec<f64>> {
        let value =
            |row: usize, column: usize| ((row * 37 + column * 101 + 7) % 23) as f64 / 23.0 - 0.4;
        let column = |column| {
            (0..rows)
                .map(|row| value(row * (column + 1), column))
                .collect()
        };
        (0..count).map(column).collect()
    }

    /// Against the dense matrix I + p·K that the tridiagonal products stand for.
    #[test]
    fn the_tridiagonal_form_is_the_dense_process() {
        let (rows, variance_ratio) = (17, 3.5);
        let made = columns(rows, 6);
        let discrepancy = Discrepancy::new(Kind::Region, &made, 0.0);
        let down = DMatrix::from_vec(rows, 6, made.concat());
        let kernel = &down * down.transpose();
        let whole = DMatrix::identity(rows, rows) + &kernel * variance_ratio;
        let inverse = whole.clone().try_inverse().expect("positive definite");

        let near =
            |value: f64, expected: f64| (value - expected).abs() < 1e-11 * (1.0 + expected.abs());
        assert!(near(discrepancy.trace(), kernel.trace()));
        assert!(near(
            discrepancy.effective_dof(variance_ratio),
            (&kernel * variance_ratio * &inverse).trace()
        ));

        let values = columns(rows, 9).pop().expect("nine");
        let y = DVector::from_column_slice(&values);
        let part = discrepancy.posterior_mean(variance_ratio, &values);
        let expected = &kernel * variance_ratio * &inverse * &y;
        assert!(part.iter().zip(&expected).all(|(&a, &b)| near(a, b)));

        let column = DMatrix::from_vec(rows, 1, values.clone());
        let (explained, log_determinant) =
            discrepancy.project(&column).explained_gram(variance_ratio);
        assert!(near(log_determinant, whole.determinant().ln()));
        let beside = dot(&values, &values) - explained[0];
        assert!(near(beside, (y.transpose() * &inverse * &y)[0]));
    }

    /// The score is the slope of the log likelihood of N(0, I + p·K) at p = 0, of a smooth process and of scatter.
    #[test]
    fn the_score_is_the_slope_of_the_likelihood() {
        let rows = 17;
        let values = DMatrix::from_vec(rows, 2, columns(rows, 9)[7..].concat()) * 3.0;
        let scatter = (0..rows).map(|row| 0.1 * (row % 4) as f64).collect();
        for discrepancy in [
            Discrepancy::new(Kind::Region, &columns(rows, 6), 0.0),
            Discrepancy::scatter(Kind::Noise, scatter, 0.0),
        ] {
            let slopes = discrepancy.scores(&values);
            let step = 1e-6;
            let (explained, log_determinant) = discrepancy.project(&values).explained_gram(step);
            for (column, slope) in slopes.iter().enumerate() {
                let rise = 0.5 * (explained[(column, column)] - log_determinant) / step;
                assert!(
                    (slope - rise).abs() < 1e-3 * slope.abs().max(1.0),
                    "{slope}, {rise}"
                );
            }
        }
    }

    /// A kernel is like itself at any size, and not like that of other columns or of another kind.
    #[test]
    fn proportional_kernels_of_one_kind_are_alike() {
        let made = columns(17, 4);
        let of = |kind, columns: &[Vec<f64>]| Discrepancy::new(kind, columns, 0.0);
        let one = of(Kind::AxisRange(1), &made);
        let mut larger = made.clone();
        for value in larger.iter_mut().flatten() {
            *value *= -3.0;
        }
        assert!(one.is_alike(&of(Kind::AxisRange(1), &larger)));
        assert!(!one.is_alike(&of(Kind::AxisRange(2), &made)));
        assert!(!one.is_alike(&of(Kind::AxisRange(1), &made[..3])));
    }

    /// Scatter against the dense diagonal matrix that it is.
    #[test]
    fn scatter_is_a_diagonal_process() {
        let (variances, variance_ratio) = ([0.0, 2.0, 0.5, 0.0, 1.0], 3.0);
        let discrepancy = Discrepancy {
            kind: Kind::Noise,
            form: Form::Scatter(variances.to_vec()),
            log_prior: 0.0,
        };
        let whole = DMatrix::from_fn(5, 5, |i, k| {
            if i == k {
                1.0 + variance_ratio * variances[i]
            } else {
                0.0
            }
        });
        let inverse = whole.clone().try_inverse().expect("positive definite");
        let two = DMatrix::from_fn(5, 2, |row, column| (row * 3 + column * 7 % 5) as f64 - 2.0);
        let (explained, log_determinant) = discrepancy.project(&two).explained_gram(variance_ratio);
        let beside = two.transpose() * &two - explained;
        assert!((beside - two.transpose() * &inverse * &two).amax() < 1e-12);
        assert!((log_determinant - whole.determinant().ln()).abs() < 1e-12);
        let expected: f64 = (0..5).map(|row| 1.0 - inverse[(row, row)]).sum();
        assert!((discrepancy.effective_dof(variance_ratio) - expected).abs() < 1e-12);
    }

    /// Whitened, the covariance of process and AR(1) noise together is L(C + p·K)Lᵀ, where L·C·Lᵀ = I: the dense matrices.
    #[test]
    fn a_process_beside_correlated_noise_is_whitened_with_it() {
        let (rows, references, lag1, variance_ratio) = (11, 2, 0.6_f64, 2.0);
        let made = columns(rows + references, 4);
        let all = Rows {
            active: vec![true; rows + references],
            touches: rows,
            lag1_correlation: lag1,
        };
        let discrepancy = Discrepancy::new(Kind::Time, &made, 0.0).whitened_for(&all);
        let noise = DMatrix::from_fn(rows + references, rows + references, |i, k| {
            if i == k {
                1.0
            } else if i.max(k) < rows {
                lag1.powi(i.abs_diff(k) as i32)
            } else {
                0.0
            }
        });
        let down = DMatrix::from_vec(rows + references, 4, made.concat());
        let whole = (&noise + &down * down.transpose() * variance_ratio)
            .try_inverse()
            .expect("positive definite");
        let values = columns(rows + references, 9).pop().expect("nine");
        let y = DVector::from_column_slice(&values);
        let white = DVector::from_vec(all.white(&values));
        let column = DMatrix::from_vec(rows + references, 1, white.data.as_vec().clone());
        let (explained, _) = discrepancy.project(&column).explained_gram(variance_ratio);
        let beside = white.dot(&white) - explained[0];
        assert!((beside - (y.transpose() * &whole * &y)[0]).abs() < 1e-10 * beside);
        // Its posterior mean, taken back, is K·p·(C + p·K)⁻¹·y.
        let mut mean = discrepancy.posterior_mean(variance_ratio, white.as_slice());
        unwhiten(&mut mean[..rows], lag1);
        let expected = &down * down.transpose() * variance_ratio * &whole * &y;
        assert!(
            mean.iter()
                .zip(&expected)
                .all(|(a, b)| (a - b).abs() < 1e-10)
        );
    }

    /// Over fewer rows it is what its columns over those rows make.
    #[test]
    fn a_process_over_fewer_rows_is_that_of_its_columns() {
        let made = columns(17, 5);
        let kept = [0, 3, 4, 8, 9, 12, 16];
        let fewer: Vec<Vec<f64>> = (made.iter())
            .map(|column| kept.iter().map(|&row| column[row]).collect())
            .collect();
        let restricted = Discrepancy::new(Kind::Time, &made, 0.0).restricted_to(&kept);
        let expected = Discrepancy::new(Kind::Time, &fewer, 0.0);
        let kernel = |discrepancy: &Discrepancy| {
            let columns = discrepancy.columns().expect("smooth");
            let down = DMatrix::from_vec(kept.len(), columns.len(), columns.concat());
            &down * down.transpose()
        };
        assert!((kernel(&restricted) - kernel(&expected)).amax() < 1e-12);
    }
}
