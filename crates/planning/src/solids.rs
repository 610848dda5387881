//! Holds simple bodies in the part frame and says how near a moving stylus comes to them.
//!
//! Part and fixture are convex solids: boxes, cylinders, sets of half spaces. A stylus is a ball, a stem and the probe
//! body behind it, the latter two with round ends; it moves on straight legs without turning. A solid's distance is a convex function of the point, so
//! its least value over a leg and a stem is found by two nested one-dimensional searches. All lengths are m.

use serde::{Deserialize, Serialize};

/// A point or direction in the part frame, m.
pub type Vector = [f64; 3];

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a + t·b
pub(crate) fn along(a: Vector, t: f64, b: Vector) -> Vector {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

pub(crate) fn difference(a: Vector, b: Vector) -> Vector {
    along(a, -1.0, b)
}

pub(crate) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// A convex body that must not be hit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Solid {
    /// A box along the axes of the part frame.
    Box {
        /// Corner with the least coordinates, m.
        min: Vector,
        /// Corner with the largest coordinates, m.
        max: Vector,
    },
    /// A solid cylinder.
    Cylinder {
        /// Centre of one end, m.
        base: Vector,
        /// Unit vector to the other end.
        axis: Vector,
        /// Length, m.
        length: f64,
        /// Radius, m.
        radius: f64,
    },
    /// All points with normal · point ≤ offset for every (unit normal, offset in m).
    Convex(Vec<(Vector, f64)>),
}

impl Solid {
    /// Distance of a point from the surface, m; negative inside. Beside edges and corners of [`Solid::Convex`] it is
    /// the largest distance from a face, which is too small, so that a collision is never missed.
    pub fn distance(&self, point: Vector) -> f64 {
        match self {
            Self::Box { min, max } => {
                let out = [0, 1, 2].map(|i| (min[i] - point[i]).max(point[i] - max[i]));
                outside(&out)
            }
            Self::Cylinder {
                base,
                axis,
                length,
                radius,
            } => {
                let from = difference(point, *base);
                let height = dot(from, *axis);
                let radial = norm(along(from, -height, *axis));
                outside(&[radial - radius, (height - length).max(-height)])
            }
            Self::Convex(faces) => faces
                .iter()
                .map(|&(normal, offset)| dot(normal, point) - offset)
                .fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// True when every number is finite and every direction a unit vector, and the body is not inside out.
    pub fn is_valid(&self) -> bool {
        let finite = |v: &Vector| v.iter().all(|x| x.is_finite());
        let unit = |v: &Vector| finite(v) && (norm(*v) - 1.0).abs() < 1e-9;
        match self {
            Self::Box { min, max } => {
                finite(min) && finite(max) && (0..3).all(|i| min[i] <= max[i])
            }
            Self::Cylinder {
                base,
                axis,
                length,
                radius,
            } => {
                let size = |x: f64| x.is_finite() && x >= 0.0;
                finite(base) && unit(axis) && size(*length) && size(*radius)
            }
            Self::Convex(faces) => {
                !faces.is_empty()
                    && faces
                        .iter()
                        .all(|(n, offset)| unit(n) && offset.is_finite())
            }
        }
    }
}

/// Distance from the amounts by which a point exceeds orthogonal bounds.
fn outside(excess: &[f64]) -> f64 {
    let most = excess.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most <= 0.0 {
        most
    } else {
        excess
            .iter()
            .map(|e| e.max(0.0).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}

/// Ball, stem and probe body in one line; where they point is a matter of the touch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StylusShape {
    /// Radius of the ball, m.
    pub ball_radius: f64,
    /// Radius of the stem, m.
    pub stem_radius: f64,
    /// From the ball centre to the probe body, m.
    pub stem_length: f64,
    /// Radius of the probe body, m.
    pub body_radius: f64,
    /// Length of the probe body and what carries it, m.
    pub body_length: f64,
}

impl StylusShape {
    /// True when all lengths are finite and not negative.
    pub fn is_valid(&self) -> bool {
        [
            self.ball_radius,
            self.stem_radius,
            self.stem_length,
            self.body_radius,
            self.body_length,
        ]
        .iter()
        .all(|x| x.is_finite() && *x >= 0.0)
    }

    /// Farthest point of the stylus and probe from the ball centre, m.
    pub fn reach(&self) -> f64 {
        (self.stem_length + self.body_length + self.body_radius).max(self.ball_radius)
    }

    /// True when the stylus, moving straight between two ball centres with the stem towards `stem` (unit), stays at
    /// least `margin` m away from the solid.
    pub fn is_clear(
        &self,
        solid: &Solid,
        from: Vector,
        to: Vector,
        stem: Vector,
        margin: f64,
    ) -> bool {
        let move_ = difference(to, from);
        let [ball, shank, body] = [
            (0.0, 0.0, self.ball_radius),
            (0.0, self.stem_length, self.stem_radius),
            (
                self.stem_length,
                self.stem_length + self.body_length,
                self.body_radius,
            ),
        ];
        [ball, shank, body].into_iter().all(|(near, far, radius)| {
            let needed = radius + margin;
            let spot = |s: f64, t: f64| {
                solid.distance(along(along(from, s, move_), near + t * (far - near), stem))
            };
            let half = 0.5 * (norm(move_) + far - near);
            if spot(0.5, 0.5) - half >= needed {
                return true;
            }
            if far == near {
                return least(|s| spot(s, 0.0)) >= needed;
            }
            least(|s| least(|t| spot(s, t))) >= needed
        })
    }
}

/// Least value of a convex function over 0..1 by golden sections; the argument is narrowed to 4e-9.
fn least(f: impl Fn(f64) -> f64) -> f64 {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.0, 1.0);
    let (mut a, mut b) = (1.0 - golden, golden);
    let (mut fa, mut fb) = (f(a), f(b));
    let mut best = f(0.0).min(f(1.0)).min(fa).min(fb);
    for _ in 0..40 {
        if fa <= fb {
            (high, b, fb) = (b, a, fa);
            a = high - golden * (high - low);
            fa = f(a);
            best = best.min(fa);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + golden * (high - low);
            fb = f(b);
            best = best.min(fb);
        }
    }
    best
}
