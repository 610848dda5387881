//! How the parts of a series scatter about their mean, all touches together: parts differ in how they are clamped.

use inference::linear::dot;

use crate::attribution::whitening::Process;

/// Least weight of independent touches.
const LEAST: f64 = 1e-3;
/// Variance that nothing is better than, m².
const FINEST: f64 = 1e-18;

/// Covariance of a difference of means over the touches, m².
pub(super) struct Scatter {
    /// What parts have in common beyond independent touches; `None` where nothing is known of it.
    common: Option<Process>,
    /// Standard deviation of an independent touch, m.
    touch: f64,
}

impl Scatter {
    /// The covariance of what some parts are `off` their means, at these degrees of freedom, shrunk towards independent
    /// touches alike as far as so few parts ask for it (Ledoit and Wolf 2004); of a difference of means it is `means` times
    /// as large.
    pub(super) fn new(off: &[Vec<f64>], freedom: f64, means: f64) -> Self {
        let (parts, points) = (off.len() as f64, off.first().map_or(0, Vec::len) as f64);
        let products: Vec<Vec<f64>> = (off.iter())
            .map(|one| off.iter().map(|other| dot(one, other)).collect())
            .collect();
        let squares = |row: &Vec<f64>| dot(row, row);
        let trace: f64 = (0..off.len()).map(|part| products[part][part]).sum();
        let whole = products.iter().map(squares).sum::<f64>() / (parts * parts);
        let mean = trace / (parts * points);
        let dispersion = whole - points * mean * mean;
        let own = products.iter().enumerate();
        let error = own.map(|(part, row)| row[part].powi(2) - 2.0 * squares(row) / parts + whole);
        let error = error.sum::<f64>() / (parts * parts);
        let weight = if dispersion > 0.0 {
            (error / dispersion).clamp(LEAST, 1.0)
        } else {
            1.0
        };
        let touch = (weight * trace / (freedom * points)).max(FINEST);
        Self {
            common: Process::of_columns(off, (1.0 - weight) / (freedom * touch)),
            touch: (touch * means).sqrt(),
        }
    }

    /// Values over the touches as independent ones of unit variance.
    pub(super) fn whiten(&self, values: &[f64]) -> Vec<f64> {
        let values = values.iter().map(|value| value / self.touch).collect();
        match &self.common {
            Some(common) => common.whiten(values),
            None => values,
        }
    }
}
