//! A discrepancy process over the rows of a session, and what it has of columns that it stands beside.
//!
//! Smooth ones are sums of lines whose products with one another are tridiagonal ([`super::held`]); scatter is something
//! of its own at each row. Variances are told over that of the noise.

use nalgebra::{DMatrix, DVector};

use super::Kind;
use super::held::Lines;
use crate::pool::remove;

/// Of what the vocabulary has, a rival keeps only directions of at least this share of its largest power.
const OWN: f64 = 1e-3;

/// One discrepancy process over the rows of a session.
#[derive(Debug, Clone)]
pub struct Rival {
    /// What it depends on.
    pub kind: Kind,
    pub(super) form: Form,
    /// Natural logarithm of its prior probability among the rivals.
    pub log_prior: f64,
}

/// What a process is over the weighted active rows, for unit variance.
#[derive(Debug, Clone)]
pub(super) enum Form {
    /// The sum of lines (a row of the matrix each), at sizes drawn for each; with the products of the lines.
    Smooth(DMatrix<f64>, Lines),
    /// Something of its own at each row, of these variances.
    Scatter(Vec<f64>),
}

/// What columns make together as columns at right angles to one another, a row of the matrix for each, with their powers.
fn leading(columns: &[Vec<f64>]) -> (DMatrix<f64>, Vec<f64>) {
    let rows = columns.first().map_or(0, Vec::len);
    let down = DMatrix::from_vec(rows, columns.len(), columns.concat());
    let across = down.transpose();
    let eigen = (&across * down).symmetric_eigen();
    (
        eigen.eigenvectors.transpose() * across,
        eigen.eigenvalues.data.into(),
    )
}

/// Share of a variance in units of the noise's in both together.
fn share(power: f64) -> f64 {
    power / (1.0 + power)
}

/// Columns that have met a process.
pub(crate) enum Met<'a> {
    /// Products of each column with its lines.
    Smooth(DMatrix<f64>, &'a Lines),
    /// The columns, and its variances at the rows.
    Scatter(&'a DMatrix<f64>, &'a [f64]),
}

impl Met<'_> {
    /// What the process at a variance over that of the noise has of the columns' products with one another, and the
    /// logarithm of its determinant together with the noise.
    pub(crate) fn had(&self, power: f64) -> (DMatrix<f64>, f64) {
        match self {
            Self::Smooth(crossed, lines) => {
                let held = lines.held(power);
                let seen = held.forward(crossed.clone());
                (&seen * seen.transpose(), held.log_determinant)
            }
            Self::Scatter(columns, variances) => {
                let mut own = (*columns).clone();
                for mut column in own.column_iter_mut() {
                    for (value, variance) in column.iter_mut().zip(*variances) {
                        *value *= share(power * variance).sqrt();
                    }
                }
                let log_determinant = variances.iter().map(|own| (power * own).ln_1p()).sum();
                (own.transpose() * own, log_determinant)
            }
        }
    }
}

impl Rival {
    /// Of at least one column over the active rows.
    pub(super) fn new(kind: Kind, columns: &[Vec<f64>], log_prior: f64) -> Self {
        let rows = columns.first().map_or(0, Vec::len);
        let down = DMatrix::from_vec(rows, columns.len(), columns.concat());
        Self::of(kind, down.transpose(), log_prior)
    }

    /// Of columns that are the rows of a matrix, at least one.
    fn of(kind: Kind, across: DMatrix<f64>, log_prior: f64) -> Self {
        let products = &across * across.transpose();
        let (turn, own, next) = products.symmetric_tridiagonalize().unpack();
        let lines = Lines {
            own: own.data.into(),
            next: next.data.into(),
        };
        Self {
            kind,
            form: Form::Smooth(turn.transpose() * across, lines),
            log_prior,
        }
    }

    /// It over some of its rows only.
    pub(crate) fn over(&self, kept: &[usize]) -> Self {
        match &self.form {
            Form::Smooth(lines, _) => Self::of(
                self.kind.clone(),
                lines.select_columns(kept),
                self.log_prior,
            ),
            Form::Scatter(own) => Self {
                form: Form::Scatter(kept.iter().map(|&row| own[row]).collect()),
                ..self.clone()
            },
        }
    }

    /// Number of rows that it is over.
    pub(crate) fn rows(&self) -> usize {
        match &self.form {
            Form::Smooth(lines, _) => lines.ncols(),
            Form::Scatter(own) => own.len(),
        }
    }

    /// Sum of its variances over the rows, for unit variance.
    pub(crate) fn trace(&self) -> f64 {
        match &self.form {
            Form::Smooth(_, lines) => lines.own.iter().sum(),
            Form::Scatter(own) => own.iter().sum(),
        }
    }

    /// Degrees of freedom that it takes up at a variance over that of the noise.
    pub(crate) fn taken(&self, power: f64) -> f64 {
        match &self.form {
            Form::Smooth(_, lines) => lines.held(power).taken(power),
            Form::Scatter(own) => own.iter().map(|own| share(power * own)).sum(),
        }
    }

    /// Its most probable part of values over the rows, at a variance over that of the noise.
    pub(crate) fn part(&self, power: f64, values: &[f64]) -> Vec<f64> {
        match &self.form {
            Form::Smooth(lines, products) => {
                let mut along = lines * DVector::from_column_slice(values);
                products.held(power).solve(along.as_mut_slice());
                lines.tr_mul(&along).data.into()
            }
            Form::Scatter(own) => (own.iter().zip(values))
                .map(|(own, value)| share(power * own) * value)
                .collect(),
        }
    }

