//! Judgement by left-out stretches: of time, of place, and single poses.
//!
//! A physical effect predicts where it was not fitted, a process does not. Rows are parted in several ways into stretches;
//! each is predicted from all others, and the worst of the ways counts. Sizes are those of the whole. Metres.

use std::ops::Range;

use effects::observation::Observations;
use inference::relevance::{Fit, Products};
use nalgebra::{DMatrix, DVector};

/// Stretches of each way.
const STRETCHES: usize = 8;
/// A spread of places below this is a point, m.
const POINT: f64 = 1e-6;
/// What keeps a nuisance that the other stretches do not show at nothing, over a column of length one.
const FLAT: f64 = 1e-9;
/// Coordinates of a point, which an instrument gives at once: touches at the same readings in directions of their own.
const COORDINATES: usize = 3;

/// Ways to part the rows in use.
pub(super) struct Stretches {
    /// Rows of each pose of the machine.
    poses: Vec<Range<usize>>,
    /// The stretch of each row, in time and in place.
    ways: Vec<Vec<usize>>,
}

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
        let mut ways = vec![by_rank(&|row| row as f64)];
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
        Self {
            poses: poses(observations, &rows),
            ways,
        }
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
        let solved = Solved::new(products, fit);
        let ways = self.ways.iter().map(|way| solved.without_stretches(way));
        std::iter::once(solved.without_poses(&self.poses))
            .chain(ways)
            .map(|residuals| of_way(&residuals))
            .fold(0.0, f64::max)
    }

    /// What a fit leaves of every row in use, each pose predicted from the others.
    pub(super) fn by_pose(&self, products: &Products, fit: &Fit) -> Vec<f64> {
        Solved::new(products, fit).without_poses(&self.poses)
    }
}

/// The normal equations of a fit, at its sizes.
struct Solved<'a> {
    columns: DMatrix<f64>,
    y: &'a DVector<f64>,
    whole: DMatrix<f64>,
    right: DVector<f64>,
}

impl<'a> Solved<'a> {
    fn new(products: &'a Products, fit: &Fit) -> Self {
        let (columns, y) = (products.solved(fit), products.data());
        let variances = products.variances(&fit.sizes);
        let prior = variances.iter().map(|variance| fit.sizes.noise / variance);
        let prior = DVector::from_iterator(variances.len(), prior.map(|own| own + FLAT));
        Self {
            whole: columns.tr_mul(&columns) + DMatrix::from_diagonal(&prior),
            right: columns.tr_mul(y),
            columns,
            y,
        }
    }

    /// Residuals of every row, predicted without its stretch of a way.
    fn without_stretches(&self, way: &[usize]) -> Vec<f64> {
        let (columns, y) = (&self.columns, self.y);
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
            let normal = &self.whole - left_out.tr_mul(&left_out);
            let Some(factor) = normal.cholesky() else {
                continue;
            };
            let mean = factor.solve(&(&self.right - left_out.tr_mul(&seen)));
            for (row, predicted) in own.iter().zip((left_out * mean).iter()) {
                residuals[*row] = y[*row] - predicted;
            }
        }
        residuals
    }

    /// Residuals of every row without its pose, in closed form: (I − H)⁻¹r, H the rows and columns of its touches in the hat
    /// matrix (Allen 1974).
    fn without_poses(&self, poses: &[Range<usize>]) -> Vec<f64> {
        let (columns, y) = (&self.columns, self.y);
        let factor = self.whole.clone().cholesky();
        let Some(factor) = factor.filter(|_| columns.ncols() > 0) else {
            return y.as_slice().to_vec();
        };
        let mut left = y - columns * factor.solve(&self.right);
        let half = factor
            .l_dirty()
            .solve_lower_triangular(&columns.transpose());
        for (pose, half) in half
            .iter()
            .flat_map(|half| poses.iter().map(move |of| (of, half)))
        {
            let own = half.columns_range(pose.clone());
            let free = DMatrix::identity(pose.len(), pose.len()) - own.tr_mul(&own);
            let mut part = left.rows_range_mut(pose.clone());
            if let Some(predicted) = free.lu().solve(&part) {
                part.copy_from(&predicted);
            }
        }
        left.as_slice().to_vec()
    }
}

/// Rows of each pose.
fn poses(observations: &Observations, rows: &[usize]) -> Vec<Range<usize>> {
    let mut poses: Vec<Range<usize>> = Vec::new();
    for (number, &row) in rows.iter().enumerate() {
        let own = &observations.rows[row];
        let readings = |row: usize| Some(&observations.rows[row].pose.as_ref()?.latched);
        let is_same = |last: &Range<usize>| {
            let before = rows[number - 1];
            let turned = observations.rows[before].normal != own.normal;
            last.len() < COORDINATES && turned && readings(before) == readings(row)
        };
        match poses.last_mut() {
            Some(last) if is_same(last) => last.end += 1,
            _ => poses.push(number..number + 1),
        }
    }
    poses
}
