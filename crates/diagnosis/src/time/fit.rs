//! Least squares of limits on the motion model itself (Levenberg 1944, Marquardt 1963).

use effects::motion::Scale;
use nalgebra::{DMatrix, DVector};

use super::{Rows, Setting};

/// Standard deviation of a stamp that nothing can be better than, s.
pub(super) const STAMP: f64 = 5e-5;
/// Steps at most.
const STEPS: usize = 40;
/// Relative step, or step in seconds or shares, by which derivatives are taken.
const DIFFERENCE: f64 = 1e-4;
/// The fit ends when the sum of squares shrinks by less than this share.
const STILL: f64 = 1e-9;

/// Limits fitted to some rows.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub(super) settings: Vec<Setting>,
    /// Sum of squares of the residuals of the rows in use, s², no less than stamps allow.
    pub(super) squares: f64,
    /// Covariance of the fitted numbers in their scales: of their logarithms for limits.
    pub(super) covariance: DMatrix<f64>,
}

impl Fitted {
    /// Least and largest value of a number of the set within `quantile` standard uncertainties.
    pub(super) fn interval(&self, rows: &Rows<'_>, member: usize, quantile: f64) -> [f64; 2] {
        let (limit, value) = self.settings[member];
        let half = quantile * self.covariance[(member, member)].max(0.0).sqrt();
        match rows.limits[limit].scale {
            Scale::Linear => [value - half, value + half],
            Scale::Logarithmic => [value * (-half).exp(), value * half.exp()],
        }
    }
}

/// A number in the scale in which it is varied.
fn varied(rows: &Rows<'_>, (limit, value): Setting) -> f64 {
    match rows.limits[limit].scale {
        Scale::Linear => value,
        Scale::Logarithmic => value.max(f64::MIN_POSITIVE).ln(),
    }
}

/// The number from that scale, within its range.
fn number(rows: &Rows<'_>, limit: usize, varied: f64) -> f64 {
    let [least, most] = rows.limits[limit].range;
    let value = match rows.limits[limit].scale {
        Scale::Linear => varied,
        Scale::Logarithmic => varied.exp(),
    };
    value.clamp(least, most)
}

/// The limits at which the rows in use are fitted best, from these values on.
pub(super) fn fit(rows: &Rows<'_>, active: &[bool], start: &[Setting]) -> Fitted {
    let used: Vec<usize> = (0..active.len()).filter(|row| active[*row]).collect();
    let residuals = |settings: &[Setting]| {
        let all = rows.residuals(settings);
        DVector::from_iterator(used.len(), used.iter().map(|row| all[*row]))
    };
    let floor = used.len() as f64 * STAMP * STAMP;
    let mut settings = start.to_vec();
    let mut left = residuals(&settings);
    let mut squares = left.norm_squared();
    let mut damping = 1e-3;
    let mut normal = DMatrix::zeros(start.len(), start.len());
    for _ in 0..STEPS {
        if settings.is_empty() {
            break;
        }
        let slopes = jacobian(rows, &settings, &left, &residuals);
        normal = slopes.transpose() * &slopes;
        let right = slopes.transpose() * &left;
        let mut improved = false;
        while damping < 1e8 {
            let mut damped = normal.clone();
            for member in 0..settings.len() {
                damped[(member, member)] *= 1.0 + damping;
                damped[(member, member)] += 1e-15;
            }
            let Some(step) = damped.cholesky().map(|factor| factor.solve(&right)) else {
                damping *= 10.0;
                continue;
            };
            let moved: Vec<Setting> = (settings.iter().zip(step.iter()))
                .map(|(&(limit, value), step)| {
                    let at = varied(rows, (limit, value)) + step.clamp(-1.0, 1.0);
                    (limit, number(rows, limit, at))
                })
                .collect();
            let tried = residuals(&moved);
            if tried.norm_squared() < squares {
                let share = 1.0 - tried.norm_squared() / squares;
                (settings, squares, left) = (moved, tried.norm_squared(), tried);
                damping = (0.2 * damping).max(1e-9);
                improved = share > STILL;
                break;
            }
            damping *= 4.0;
        }
        if !improved {
            break;
        }
    }
    let squares = squares.max(floor);
    let freedom = used.len().saturating_sub(settings.len()).max(1) as f64;
    let count = settings.len();
    let inverse = normal
        .try_inverse()
        .unwrap_or_else(|| DMatrix::from_diagonal_element(count, count, f64::INFINITY));
    Fitted {
        settings,
        squares,
        covariance: inverse * (squares / freedom),
    }
}

/// How much longer each row takes per unit of each varied number.
fn jacobian(
    rows: &Rows<'_>,
    settings: &[Setting],
    left: &DVector<f64>,
    residuals: &dyn Fn(&[Setting]) -> DVector<f64>,
) -> DMatrix<f64> {
    let mut slopes = DMatrix::zeros(left.len(), settings.len());
    for (member, &(limit, value)) in settings.iter().enumerate() {
        let at = varied(rows, (limit, value));
        // To the other side where the range ends.
        let step = [DIFFERENCE, -DIFFERENCE].into_iter().find(|step| {
            let reached = varied(rows, (limit, number(rows, limit, at + step)));
            (reached - at - step).abs() < 0.1 * DIFFERENCE
        });
        let step = step.unwrap_or(DIFFERENCE);
        let mut moved = settings.to_vec();
        moved[member].1 = number(rows, limit, at + step);
        slopes.set_column(member, &((left - residuals(&moved)) / step));
    }
    slopes
}
