//! A tridiagonal matrix T = MMᵀ and the factor of I/p + T at any variance ratio p.
//!
//! For y ~ N(0, I + p·MᵀM) with I/p + T = L·D·Lᵀ, whitened products are aᵀb − (L⁻¹Ma)ᵀ·D⁻¹·(L⁻¹Mb) (Woodbury), at a cost
//! that is linear in the rows of M: every variance ratio is as cheap as the first.

use nalgebra::DMatrix;

/// A symmetric tridiagonal matrix.
#[derive(Debug, Clone)]
pub struct Tridiagonal {
    /// Its diagonal.
    pub diagonal: Vec<f64>,
    /// Its first off-diagonal, one element shorter.
    pub off_diagonal: Vec<f64>,
}

/// The factor of I/p + T.
pub struct Factorised {
    /// Below the diagonal of L.
    below: Vec<f64>,
    /// D.
    pivots: Vec<f64>,
    /// Natural logarithm of the determinant of I + p·T.
    pub log_determinant: f64,
}

impl Tridiagonal {
    /// The factor at a variance ratio p.
    pub fn factorise(&self, variance_ratio: f64) -> Factorised {
        let mut pivots: Vec<f64> = Vec::with_capacity(self.diagonal.len());
        let mut below = Vec::with_capacity(self.off_diagonal.len());
        let (mut log_determinant, mut product) = (0.0, 1.0_f64);
        for (index, diagonal) in self.diagonal.iter().enumerate() {
            let mut pivot = 1.0 / variance_ratio + diagonal;
            if let Some(&last) = pivots.last() {
                let next = self.off_diagonal[index - 1];
                below.push(next / last);
                pivot -= next * next / last;
            }
            // No less than the first term but for rounding.
            let pivot = pivot.max(0.5 / variance_ratio);
            product *= pivot * variance_ratio;
            if !(1e-150..1e150).contains(&product) {
                log_determinant += product.ln();
                product = 1.0;
            }
            pivots.push(pivot);
        }
        Factorised {
            below,
            pivots,
            log_determinant: log_determinant + product.ln(),
        }
    }
}

impl Factorised {
    /// D^(−1/2)·L⁻¹ times each row of `crossed`, which has a column for each row of M.
    pub fn forward(&self, mut crossed: DMatrix<f64>) -> DMatrix<f64> {
        let height = crossed.nrows();
        let values = crossed.as_mut_slice();
        for (index, factor) in self.below.iter().enumerate() {
            let (known, rest) = values.split_at_mut((index + 1) * height);
            for (value, last) in rest[..height].iter_mut().zip(&known[index * height..]) {
                *value -= factor * last;
            }
        }
        for (mut column, pivot) in crossed.column_iter_mut().zip(&self.pivots) {
            column /= pivot.sqrt();
        }
        crossed
    }

    /// Effective degrees of freedom of the process: the trace of p·T·(I + p·T)⁻¹.
    pub fn effective_dof(&self, variance_ratio: f64) -> f64 {
        let count = self.pivots.len();
        let kept = |index: usize| {
            let mut unit = vec![0.0; count];
            unit[index] = 1.0;
            self.solve(&mut unit);
            1.0 - unit[index] / variance_ratio
        };
        (0..count).map(kept).sum()
    }

    /// (I/p + T)⁻¹ times `values`.
    pub fn solve(&self, values: &mut [f64]) {
        for (index, factor) in self.below.iter().enumerate() {
            values[index + 1] -= factor * values[index];
        }
        for (value, pivot) in values.iter_mut().zip(&self.pivots) {
            *value /= pivot;
        }
        for (index, factor) in self.below.iter().enumerate().rev() {
            values[index] -= factor * values[index + 1];
        }
    }
}
