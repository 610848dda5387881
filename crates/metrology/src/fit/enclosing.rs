//! The smallest circle or sphere around points, exactly.
//!
//! Welzl's observation (1991): it is determined by at most D + 1 of them. From any support, the farthest point outside
//! joins; the smallest ball about these few, by enumeration, is the next; its radius grows at every step, so the search
//! ends.

use nalgebra::{DMatrix, DVector, SVector};

/// Centre and radius; `None` without points or if arithmetic fails.
pub(super) fn smallest_enclosing<const D: usize>(
    points: &[SVector<f64, D>],
) -> Option<(SVector<f64, D>, f64)> {
    let mut support = vec![*points.first()?];
    let (mut center, mut radius) = (support[0], 0.0_f64);
    // Each step grows the radius beyond its rounding; many more steps than points are impossible in practice.
    for _ in 0..10 * points.len() + 100 {
        let farthest = points
            .iter()
            .max_by(|a, b| (*a - center).norm().total_cmp(&(*b - center).norm()))?;
        if (farthest - center).norm() <= radius * (1.0 + 4.0 * f64::EPSILON) {
            return Some((center, radius));
        }
        support.push(*farthest);
        let (next, found) = smallest_of_few(&support)?;
        let grown = found.1 > radius;
        (center, radius) = found;
        support = next;
        if !grown {
            return Some((center, radius));
        }
    }
    None
}

type Ball<const D: usize> = (SVector<f64, D>, f64);

/// Smallest ball around at most D + 2 points, and the subset that determines it; the last point is on its surface.
fn smallest_of_few<const D: usize>(
    few: &[SVector<f64, D>],
) -> Option<(Vec<SVector<f64, D>>, Ball<D>)> {
    let last = few.len() - 1;
    let mut best: Option<(Vec<SVector<f64, D>>, Ball<D>)> = None;
    for mask in 0_u32..1 << last {
        let chosen: Vec<SVector<f64, D>> = (0..last)
            .filter(|i| mask & (1 << i) != 0)
            .chain([last])
            .map(|i| few[i])
            .collect();
        if chosen.len() > D + 1 {
            continue;
        }
        let Some((center, radius)) = circumscribed(&chosen) else {
            continue;
        };
        let smaller = best.as_ref().is_none_or(|(_, (_, least))| radius < *least);
        let bound = radius * (1.0 + 8.0 * f64::EPSILON) + f64::MIN_POSITIVE;
        if smaller && few.iter().all(|p| (p - center).norm() <= bound) {
            best = Some((chosen, (center, radius)));
        }
    }
    best
}

/// Smallest ball with all of the points on its surface: its centre lies in their flat.
fn circumscribed<const D: usize>(points: &[SVector<f64, D>]) -> Option<Ball<D>> {
    let arms: Vec<SVector<f64, D>> = points[1..].iter().map(|p| p - points[0]).collect();
    let k = arms.len();
    if k == 0 {
        return Some((points[0], 0.0));
    }
    let gram = DMatrix::from_fn(k, k, |i, j| 2.0 * arms[i].dot(&arms[j]));
    let right = DVector::from_fn(k, |i, _| arms[i].norm_squared());
    let weights = gram.lu().solve(&right)?;
    let offset: SVector<f64, D> = arms.iter().zip(weights.iter()).map(|(a, w)| a * *w).sum();
    let radius = offset.norm();
    radius.is_finite().then(|| (points[0] + offset, radius))
}
