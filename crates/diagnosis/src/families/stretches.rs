//! Judgement by left-out stretches: of time, of place, of poses.
//!
//! A physical effect predicts where it was not fitted, a process does not. Rows are parted in several ways into stretches;
//! each is predicted from all others, and the worst of the ways counts. Sizes are those of the whole. Metres.

use effects::observation::Observations;
use inference::relevance::{Fit, Products};
use nalgebra::DVector;

/// Stretches of each way.
const STRETCHES: usize = 8;
/// A spread of places below this is a point, m.
const POINT: f64 = 1e-6;
/// Touches of one pose that an instrument sees at once, as it gives three coordinates.
const OF_POSE: usize = 3;
/// What keeps a nuisance that the other stretches do not show at nothing, over a column of length one.
const FLAT: f64 = 1e-9;
/// Multiplier that spreads successive poses over the stretches: a prime.
const SPREAD: usize = 7919;

/// Ways to part the rows in use into stretches: the stretch of each row.
pub(super) struct Stretches(Vec<Vec<usize>>);

impl Stretches {
    /// The ways of the touches in use, by their order in time.
    pub(super) fn new(observations: &Observations, active: &[bool]) -> Self {
        let rows: Vec<usize> = (0..active.len()).filter(|&row| active[row]).collect();
        let count = rows.len().max(1);
        let by_rank = |key: &dyn Fn(usize) -> f64| {
            let mut order: Vec<usize> = (0..rows.len()).collect();
            order.sort_by(|&a, &b| key(rows[a]).total_cmp(&key(rows[b])));
            let mut of = vec![0; rows.len()];
            for (rank, &index) in order.iter().enumerate() {
                of[index] = rank * STRETCHES / count;
            }
            of
        };
        let mut ways = vec![
            by_rank(&|row| row as f64),
            (0..rows.len())
                .map(|index| index / OF_POSE * SPREAD % STRETCHES)
                .collect(),
        ];
        let place = |row: usize| observations.rows[row].position.coords;
        let middle = rows
            .iter()
            .map(|&row| place(row))
            .sum::<nalgebra::Vector3<f64>>()
            / count as f64;
        let spread = rows.iter().fold(nalgebra::Matrix3::zeros(), |sum, &row| {
            let from = place(row) - middle;
            sum + from * from.transpose()
        });
        let eigen = spread.symmetric_eigen();
        let widest = eigen.eigenvalues.imax();
        if (eigen.eigenvalues[widest] / count as f64).sqrt() > POINT {
            let along = eigen.eigenvectors.column(widest).into_owned();
            ways.push(by_rank(&|row| along.dot(&place(row))));
        }
        Self(ways)
    }

    /// What a fit leaves of the rows in use, each predicted without its stretch: the mean of mean and median square of the worst
    /// way, m². Stray touches do not decide.
    pub(super) fn left_out(&self, products: &Products, fit: &Fit) -> f64 {
        let of_way = |residuals: &Vec<f64>| {
            let mut squares: Vec<f64> = residuals.iter().map(|value| value * value).collect();
            let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
            squares.sort_by(f64::total_cmp);
            let median = squares.get(squares.len() / 2).copied().unwrap_or(0.0);
            0.5 * (mean + median)
        };
        let ways = self.residuals(products, fit);
        ways.iter().map(of_way).fold(0.0, f64::max)
    }

    /// Residuals of every row in use, predicted without its stretch at the sizes of a fit, for each way.
    pub(super) fn residuals(&self, products: &Products, fit: &Fit) -> Vec<Vec<f64>> {
        let (columns, y) = (products.solved(fit), products.data());
        let (variances, noise) = (products.variances(&fit.sizes), fit.sizes.noise);
        let whole = columns.tr_mul(&columns);
        let right = columns.tr_mul(y);
        let of_way = |way: &Vec<usize>| {
            let mut residuals = y.as_slice().to_vec();
            if columns.ncols() == 0 {
                return residuals;
            }
            for stretch in 0..STRETCHES {
                let own: Vec<usize> = (0..way.len()).filter(|&row| way[row] == stretch).collect();
                if own.is_empty() {
                    continue;
                }
                let left_out = columns.select_rows(&own);
                let seen = DVector::from_iterator(own.len(), own.iter().map(|&row| y[row]));
                let mut normal = &whole - left_out.tr_mul(&left_out);
                for (index, variance) in variances.iter().enumerate() {
                    normal[(index, index)] += noise / variance + FLAT;
                }
                let Some(factor) = normal.cholesky() else {
                    continue;
                };
                let mean = factor.solve(&(&right - left_out.tr_mul(&seen)));
                for (row, predicted) in own.iter().zip((left_out * mean).iter()) {
                    residuals[*row] = y[*row] - predicted;
                }
            }
            residuals
        };
        self.0.iter().map(of_way).collect()
    }
}
