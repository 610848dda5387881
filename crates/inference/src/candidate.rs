//! Candidates: families of columns at definite shapes, as orthonormal blocks over the rows of a session.
//!
//! A block spans what a family of columns can do to the weighted residuals; its columns are orthonormal, so that prior
//! variances are sizes of the signature and not of a parametrisation. Directions that would not show even at a thousand
//! times the largest plausible size are left out. A family whose parameters are correlated by its prior (the values of a smooth
//! function) has orthogonal columns of decreasing length instead, the principal directions of that prior (Rasmussen and
//! Williams 2006, 4.3). Metres.

use metrology::statistics::rms;
use nalgebra::DMatrix;

use crate::linear::{add_scaled, dot, scale};

/// Directions whose signature stays below this rms at a thousand times the plausible size are unobservable, m.
pub const UNOBSERVABLE: f64 = 2e-7;
/// Directions of a correlated prior with a smaller share than this of the power of the leading one are left out: at a
/// three-hundredth of its size they do not show.
const FAINT: f64 = 1e-5;
/// A combination of parameters that does not show to first order may exceed its plausible size by this factor.
const UNSEEN: f64 = 2.0;
/// Factor over the plausible size at which a direction must show.
const FAR: f64 = 1000.0;
/// Two blocks are the same when their spans differ by less than this share.
const SAME: f64 = 1e-7;

/// A family of columns at a definite shape.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Index of the family in the caller's library.
    pub variant: usize,
    /// Value of its nonlinear parameter; 0 where it has none.
    pub shape: f64,
    /// Orthonormal columns over the weighted rows; of a correlated prior orthogonal ones of at most unit length.
    pub block: Vec<Vec<f64>>,
    /// Largest plausible coefficient of each column, m.
    pub plausible: Vec<f64>,
    /// Parameters (in their units) from block coefficients.
    pub parameters_from_block: DMatrix<f64>,
    /// Natural logarithm of the prior probability of this family and shape within its effect.
    pub log_prior: f64,
    /// True where the last block column is of second order in the parameters: a square, so that its coefficient is not
    /// negative.
    pub second_order: bool,
}

/// A family at a definite shape that spans what a candidate of another effect spans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alias {
    /// Index of the family in the caller's library.
    pub variant: usize,
    /// Value of its nonlinear parameter; 0 where it has none.
    pub shape: f64,
    /// True where a column of second order belongs to it.
    pub second_order: bool,
}

/// Weighted second-order column of the combination of parameters with these values; `None` where it has none.
pub type SecondOrder<'a> = dyn Fn(&[f64]) -> Option<Vec<f64>> + 'a;

impl Candidate {
    /// The block of weighted columns, each multiplied by its largest plausible size (`sizes`, in the parameters' units).
    ///
    /// With `second_order`, a combination of parameters that cannot be seen to first order adds its second order; `None`
    /// where there is no such combination, or where nothing of the columns can be seen.
    pub fn from_scaled(
        (variant, shape): (usize, f64),
        scaled: &DMatrix<f64>,
        sizes: &[f64],
        log_prior: f64,
        second_order: Option<&SecondOrder<'_>>,
    ) -> Option<Self> {
        let (rows, count) = scaled.shape();
        let eigen = (scaled.transpose() * scaled).symmetric_eigen();
        let least = (UNOBSERVABLE / FAR).powi(2) * rows as f64;
        let mut kept: Vec<usize> = (0..count).collect();
        kept.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let largest = kept.first().map_or(0.0, |&index| eigen.eigenvalues[index]);
        let (seen, unseen): (Vec<usize>, Vec<usize>) = kept.into_iter().partition(|&index| {
            eigen.eigenvalues[index] > least && eigen.eigenvalues[index] > 1e-12 * largest
        });
        let mut block: Vec<Vec<f64>> = Vec::new();
        let mut back: Vec<Vec<f64>> = Vec::new();
        let mut plausible: Vec<f64> = Vec::new();
        for &index in &seen {
            let length = eigen.eigenvalues[index].sqrt();
            let direction = eigen.eigenvectors.column(index);
            plausible.push(length);
            block.push((scaled * direction / length).iter().copied().collect());
            back.push(
                direction
                    .iter()
                    .zip(sizes)
                    .map(|(part, size)| part * size / length)
                    .collect(),
            );
        }
        if let Some(second_order) = second_order {
            let curved = unseen.iter().find_map(|&index| {
                let direction = eigen.eigenvectors.column(index);
                let shares: Vec<f64> = direction
                    .iter()
                    .zip(sizes)
                    .map(|(part, size)| part * size)
                    .collect();
                SecondOrderColumn::new(second_order(&shares)?, &block)
            })?;
            // The column was made orthonormal: its projection onto the linear columns belongs to their parameters.
            let parameters =
                curved
                    .along
                    .iter()
                    .zip(&back)
                    .fold(vec![0.0; count], |mut sum, (along, back)| {
                        add_scaled(&mut sum, -along, back);
                        sum
                    });
            block.push(curved.column);
            plausible.push(UNSEEN * UNSEEN * curved.length);
            back.push(parameters);
        }
        if block.is_empty() {
            return None;
        }
        let parameters_from_block =
            DMatrix::from_fn(count, block.len(), |row, column| back[column][row]);
        let second_order = second_order.is_some();
        Some(Self {
            variant,
            shape,
            block,
            plausible,
            parameters_from_block,
            log_prior: log_prior
                - if second_order {
                    std::f64::consts::LN_2
                } else {
                    0.0
                },
            second_order,
        })
    }

