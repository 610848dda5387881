//! The least squares of a ball calibration: Gauss-Newton on scaled columns, and the residual of each touch.
//!
//! Metres and radians. Each step is solved by a singular value decomposition, so that a direction that
//! no touch determines is left alone and reported as infinitely uncertain, instead of spoiling the others.

use machine::LinkError;
use nalgebra::{DMatrix, DVector, Vector3};

use super::{BallCalibration, BallTouch, Estimate};

/// Steps of Gauss-Newton; two suffice for a ball within a millimetre of its place.
const STEPS: usize = 12;
/// m; a step that moves no touch by more is the last one.
const STILL: f64 = 1e-12;
/// Directions seen less than this share of the best seen one are not seen.
const RANK: f64 = 1e-9;
/// Share of a direction that is not seen from which on a column is part of it.
const SHARE: f64 = 1e-6;
/// m; no ball is looked for farther from its place.
const FARTHEST: f64 = 10e-3;

/// What is estimated, and where it stands in the columns.
pub(super) struct Unknowns {
    /// All of them.
    pub(super) count: usize,
    /// First column of the centre of each ball that is touched.
    balls: Vec<Option<usize>>,
    /// Column of the radius of the stylus ball.
    radius: Option<usize>,
    /// Columns of the stylus, by axis of the mount.
    stylus: [Option<usize>; 3],
}

impl Unknowns {
    pub(super) fn of(calibration: &BallCalibration, touches: &[BallTouch]) -> Self {
        let mut count = calibration.links.len();
        let mut take = |wanted: bool, columns: usize| {
            let first = count;
            count += if wanted { columns } else { 0 };
            wanted.then_some(first)
        };
        let balls = (0..calibration.balls.len())
            .map(|ball| take(touches.iter().any(|touch| touch.ball == ball), 3))
            .collect();
        let probe = calibration.probe;
        let radius = take(probe.ball_radius, 1);
        let stylus = [
            probe.stylus_offset,
            probe.stylus_offset,
            probe.stylus_length,
        ]
        .map(|wanted| take(wanted, 1));
        Self {
            count,
            balls,
            radius,
            stylus,
        }
    }

    /// Derivatives of |c − b| − R − r by all unknowns where `normal` points from the ball's centre to the stylus.
    pub(super) fn row(
        &self,
        calibration: &BallCalibration,
        ball: usize,
        positions: &[f64],
        normal: &Vector3<f64>,
    ) -> Vec<f64> {
        let mut row = vec![0.0; self.count];
        for (value, column) in row.iter_mut().zip(calibration.columns(positions)) {
            *value = normal.dot(&column);
        }
        if let Some(first) = self.balls[ball] {
            for axis in 0..3 {
                row[first + axis] = -normal[axis];
            }
        }
        if let Some(column) = self.radius {
            row[column] = -1.0;
        }
        let mount = calibration
            .chain
            .part_from_mount(positions, &calibration.part_pose);
        for (axis, column) in self.stylus.iter().enumerate() {
            if let Some(column) = *column {
                let unit = Vector3::ith(axis, 1.0);
                row[column] = normal.dot(&(mount.rotation * unit));
            }
        }
        row
    }
}

/// A minimum.
pub(super) struct Solution {
    unknowns: DVector<f64>,
    /// Residual over uncertainty of each touch, and its share of itself (diagonal of the hat matrix).
    residuals: Vec<(f64, f64)>,
    /// m.
    rms: f64,
    /// Covariance of the links for uncertainties of scale 1.
    cofactor: DMatrix<f64>,
}

/// Minimises Σ (f / u)²; `None` where the touches lie on no balls near those of the plan.
pub(super) fn solve(
    calibration: &BallCalibration,
    unknowns: &Unknowns,
    touches: &[&BallTouch],
) -> Option<Solution> {
    let mut values = DVector::zeros(unknowns.count);
    for _ in 0..STEPS {
        let (matrix, right) = linearised(calibration, unknowns, touches, &values)?;
        let scale = column_scale(&matrix);
        let scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
            matrix[(row, column)] / scale[column]
        });
        let decomposition = scaled.clone().svd(true, true);
        let floor = RANK * decomposition.singular_values.max();
        let step = decomposition.solve(&(-&right), floor).ok()?;
        let moved = &scaled * &step;
        values += step.component_div(&scale);
        if !values.iter().all(|value| value.is_finite()) {
            return None;
        }
        let far = moved.iter().zip(touches);
        let largest = far.fold(0.0, |most: f64, (moved, touch)| {
            most.max((moved * touch.uncertainty).abs())
        });
        if largest <= STILL {
            let (matrix, right) = linearised(calibration, unknowns, touches, &values)?;
            return Some(Solution::new(calibration, values, &matrix, &right, touches));
        }
    }
    None
}

