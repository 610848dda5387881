//! The surface a moving cutter really leaves, from its distance to the moving axis alone.
//!
//! Metres, part frame. A point is cut away when at some moment it was nearer to the axis than the tool's radius at that
//! height. No normal of the path enters, so that this is independent of `contact`; it costs a search per point.

use nalgebra::{Point3, Unit, Vector3};

use super::path::FlankPath;

/// How far along the path the nearest axis is looked for, as a share of the path, on either side.
const REACH: f64 = 0.02;
/// Golden sections: 2⁻²⁸ of the reach, whose square is below any rounding of the distance.
const SECTIONS: usize = 40;
/// Steps of the search along the normal, and the length at which it ends, m.
const STEPS: usize = 40;
const FOUND: f64 = 1e-12;

/// How far along `outward` from `point` the surface is that the cutter leaves, m: + material left, − overcut.
///
/// `radius` gives the cutter's radius (m) at a height over its tip (m); `u` is where on the path the point is cut, to
/// within a fiftieth of the path. `None` where no finite answer is found.
pub fn material_left(
    path: &impl FlankPath,
    radius: &impl Fn(f64) -> f64,
    point: &Point3<f64>,
    outward: &Unit<Vector3<f64>>,
    u: f64,
) -> Option<f64> {
    let (first, last) = path.domain();
    let reach = (last - first) * REACH;
    let mut left = 0.0;
    for _ in 0..STEPS {
        let probe = point + outward.into_inner() * left;
        let clear = clearance(path, radius, &probe, (u - reach, u + reach));
        if !clear.is_finite() {
            return None;
        }
        // Along the outward normal the axis comes nearer by as much, to first order.
        left += clear;
        if clear.abs() < FOUND {
            return Some(left);
        }
    }
    None
}

/// Smallest distance of `point` from the cutter while it moves between two parameters, m; negative inside.
fn clearance(
    path: &impl FlankPath,
    radius: &impl Fn(f64) -> f64,
    point: &Point3<f64>,
    (mut low, mut high): (f64, f64),
) -> f64 {
    let at = |u: f64| {
        let location = path.location(u);
        let arm = point - location.point;
        let height = location.axis.dot(&arm);
        (arm - location.axis.into_inner() * height).norm() - radius(height)
    };
    let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut one, mut two) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_one, mut at_two) = (at(one), at(two));
    for _ in 0..SECTIONS {
        if at_one < at_two {
            high = two;
            (two, at_two) = (one, at_one);
            one = high - golden * (high - low);
            at_one = at(one);
        } else {
            low = one;
            (one, at_one) = (two, at_two);
            two = low + golden * (high - low);
            at_two = at(two);
        }
    }
    at_one.min(at_two)
}
