//! A three-axis machine that touches five balls.

use nalgebra::{Point3, Vector3};

/// Nominal radius of the stylus ball, m.
pub(super) const STYLUS: f64 = 0.003;
/// Radius of the balls, m.
pub(super) const BALL: f64 = 0.0127;
/// Centres of the balls, m.
pub(super) const CENTRES: [[f64; 3]; 5] = [
    [0.0, 0.0, -0.10],
    [0.18, 0.15, -0.16],
    [-0.18, 0.15, 0.05],
    [-0.17, -0.16, -0.15],
    [0.18, -0.15, 0.08],
];
/// Directions from which each is touched, outward.
pub(super) const NORMALS: [[f64; 3]; 5] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
];
/// Touches of a session.
pub(super) const TOUCHES: usize = CENTRES.len() * NORMALS.len();

/// Errors of a machine.
#[derive(Debug, Clone)]
pub(super) struct Errors {
    /// True travel of X, Y, Z = reading × (1 + scale).
    pub(super) scale: [f64; 3],
    /// The ball is larger by so much, m.
    pub(super) radius: f64,
    /// Displacement of the artefact, m.
    pub(super) shift: [f64; 3],
}

/// Readings of X, Y, Z at which each point triggers, with these errors (m) along the normals: the true ball touches the true
/// sphere.
pub(super) fn touches(errors: &Errors, noise: &[f64]) -> Vec<Point3<f64>> {
    let mut found = Vec::with_capacity(TOUCHES);
    for (ball, centre) in CENTRES.iter().enumerate() {
        let nominal = Point3::from(*centre);
        let centre = nominal + Vector3::from(errors.shift);
        for (side, normal) in NORMALS.iter().enumerate() {
            let normal = Vector3::from(*normal);
            let reading = |away: f64| nominal + normal * (BALL + STYLUS + away);
            let distance = |away: f64| {
                let at = reading(away);
                let ball = Point3::new(
                    at.x * (1.0 + errors.scale[0]),
                    at.y * (1.0 + errors.scale[1]),
                    at.z * (1.0 + errors.scale[2]),
                );
                (ball - centre).norm() - BALL - STYLUS - errors.radius
            };
            // The distance grows by what the reading moves, to first order.
            let mut away = 0.0;
            for _ in 0..6 {
                away -= distance(away);
            }
            found.push(reading(away + noise[ball * NORMALS.len() + side]));
        }
    }
    found
}