/// Rows over uncertainties, and residuals over uncertainties.
fn linearised(
    calibration: &BallCalibration,
    unknowns: &Unknowns,
    touches: &[&BallTouch],
    values: &DVector<f64>,
) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let mut matrix = DMatrix::zeros(touches.len(), unknowns.count);
    let mut right = DVector::zeros(touches.len());
    for (index, touch) in touches.iter().enumerate() {
        let ball = &calibration.balls[touch.ball];
        let nominal = calibration.chain.ball_in_part(
            &touch.positions,
            &calibration.part_pose,
            &calibration.stylus,
        );
        let mut centre = nominal.coords
            + calibration.displacement(
                &values.as_slice()[..calibration.links.len()],
                &touch.positions,
            );
        let mount = calibration
            .chain
            .part_from_mount(&touch.positions, &calibration.part_pose);
        for (axis, column) in unknowns.stylus.iter().enumerate() {
            if let Some(column) = *column {
                centre += mount.rotation * Vector3::ith(axis, values[column]);
            }
        }
        let mut place = ball.centre.coords;
        if let Some(first) = unknowns.balls[touch.ball] {
            let off = Vector3::new(values[first], values[first + 1], values[first + 2]);
            if off.norm() > FARTHEST {
                return None;
            }
            place += off;
        }
        let arm = centre - place;
        let normal = arm.try_normalize(1e-9)?;
        let radius = unknowns.radius.map_or(0.0, |column| values[column]);
        let distance = arm.norm() - ball.radius - calibration.stylus_radius - radius;
        let row = unknowns.row(calibration, touch.ball, &touch.positions, &normal);
        for (column, value) in row.into_iter().enumerate() {
            matrix[(index, column)] = value / touch.uncertainty;
        }
        right[index] = distance / touch.uncertainty;
    }
    Some((matrix, right))
}

/// Length of each column; 1 where it has none.
fn column_scale(matrix: &DMatrix<f64>) -> DVector<f64> {
    let norms = matrix.column_iter().map(|column| column.norm());
    DVector::from_iterator(
        matrix.ncols(),
        norms.map(|norm| if norm > 0.0 { norm } else { 1.0 }),
    )
}

impl Solution {
    fn new(
        calibration: &BallCalibration,
        unknowns: DVector<f64>,
        matrix: &DMatrix<f64>,
        right: &DVector<f64>,
        touches: &[&BallTouch],
    ) -> Self {
        let scale = column_scale(matrix);
        let scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
            matrix[(row, column)] / scale[column]
        });
        let decomposition = scaled.svd(true, true);
        let values = &decomposition.singular_values;
        let floor = RANK * values.max();
        let (left, turned) = (decomposition.u.as_ref(), decomposition.v_t.as_ref());
        let residuals = (0..touches.len()).map(|touch| {
            let share = left.map_or(0.0, |left| {
                (0..values.len())
                    .filter(|&k| values[k] > floor)
                    .map(|k| left[(touch, k)].powi(2))
                    .sum()
            });
            (right[touch], share)
        });
        let squares = (right.iter().zip(touches)).map(|(r, touch)| (r * touch.uncertainty).powi(2));
        let rms = (squares.sum::<f64>() / touches.len() as f64).sqrt();
        let links = calibration.links.len();
        let mut cofactor = DMatrix::zeros(links, links);
        if let Some(turned) = turned {
            let of = |k: usize, link: usize| turned[(k, link)] / scale[link];
            for k in (0..values.len()).filter(|&k| values[k] > floor) {
                for (row, column) in (0..links).flat_map(|row| (0..links).map(move |c| (row, c))) {
                    cofactor[(row, column)] += of(k, row) * of(k, column) / values[k].powi(2);
                }
            }
            for k in (0..values.len()).filter(|&k| values[k] <= floor) {
                for link in (0..links).filter(|&link| turned[(k, link)].abs() > SHARE) {
                    cofactor[(link, link)] = f64::INFINITY;
                }
            }
        }
        Self {
            residuals: residuals.collect(),
            unknowns,
            rms,
            cofactor,
        }
    }

    /// Square of the scale of the residuals, for that many degrees of freedom.
    fn variance(&self, degrees_of_freedom: f64) -> f64 {
        self.residuals.iter().map(|(r, _)| r * r).sum::<f64>() / degrees_of_freedom
    }

    /// The touch that fits worst, and its internally studentised residual.
    pub(super) fn worst(&self) -> (usize, f64) {
        let degrees_of_freedom = (self.residuals.len() - self.unknowns.len()) as f64;
        let scale = self.variance(degrees_of_freedom).sqrt();
        let sizes = self.residuals.iter().map(|(r, share)| {
            let own = (1.0 - share).max(0.0).sqrt();
            // A touch that alone determines something has no residual.
            if own > SHARE && scale > 0.0 {
                (r / (scale * own)).abs()
            } else {
                0.0
            }
        });
        let worst = sizes.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        worst.unwrap_or((0, 0.0))
    }

    pub(super) fn estimate(
        &self,
        calibration: &BallCalibration,
        degrees_of_freedom: f64,
        outliers: Vec<usize>,
    ) -> Estimate {
        let variance = self.variance(degrees_of_freedom);
        // Student's distribution has this variance; at three degrees of freedom three times that of the normal.
        let widened = variance * degrees_of_freedom / (degrees_of_freedom - 2.0);
        let links = calibration.links.iter().zip(self.unknowns.iter());
        Estimate {
            links: links
                .map(|(link, value)| LinkError {
                    value: *value,
                    ..*link
                })
                .collect(),
            covariance: &self.cofactor * widened,
            scale: variance.sqrt(),
            residual: self.rms,
            outliers,
        }
    }
}
