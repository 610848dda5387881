//! Finds the hidden errors from touches of the bore and the box by one linear least squares.
//!
//! The simulated ball centre is at `x (1 + k) − b/2 sgn(v) + o` on each axis (reading `x`, direction of travel `v`), and
//! the probe trips when that centre is the true ball radius away from the surface. To first order in the errors the
//! deviation of a touch `d = n·(x − p) − r` along the outward normal `n` is
//!
//! ```text
//! d = Δr − Σ n_i o_i − Σ n_i x_i k_i − ½ Σ |n_i| b_i
//! ```
//!
//! since the approach is against the normal. The latch comes up to one servo period late, which adds
//! −feed × 1 ms / 2 on average (0.25 µm at 0.5 mm/s) and looks like a smaller ball.

use anyhow::Context;
use nalgebra::{DMatrix, DVector};
use probecell_msgs::{InspectionPlan, ProbeTrigger};

/// Errors in the order of [`NAMES`]; m, except scales.
pub(crate) const NAMES: [&str; 9] = [
    "ball-r", "offset-x", "offset-y", "offset-z", "scale-x", "scale-y", "lost-x", "lost-y",
    "lost-z",
];

/// Deviation of a touch, m: `n·(x − p) − r`.
pub(crate) fn deviation(plan: &InspectionPlan, trigger: &ProbeTrigger) -> f64 {
    let point = &plan.points[trigger.point_index as usize];
    let (position, normal) = (
        <[f64; 3]>::from(point.position),
        <[f64; 3]>::from(point.normal),
    );
    let along = (0..3)
        .map(|axis| normal[axis] * (trigger.axis_positions[axis] - position[axis]))
        .sum::<f64>();
    along - plan.stylus.ball_radius
}

/// Least squares over touches of several plans. Lost motion in Z is not separable from the offset in Z with one face;
/// the solution of least norm shares it, so both are reported as their sum by the caller.
pub(crate) fn errors(touches: &[(&InspectionPlan, &ProbeTrigger)]) -> anyhow::Result<[f64; 9]> {
    let mut rows = Vec::new();
    let mut values = Vec::new();
    for (plan, trigger) in touches {
        let normal = <[f64; 3]>::from(plan.points[trigger.point_index as usize].normal);
        let reading = &trigger.axis_positions;
        rows.extend([1.0, -normal[0], -normal[1], -normal[2]]);
        rows.extend([-normal[0] * reading[0], -normal[1] * reading[1]]);
        rows.extend(normal.map(|part| -0.5 * part.abs()));
        values.push(deviation(plan, trigger));
    }
    // Columns of like size: a scale error is weighed by a length of the artefact.
    let weights = [1.0, 1.0, 1.0, 1.0, 0.02, 0.02, 1.0, 1.0, 1.0];
    let mut matrix = DMatrix::from_row_slice(values.len(), 9, &rows);
    for (mut column, weight) in matrix.column_iter_mut().zip(weights) {
        column /= weight;
    }
    let solved = matrix
        .svd(true, true)
        .solve(&DVector::from_vec(values), 1e-9)
        .ok()
        .context("least squares")?;
    let mut errors = [0.0; 9];
    for ((error, value), weight) in errors.iter_mut().zip(solved.iter()).zip(weights) {
        *error = value / weight;
    }
    Ok(errors)
}
