//! Inner products of candidates whitened for a discrepancy process.

use nalgebra::DMatrix;

use crate::candidate::Candidate;
use crate::columns::{Rows, side_by_side};
use crate::discrepancy::{Discrepancy, Projected};
use crate::evidence::InnerProducts;

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
