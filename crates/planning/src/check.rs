//! Decides whether moves are free of collision by another way than they were made: walks along them in small steps and
//! asks for points on the skin of ball, stem and probe body whether they lie inside a solid.
//!
//! It knows no distances and no searches, so it cannot share a mistake with [`crate::moves`]. A body thinner than the
//! step may be missed: choose the step below half the thickness of what may be hit.

use std::f64::consts::TAU;

use crate::moves::Station;
use crate::solids::{Solid, StylusShape, Vector};

/// A point of the stylus inside a solid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("on move {leg} the stylus with its ball at {ball:?} m enters solid {solid}")]
pub struct Collision {
    /// Index of the move: from this station to the next.
    pub leg: usize,
    /// Index of the solid.
    pub solid: usize,
    /// Ball centre, m.
    pub ball: Vector,
}

/// Walks along the stations in steps of at most `step` m. A point deeper than `tolerance` m below the skin of the
/// stylus counts, so that a ball in contact does not. A move on which the stem turns is walked with the stem passing
/// straight from one direction to the other.
///
/// # Errors
/// [`Collision`] for the first point found inside a solid.
pub fn check_moves(
    stations: &[Station],
    stylus: &StylusShape,
    solids: &[Solid],
    step: f64,
    tolerance: f64,
) -> Result<(), Collision> {
    for (leg, ends) in stations.windows(2).enumerate() {
        let far = distance(ends[0].ball, ends[1].ball)
            + stylus.reach() * distance(ends[0].stem, ends[1].stem);
        let steps = (far / step).ceil().max(1.0) as u32;
        for at in 0..=steps {
            let part = f64::from(at) / f64::from(steps);
            let mix = |a: Vector, b: Vector| [0, 1, 2].map(|i| (1.0 - part) * a[i] + part * b[i]);
            let ball = mix(ends[0].ball, ends[1].ball);
            let stem = mix(ends[0].stem, ends[1].stem);
            let skin = skin(stylus, ball, stem, step, tolerance);
            if let Some(solid) = solids
                .iter()
                .position(|solid| skin.iter().any(|&point| contains(solid, point)))
            {
                return Err(Collision { leg, solid, ball });
            }
        }
    }
    Ok(())
}

fn distance(a: Vector, b: Vector) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn contains(solid: &Solid, point: Vector) -> bool {
    match solid {
        Solid::Box { min, max } => (0..3).all(|i| min[i] < point[i] && point[i] < max[i]),
        Solid::Cylinder {
            base,
            axis,
            length,
            radius,
        } => {
            let r = [0, 1, 2].map(|i| point[i] - base[i]);
            let height = r[0] * axis[0] + r[1] * axis[1] + r[2] * axis[2];
            let square: f64 = r.iter().map(|x| x * x).sum();
            0.0 < height && height < *length && square - height * height < radius * radius
        }
        Solid::Convex(faces) => faces
            .iter()
            .all(|(n, offset)| n[0] * point[0] + n[1] * point[1] + n[2] * point[2] < *offset),
    }
}

/// Points on the axis and in rings around it: the ball as rings of a sphere, stem and body as rings of cylinders.
fn skin(
    stylus: &StylusShape,
    ball: Vector,
    stem: Vector,
    step: f64,
    tolerance: f64,
) -> Vec<Vector> {
    let size = distance(stem, [0.0; 3]);
    if size < 1e-9 {
        return vec![ball];
    }
    let stem = stem.map(|x| x / size);
    let helper = if stem[0].abs() < 0.6 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let cross = |a: Vector, b: Vector| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let raw = cross(stem, helper);
    let length = distance(raw, [0.0; 3]);
    let u = raw.map(|x| x / length);
    let v = cross(stem, u);
    let mut points = Vec::new();
    let mut ring = |height: f64, radius: f64| {
        let spokes = (TAU * radius / step).ceil().clamp(8.0, 64.0) as u32;
        points.push([0, 1, 2].map(|i| ball[i] + height * stem[i]));
        for spoke in 0..spokes {
            let (sine, cosine) = (TAU * f64::from(spoke) / f64::from(spokes)).sin_cos();
            points.push(
                [0, 1, 2]
                    .map(|i| ball[i] + height * stem[i] + radius * (cosine * u[i] + sine * v[i])),
            );
        }
    };
    let radius = (stylus.ball_radius - tolerance).max(0.0);
    for latitude in 0..=12 {
        let (sine, cosine) = (0.5 * TAU * (f64::from(latitude) / 12.0 - 0.5)).sin_cos();
        ring(radius * sine, radius * cosine);
    }
    for (from, length, radius) in [
        (0.0, stylus.stem_length, stylus.stem_radius),
        (stylus.stem_length, stylus.body_length, stylus.body_radius),
    ] {
        let rings = (length / step).ceil().max(1.0) as u32;
        for at in 0..=rings {
            ring(
                from + length * f64::from(at) / f64::from(rings),
                (radius - tolerance).max(0.0),
            );
        }
    }
    points
}
