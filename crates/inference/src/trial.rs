//! A trial value of a nonlinear parameter: its columns, and how much of some residuals they would explain.

use crate::linear::{add_scaled, dot};

/// Noise of a typical touch, m: only weighs plausible sizes while shapes are scanned.
const USUAL_NOISE: f64 = 1e-6;
/// A column that keeps less than this share of its power beside a basis is redundant.
const REDUNDANT: f64 = 1e-4;

/// A value of a shape, its weighted columns over the scanned rows, and their inner products.
pub struct Trial {
    /// Value of the shape.
    pub value: f64,
    columns: Vec<Vec<f64>>,
    gram: Vec<f64>,
    /// What holds each coefficient to its plausible size: over touches that hardly tell, many shapes fit with absurd
    /// sizes.
    ridge: Vec<f64>,
}

impl Trial {
    /// Columns whose coefficients are unlikely to exceed `plausible`, one per column.
    pub fn bounded(
        value: f64,
        columns: Vec<Vec<f64>>,
        plausible: impl Iterator<Item = f64>,
    ) -> Self {
        let ridge = plausible.map(|size| (USUAL_NOISE / size).powi(2)).collect();
        Self {
            ridge,
            ..Self::new(value, columns)
        }
    }

    /// Columns whose coefficients are free.
    pub fn new(value: f64, columns: Vec<Vec<f64>>) -> Self {
        let gram = columns
            .iter()
            .flat_map(|a| columns.iter().map(move |b| dot(a, b)))
            .collect();
        Self {
            value,
            ridge: vec![0.0; columns.len()],
            columns,
            gram,
        }
    }

    /// The weighted columns over the scanned rows.
    pub fn columns(&self) -> &[Vec<f64>] {
        &self.columns
    }

    /// Sum of squares of `residuals` that the columns explain beside an orthonormal basis; `out` are rows that do not count.
    pub fn gain(&self, basis: &[Vec<f64>], residuals: &[f64], out: &[usize]) -> f64 {
        let with = |values: &[f64]| -> Vec<f64> {
            let columns = self.columns.iter();
            columns.map(|column| dot(column, values)).collect()
        };
        let shared: Vec<Vec<f64>> = basis.iter().map(|known| with(known)).collect();
        self.explained(shared.iter().map(Vec::as_slice), &mut with(residuals), out)
    }

    /// The same from the columns' products with each column of the basis and with the residuals (`right`, overwritten).
    pub fn explained<'s>(
        &self,
        shared: impl Iterator<Item = &'s [f64]>,
        right: &mut [f64],
        out: &[usize],
    ) -> f64 {
        let width = self.columns.len();
        let mut gram = self.gram.clone();
        for known in shared {
            for (i, value) in known.iter().enumerate() {
                add_scaled(&mut gram[i * width..(i + 1) * width], -value, known);
            }
        }
        for i in 0..width {
            for k in 0..width {
                let missing = out.iter();
                gram[i * width + k] -= missing
                    .map(|&row| self.columns[i][row] * self.columns[k][row])
                    .sum::<f64>();
            }
            gram[i * width + i] += self.ridge[i];
        }
        let mut gain = 0.0;
        for i in 0..width {
            let power = gram[i * width + i];
            if power <= REDUNDANT * self.gram[i * width + i] || power <= 0.0 {
                continue;
            }
            gain += right[i] * right[i] / power;
            for k in i + 1..width {
                let factor = gram[k * width + i] / power;
                right[k] -= factor * right[i];
                for other in i + 1..width {
                    gram[k * width + other] -= factor * gram[i * width + other];
                }
            }
        }
        gain
    }
}
