//! Contact points of a flank with the surface: equations (3) to (9) of `docs/source_systems.md, E.1`, and the
//! envelope's own normal.
//!
//! Metres, part frame. One normal per location, (5), is exact on a cone and off by the twist on any other ruled surface
//! (limit (i) of the source): use [`envelope_normal`] for surfaces. For the *difference* of two paths the source's form,
//! [`normal_error`], misses only what moves along the surface times the twist; [`envelope_error`] misses nothing of first
//! order.

use nalgebra::{Point3, Unit, Vector3};

use super::path::{FlankPath, Location};

/// Step to the next location as a share of the path: P1 of (3).
const NEXT: f64 = 1e-4;
/// Half the step of a central difference as a share of the path.
const HALF: f64 = 1e-5;

/// (5): n = ±(e_p × I), e_p to the next location, from the axis into the part; `None` where the path stands.
pub fn path_normal(path: &impl FlankPath, u: f64) -> Option<Unit<Vector3<f64>>> {
    let (first, last) = path.domain();
    let step = (last - first) * NEXT;
    let here = path.location(u);
    let chord = path.location(u + step).point - here.point;
    signed(&chord.cross(&here.axis), path.towards_part(u))
}

/// n(Z) ∝ (P_u + Z I_u) × I: the normal of the surface that the flank sweeps, at height `height` (m) over the tip.
pub fn envelope_normal(path: &impl FlankPath, u: f64, height: f64) -> Option<Unit<Vector3<f64>>> {
    let (first, last) = path.domain();
    let half = (last - first) * HALF;
    let (before, here, after) = (
        path.location(u - half),
        path.location(u),
        path.location(u + half),
    );
    let along = (after.point - before.point)
        + (after.axis.into_inner() - before.axis.into_inner()) * height;
    signed(&along.cross(&here.axis), path.towards_part(u))
}

fn signed(normal: &Vector3<f64>, towards_part: Vector3<f64>) -> Option<Unit<Vector3<f64>>> {
    let normal = Unit::try_new(*normal, 1e-15)?;
    Some(if normal.dot(&towards_part) < 0.0 {
        -normal
    } else {
        normal
    })
}

/// (7), (8): T = P + Z I + R n.
pub fn contact_point(
    location: &Location,
    normal: &Vector3<f64>,
    height: f64,
    radius: f64,
) -> Point3<f64> {
    location.point + location.axis.into_inner() * height + normal * radius
}

/// ε = (T′ − T)·N_out (m): what `actual` with a tool larger by `radius_error` (m) leaves at a height against `nominal`.
///
/// `None` where either path stands.
pub fn normal_error(
    nominal: &impl FlankPath,
    actual: &impl FlankPath,
    u: f64,
    height: f64,
    radius: f64,
    radius_error: f64,
) -> Option<f64> {
    let n = path_normal(nominal, u)?;
    let n_actual = path_normal(actual, u)?;
    let planned = contact_point(&nominal.location(u), &n, height, radius);
    let made = contact_point(
        &actual.location(u),
        &n_actual,
        height,
        radius + radius_error,
    );
    Some(-n.dot(&(made - planned)))
}

/// ε = −n(Z)·[(P′ − P) + Z (I′ − I)] − ΔR (m): the same along the normal of the envelope, to first order exact.
///
/// `None` where the nominal path stands.
pub fn envelope_error(
    nominal: &impl FlankPath,
    actual: &impl FlankPath,
    u: f64,
    height: f64,
    radius_error: f64,
) -> Option<f64> {
    let normal = envelope_normal(nominal, u, height)?;
    let (planned, made) = (nominal.location(u), actual.location(u));
    let turned = made.axis.into_inner() - planned.axis.into_inner();
    Some(-normal.dot(&(made.point - planned.point + turned * height)) - radius_error)
}
