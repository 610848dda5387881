//! Inner products of candidates whitened for a discrepancy process.

use nalgebra::{DMatrix, DVector};

use crate::candidate::Candidate;
use crate::columns::{Rows, side_by_side};
use crate::discrepancy::{Discrepancy, Projected};
use crate::evidence::{Fit, InnerProducts};
use crate::linear::add_scaled;

/// Candidates and the deviations that sets of them are fitted to.
pub struct Regression<'a> {
    /// All candidates.
    pub candidates: &'a [Candidate],
    /// Their inner products over the rows in use.
    pub products: &'a InnerProducts,
    /// Weighted deviations of all rows, m.
    pub y: &'a [f64],
    /// The rows in use.
    pub rows: Rows,
}

impl Regression<'_> {
    /// Fit of a set, alone or beside a discrepancy over the rows in use at a variance over that of the noise; `None` for a set that
    /// cannot be solved.
    pub fn fit(&self, set: &[usize], beside: Option<(&Discrepancy, f64)>) -> Option<Fit> {
        let Some((discrepancy, variance_ratio)) = beside else {
            return self.products.fit(set);
        };
        let members = set.iter().map(|&member| &self.candidates[member]);
        let indices: Vec<usize> = (0..set.len()).collect();
        Design::new(members, self.y, &self.rows)
            .with_discrepancy(discrepancy)
            .products(variance_ratio, &self.products.subset(set))
            .fit(&indices)
    }

    /// Weighted deviations of all rows less what the effects of a set predict that is fitted like that, m.
    pub fn residuals(
        &self,
        set: &[usize],
        beside: Option<(&Discrepancy, f64)>,
    ) -> Option<Vec<f64>> {
        let fit = self.fit(set, beside)?;
        let mut residuals = self.y.to_vec();
        let columns = (set.iter()).flat_map(|&member| &self.candidates[member].block);
        for (column, coefficient) in columns.zip(&fit.coefficients) {
            add_scaled(&mut residuals, -coefficient, column);
        }
        Some(residuals)
    }
}

/// Columns of some candidates and, as the last, the deviations, over the rows in use.
pub struct Design(DMatrix<f64>);

impl Design {
    /// Columns of some candidates and the weighted deviations `y` over the rows in use, whitened for their noise.
    pub fn new<'c>(
        candidates: impl Iterator<Item = &'c Candidate>,
        y: &[f64],
        rows: &Rows,
    ) -> Self {
        let y = [y.to_vec()];
        let blocks = candidates.map(|candidate| candidate.block.as_slice());
        Self(side_by_side(rows, blocks.chain([y.as_slice()]), 0).0)
    }

    /// Number of rows in use.
    pub fn rows(&self) -> usize {
        self.0.nrows()
    }

    /// The deviations less these columns, each times its coefficient, over the rows in use, m.
    pub fn residuals(&self, terms: impl Iterator<Item = (usize, f64)>) -> DVector<f64> {
        let mut residuals = self.0.column(self.0.ncols() - 1).into_owned();
        for (column, coefficient) in terms {
            residuals.axpy(-coefficient, &self.0.column(column), 1.0);
        }
        residuals
    }

    /// The same columns, whitened for a discrepancy over the same rows, itself whitened for their noise.
    pub fn with_discrepancy<'a>(&'a self, discrepancy: &'a Discrepancy) -> Whitened<'a> {
        Whitened(discrepancy.project(&self.0))
    }
}

/// Columns projected onto the basis of a discrepancy.
pub struct Whitened<'a>(Projected<'a>);

impl Whitened<'_> {
    /// Inner products whitened for the discrepancy at this variance ratio; `plain` are those without it.
    pub fn products(&self, variance_ratio: f64, plain: &InnerProducts) -> InnerProducts {
        let (explained, log_determinant) = self.0.explained_gram(variance_ratio);
        let count = plain.qy.len();
        let mut whitened = plain.clone();
        for (column, explained) in explained.column_iter().take(count).enumerate() {
            let products = &mut whitened.qq[column * count..(column + 1) * count];
            for (value, explained) in products.iter_mut().zip(&explained) {
                *value -= explained;
            }
            whitened.qy[column] -= explained[count];
        }
        whitened.yy -= explained[(count, count)];
        whitened.offset += 0.5 * log_determinant;
        whitened
    }
}