    /// By how much it makes the standard deviation of each row larger than that of the noise; `None` for what is smooth.
    pub(crate) fn widening(&self, power: f64) -> Option<Vec<f64>> {
        match &self.form {
            Form::Smooth(..) => None,
            Form::Scatter(own) => Some(own.iter().map(|own| (1.0 + power * own).sqrt()).collect()),
        }
    }

    /// What it needs of some columns over its rows to be set beside them.
    pub(crate) fn meet<'a>(&'a self, columns: &'a DMatrix<f64>) -> Met<'a> {
        match &self.form {
            Form::Smooth(lines, products) => Met::Smooth((lines * columns).transpose(), products),
            Form::Scatter(own) => Met::Scatter(columns, own),
        }
    }

    /// The columns that it is made of, for unit variance; `None` where it is something of its own at each row.
    pub(crate) fn columns(&self) -> Option<Vec<Vec<f64>>> {
        let Form::Smooth(lines, _) = &self.form else {
            return None;
        };
        let line = |line: nalgebra::RowDVector<f64>| line.data.into();
        Some((lines.row_iter().map(|row| line(row.into_owned()))).collect())
    }

    /// What is left of it beside an orthonormal basis over the active rows; `None` where nothing is.
    pub(crate) fn beside(&self, basis: &[Vec<f64>]) -> Option<Self> {
        let largest = |powers: &[f64]| powers.iter().copied().fold(0.0, f64::max);
        let mut columns = self.columns()?;
        let most = largest(&leading(&columns).1);
        for column in &mut columns {
            remove(column, basis);
        }
        let (own, powers) = leading(&columns);
        let kept: Vec<Vec<f64>> = (own.row_iter().zip(&powers))
            .filter(|&(_, &power)| power > OWN * most)
            .map(|(column, _)| column.iter().copied().collect())
            .collect();
        (!kept.is_empty()).then(|| Self::new(self.kind.clone(), &kept, self.log_prior))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::dot;

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
    fn a_process_held_by_its_lines_is_the_process() {
        let (rows, power) = (17, 3.5);
        let made = columns(rows, 6);
        let rival = Rival::new(Kind::Region, &made, 0.0);
        let down = DMatrix::from_vec(rows, 6, made.concat());
        let kernel = &down * down.transpose();
        let whole = DMatrix::identity(rows, rows) + &kernel * power;
        let inverse = whole.clone().try_inverse().expect("positive definite");

        let near = |one: f64, other: f64| (one - other).abs() < 1e-11 * (1.0 + other.abs());
        assert!(near(rival.trace(), kernel.trace()));
        assert!(near(
            rival.taken(power),
            (&kernel * power * &inverse).trace()
        ));

        let values = columns(rows, 9).pop().expect("nine");
        let y = DVector::from_column_slice(&values);
        let part = rival.part(power, &values);
        let expected = &kernel * power * &inverse * &y;
        assert!(
            part.iter()
                .zip(&expected)
                .all(|(&one, &other)| near(one, other))
        );

        let one = DMatrix::from_vec(rows, 1, values.clone());
        let (had, log_determinant) = rival.meet(&one).had(power);
        assert!(near(log_determinant, whole.determinant().ln()));
        let beside = dot(&values, &values) - had[0];
        assert!(near(beside, (y.transpose() * &inverse * &y)[0]));
    }

    /// Scatter against the dense diagonal matrix that it is.
    #[test]
    fn scatter_is_a_diagonal_process() {
        let (own, power) = ([0.0, 2.0, 0.5, 0.0, 1.0], 3.0);
        let rival = Rival {
            kind: Kind::Noise,
            form: Form::Scatter(own.to_vec()),
            log_prior: 0.0,
        };
        let whole = DMatrix::from_fn(5, 5, |i, k| if i == k { 1.0 + power * own[i] } else { 0.0 });
        let inverse = whole.clone().try_inverse().expect("positive definite");
        let two = DMatrix::from_fn(5, 2, |row, column| (row * 3 + column * 7 % 5) as f64 - 2.0);
        let (had, log_determinant) = rival.meet(&two).had(power);
        let beside = two.transpose() * &two - had;
        assert!((beside - two.transpose() * &inverse * &two).amax() < 1e-12);
        assert!((log_determinant - whole.determinant().ln()).abs() < 1e-12);
        let taken: f64 = (0..5).map(|row| 1.0 - inverse[(row, row)]).sum();
        assert!((rival.taken(power) - taken).abs() < 1e-12);
    }

    /// Over fewer rows it is what its columns over those rows make.
    #[test]
    fn a_process_over_fewer_rows_is_that_of_its_columns() {
        let made = columns(17, 5);
        let kept = [0, 3, 4, 8, 9, 12, 16];
        let fewer: Vec<Vec<f64>> = (made.iter())
            .map(|column| kept.iter().map(|&row| column[row]).collect())
            .collect();
        let one = Rival::new(Kind::Time, &made, 0.0).over(&kept);
        let other = Rival::new(Kind::Time, &fewer, 0.0);
        let kernel = |rival: &Rival| {
            let columns = rival.columns().expect("smooth");
            let down = DMatrix::from_vec(kept.len(), columns.len(), columns.concat());
            &down * down.transpose()
        };
        assert!((kernel(&one) - kernel(&other)).amax() < 1e-12);
    }
}
