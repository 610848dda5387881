//! A discrepancy process at some variance over that of the noise: what it leaves of columns, and what it takes up.
//!
//! The process is y ~ N(0, p·MᵀM) over the rows, where the lines of M have a tridiagonal matrix T of products with one
//! another. With I/p + T = L·D·Lᵀ, products beside the process are aᵀb − (L⁻¹Ma)ᵀ·D⁻¹·(L⁻¹Mb) (Woodbury), at a cost
//! that is linear in the lines of M: every variance is as cheap as the first.

use nalgebra::DMatrix;

/// Products of the lines of a process with one another, tridiagonal.
#[derive(Debug, Clone)]
pub(crate) struct Lines {
    /// Of each line with itself.
    pub(crate) own: Vec<f64>,
    /// Of each line with the next.
    pub(crate) next: Vec<f64>,
}

/// The factor of I/p + T.
pub(crate) struct Held {
    /// Below the diagonal of L.
    below: Vec<f64>,
    /// D.
    pivots: Vec<f64>,
    /// Natural logarithm of the determinant of I + p·T.
    pub(crate) log_determinant: f64,
}

impl Lines {
    /// The factor at a variance `power`.
    pub(crate) fn held(&self, power: f64) -> Held {
        let mut pivots: Vec<f64> = Vec::with_capacity(self.own.len());
        let mut below = Vec::with_capacity(self.next.len());
        let (mut log_determinant, mut product) = (0.0, 1.0_f64);
        for (place, own) in self.own.iter().enumerate() {
            let mut pivot = 1.0 / power + own;
            if let Some(&last) = pivots.last() {
                let next = self.next[place - 1];
                below.push(next / last);
                pivot -= next * next / last;
            }
            // No less than the first term but for rounding.
            let pivot = pivot.max(0.5 / power);
            product *= pivot * power;
            if !(1e-150..1e150).contains(&product) {
                log_determinant += product.ln();
                product = 1.0;
            }
            pivots.push(pivot);
        }
        Held {
            below,
            pivots,
            log_determinant: log_determinant + product.ln(),
        }
    }
}

impl Held {
    /// D^(−1/2)·L⁻¹ times what stands in each row of `crossed`, a column for each line.
    pub(crate) fn forward(&self, mut crossed: DMatrix<f64>) -> DMatrix<f64> {
        let height = crossed.nrows();
        let values = crossed.as_mut_slice();
        for (place, factor) in self.below.iter().enumerate() {
            let (known, rest) = values.split_at_mut((place + 1) * height);
            let own = &mut rest[..height];
            for (value, last) in own.iter_mut().zip(&known[place * height..]) {
                *value -= factor * last;
            }
        }
        for (mut column, pivot) in crossed.column_iter_mut().zip(&self.pivots) {
            column /= pivot.sqrt();
        }
        crossed
    }

    /// Degrees of freedom that the process takes up: the trace of p·T·(I + p·T)⁻¹.
    pub(crate) fn taken(&self, power: f64) -> f64 {
        let count = self.pivots.len();
        let kept = |place: usize| {
            let mut unit = vec![0.0; count];
            unit[place] = 1.0;
            self.solve(&mut unit);
            1.0 - unit[place] / power
        };
        (0..count).map(kept).sum()
    }

    /// (I/p + T)⁻¹ times `values`.
    pub(crate) fn solve(&self, values: &mut [f64]) {
        for (place, factor) in self.below.iter().enumerate() {
            values[place + 1] -= factor * values[place];
        }
        for (value, pivot) in values.iter_mut().zip(&self.pivots) {
            *value /= pivot;
        }
        for (place, factor) in self.below.iter().enumerate().rev() {
            values[place] -= factor * values[place + 1];
        }
    }
}
