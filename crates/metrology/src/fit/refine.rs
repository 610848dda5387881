//! The descent all curved fits share: Levenberg–Marquardt on a model that knows its own small displacements.
//!
//! Parameters are displacements of the current model in its own frame (Forbes, NPL report DITC 140/89), so no
//! parametrisation has a singular pose, and lengths and angles are of order one (see [`super::cloud`]). The normal
//! equations are accumulated in one pass over the points without storing the Jacobian; the fixed point depends on the
//! gradient only, hence keeps full precision.

use nalgebra::{Const, DimMin, SMatrix, SVector};

use super::Point;

/// A shape with P small displacements.
pub(super) trait Model<const P: usize>: Copy {
    /// Residual of a point and its derivatives by the displacements.
    fn linearise(&self, point: &Point) -> (f64, SVector<f64, P>);
    /// The model displaced by `step`; `None` where no such shape exists.
    fn moved(&self, step: &SVector<f64, P>) -> Option<Self>;
}

/// Where a descent ended.
pub(super) struct Minimum<M, const P: usize> {
    pub(super) model: M,
    /// `Σr²`, dimensionless.
    pub(super) sum: f64,
    /// `JᵀJ`, dimensionless.
    pub(super) normal: SMatrix<f64, P, P>,
    /// True at a minimum, false where the passes ran out.
    pub(super) converged: bool,
}

struct Sums<const P: usize> {
    sum: f64,
    gradient: SVector<f64, P>,
    normal: SMatrix<f64, P, P>,
}

fn accumulate<M: Model<P>, const P: usize>(model: &M, points: &[Point]) -> Sums<P> {
    let mut sums = Sums {
        sum: 0.0,
        gradient: SVector::zeros(),
        normal: SMatrix::zeros(),
    };
    for point in points {
        let (r, j) = model.linearise(point);
        sums.sum += r * r;
        // Of each column what lies below the diagonal, from an even row on: these loops run in vector registers.
        for a in 0..P {
            sums.gradient[a] += j[a] * r;
            for b in a / 2 * 2..P {
                sums.normal[(b, a)] += j[b] * j[a];
            }
        }
    }
    for a in 0..P {
        for b in a + 1..P {
            sums.normal[(a, b)] = sums.normal[(b, a)];
        }
    }
    sums
}

/// Descends from `model`; `None` if no minimum is reached within `limit` passes over the points.
pub(super) fn refine<M: Model<P>, const P: usize>(
    model: M,
    points: &[Point],
    limit: usize,
) -> Option<Minimum<M, P>>
where
    Const<P>: DimMin<Const<P>, Output = Const<P>>,
{
    let reached = descend(model, points, limit);
    reached.converged.then_some(reached)
}

/// Descends from `model` for at most `limit` passes over the points, to wherever that leads.
pub(super) fn descend<M: Model<P>, const P: usize>(
    model: M,
    points: &[Point],
    limit: usize,
) -> Minimum<M, P>
where
    Const<P>: DimMin<Const<P>, Output = Const<P>>,
{
    let mut current = model;
    let mut sums = accumulate(&current, points);
    let mut damping = 1e-6;
    let mut growth = 4.0;
    let mut previous = f64::INFINITY;
    let mut converged = false;
    // Sum of squares that rounding of the residuals alone produces.
    let floor = points.len() as f64 * f64::EPSILON * f64::EPSILON;
    for _ in 0..limit {
        let Some(step) = damped_step(&sums, damping) else {
            break;
        };
        let length = step.amax();
        let close = length < 1e-7;
        if length <= 4.0 * f64::EPSILON || (close && length > 0.5 * previous) {
            converged = true;
            break;
        }
        let trial = current
            .moved(&step)
            .map(|moved| (moved, accumulate(&moved, points)))
            .filter(|(_, s)| s.sum.is_finite() && s.normal.iter().all(|v| v.is_finite()));
        // Close to the minimum the change of the sum is below its rounding: trust the step.
        let bound = if close {
            sums.sum * (1.0 + 1e-9) + floor
        } else {
            sums.sum
        };
        match trial {
            Some((moved, s)) if s.sum < bound => {
                current = moved;
                sums = s;
                growth = 4.0;
                damping = if close {
                    0.0
                } else {
                    (damping * 0.1).max(1e-14)
                };
                previous = if close { length } else { f64::INFINITY };
            }
            _ if close => {
                converged = true;
                break;
            }
            _ => {
                damping = damping.max(1e-8) * growth;
                growth *= 2.0;
            }
        }
    }
    Minimum {
        model: current,
        sum: sums.sum,
        normal: sums.normal,
        converged,
    }
}

fn damped_step<const P: usize>(sums: &Sums<P>, damping: f64) -> Option<SVector<f64, P>>
where
    Const<P>: DimMin<Const<P>, Output = Const<P>>,
{
    let mut matrix = sums.normal;
    let mean = matrix.trace() / P as f64;
    for a in 0..P {
        // The second term keeps a displacement to which the points are blind at rest.
        matrix[(a, a)] += damping * matrix[(a, a)] + f64::EPSILON * mean;
    }
    let step = match matrix.cholesky() {
        Some(factor) => -factor.solve(&sums.gradient),
        None => -matrix.lu().solve(&sums.gradient)?,
    };
    step.iter().all(|v| v.is_finite()).then_some(step)
}

/// `N⁻¹`; `None` where the points leave a displacement undetermined.
pub(super) fn inverse<const P: usize>(normal: &SMatrix<f64, P, P>) -> Option<SMatrix<f64, P, P>>
where
    Const<P>: DimMin<Const<P>, Output = Const<P>>,
{
    let scale: SVector<f64, P> = normal.diagonal().map(f64::sqrt);
    if scale.iter().any(|s| !s.is_normal()) {
        return None;
    }
    let mut correlation = *normal;
    for a in 0..P {
        for b in 0..P {
            correlation[(a, b)] /= scale[a] * scale[b];
        }
    }
    let mut inverse = correlation.cholesky()?.inverse();
    // The largest diagonal of the inverse bounds the condition: beyond this the sums' rounding decides.
    if inverse.diagonal().max() > 1e13 {
        return None;
    }
    for a in 0..P {
        for b in 0..P {
            inverse[(a, b)] /= scale[a] * scale[b];
        }
    }
    Some(inverse)
}