    /// The block of weighted columns, each multiplied by its largest plausible size (`sizes`, in the parameters' units), whose
    /// coefficients have the prior covariance L·Lᵀ for `factor` L; `None` where nothing of the columns can be seen.
    pub fn from_correlated(
        (variant, shape): (usize, f64),
        scaled: &DMatrix<f64>,
        sizes: &[f64],
        factor: &DMatrix<f64>,
        log_prior: f64,
    ) -> Option<Self> {
        let principal = scaled * factor;
        let eigen = (principal.transpose() * &principal).symmetric_eigen();
        let most = eigen.eigenvalues.max();
        if most <= (UNOBSERVABLE / FAR).powi(2) * scaled.nrows() as f64 {
            return None;
        }
        let mut kept: Vec<usize> = (0..eigen.eigenvalues.len())
            .filter(|&index| eigen.eigenvalues[index] > FAINT * most)
            .collect();
        kept.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let length = most.sqrt();
        let directions = eigen.eigenvectors.select_columns(&kept) / length;
        let mut parameters_from_block = factor * &directions;
        for (mut row, size) in parameters_from_block.row_iter_mut().zip(sizes) {
            row *= *size;
        }
        let block = (principal * directions)
            .column_iter()
            .map(|column| column.iter().copied().collect())
            .collect();
        Some(Self {
            variant,
            shape,
            block,
            plausible: vec![length; kept.len()],
            parameters_from_block,
            log_prior,
            second_order: false,
        })
    }

    /// True where two blocks have the same span.
    pub fn same_span(&self, other: &Self) -> bool {
        if self.block.len() != other.block.len() {
            return false;
        }
        let width = self.block.len() as f64;
        let mut shared = 0.0;
        for (index, a) in self.block.iter().enumerate() {
            shared += other.block.iter().map(|b| dot(a, b).powi(2)).sum::<f64>();
            if shared < (index as f64 + 1.0) - width * SAME {
                return false;
            }
        }
        shared > width * (1.0 - SAME)
    }

    /// The weighted deviations that these coefficients of its columns predict.
    pub fn signature(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut signature = vec![0.0; self.block.first().map_or(0, Vec::len)];
        for (column, coefficient) in self.block.iter().zip(coefficients) {
            add_scaled(&mut signature, *coefficient, column);
        }
        signature
    }
}

/// A second-order column and its products with the linear ones over its own length.
struct SecondOrderColumn {
    column: Vec<f64>,
    /// Its coefficient at the largest plausible displacement, m.
    length: f64,
    along: Vec<f64>,
}

impl SecondOrderColumn {
    /// The column made orthonormal to `block`; `None` where it is unobservable.
    fn new(mut column: Vec<f64>, block: &[Vec<f64>]) -> Option<Self> {
        if rms(&column) < UNOBSERVABLE {
            return None;
        }
        let mut along = Vec::with_capacity(block.len());
        for known in block {
            let product: f64 = known.iter().zip(&column).map(|(a, b)| a * b).sum();
            add_scaled(&mut column, -product, known);
            along.push(product);
        }
        let size = rms(&column);
        if size < 0.5 * UNOBSERVABLE {
            return None;
        }
        let length = size * (column.len() as f64).sqrt();
        scale(&mut column, 1.0 / length);
        scale(&mut along, 1.0 / length);
        Some(Self {
            column,
            length,
            along,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of a correlated family at their plausible size have the covariance S·L·Lᵀ·Sᵀ of the family, but for a part in
    /// 10⁴, and each is what its parameters make.
    #[test]
    fn a_correlated_family_has_its_prior_covariance() {
        let (rows, count) = (40, 9);
        let columns = DMatrix::from_fn(rows, count, |row, column| {
            let apart = (row as f64 / 39.0 - column as f64 / 8.0) / 0.15;
            (-0.5 * apart * apart).exp()
        });
        let sizes: Vec<f64> = (0..count)
            .map(|index| 1e-4 * (1.0 + index as f64))
            .collect();
        let scaled = DMatrix::from_fn(rows, count, |row, column| {
            columns[(row, column)] * sizes[column]
        });
        let prior = DMatrix::from_fn(count, count, |i, j| {
            let apart = i.abs_diff(j) as f64 / 3.0;
            (-0.5 * apart * apart).exp()
        });
        let factor = prior.clone().cholesky().expect("positive definite").l();
        let made = Candidate::from_correlated((3, 0.0), &scaled, &sizes, &factor, 0.0)
            .expect("columns that show");
        let expected = &scaled * &prior * scaled.transpose();
        let mut found = DMatrix::zeros(rows, rows);
        for (column, size) in made.block.iter().zip(&made.plausible) {
            let column = nalgebra::DVector::from_column_slice(column) * *size;
            found += &column * column.transpose();
        }
        assert!((&found - &expected).amax() < 1e-4 * expected.amax());
        for (index, column) in made.block.iter().enumerate() {
            let parameters = made.parameters_from_block.column(index);
            let by_parameters = &columns * parameters;
            let apart = by_parameters.iter().zip(column).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-9);
            assert!(dot(column, column) < 1.0 + 1e-9);
        }
    }
}
