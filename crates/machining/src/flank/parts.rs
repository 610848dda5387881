//! Two parts for flank milling: an S-shaped ruled piece and the cone frustum of NAS 979.
//!
//! Metres, part frame. `docs/source_systems.md, E.3`. The S piece is an equivalent by our own control points; it does
//! not claim conformance with ISO 10791-7. The frustum's dimensions are from memory of the standard and need checking
//! against it.

use metrology::profile::{Spline, SplineError};
use nalgebra::{Point3, Rotation3, Unit, Vector2, Vector3};

use super::path::{FlankPath, Location};

/// A part with one ruled surface that a flank makes: a path, and the surface it is meant to leave.
pub trait RuledPart: FlankPath {
    /// Point at path parameter `u` and share `v` of the ruling (0 bottom, 1 top), and the outward normal there.
    fn surface(&self, u: f64, v: f64) -> (Point3<f64>, Unit<Vector3<f64>>);

    /// Length of the ruling at `u`, m.
    fn ruling(&self, u: f64) -> f64;
}

/// Control points of the S piece at the bottom and at the top, mm.
const BOTTOM_MM: [[f64; 2]; 10] = [
    [0., 0.],
    [22., 34.],
    [58., 62.],
    [98., 58.],
    [130., 20.],
    [150., -20.],
    [182., -58.],
    [222., -62.],
    [258., -34.],
    [280., 0.],
];
const TOP_MM: [[f64; 2]; 10] = [
    [3.358, -2.173],
    [26.382, 29.901],
    [60.409, 54.371],
    [95.481, 53.681],
    [131.664, 21.109],
    [154.16, -17.226],
    [186.535, -50.226],
    [219.892, -55.325],
    [255.809, -31.951],
    [280., 0.],
];
/// Height of the S piece, m.
const S_HEIGHT: f64 = 0.040;

/// Ruled surface between two plane cubics, milled on the left of travel with the axis along the rulings.
#[derive(Debug, Clone)]
pub struct SPiece {
    bottom: Spline,
    top: Spline,
    radius: f64,
    offset_at: f64,
}

impl SPiece {
    /// For a cutter of `radius` (m); its axis is offset from the bottom edge along the normal at mid height.
    ///
    /// # Errors
    /// None in practice; the control points are fixed.
    pub fn new(radius: f64) -> Result<Self, SplineError> {
        Self::offset_along(radius, 0.5)
    }

    /// The same, offset along the normal at share `v` of the ruling.
    ///
    /// # Errors
    /// None in practice; the control points are fixed.
    pub fn offset_along(radius: f64, v: f64) -> Result<Self, SplineError> {
        let curve = |points: &[[f64; 2]]| {
            let points: Vec<Vector2<f64>> = points
                .iter()
                .map(|[x, y]| Vector2::new(x * 1e-3, y * 1e-3))
                .collect();
            Spline::clamped_uniform(&points)
        };
        Ok(Self {
            bottom: curve(&BOTTOM_MM)?,
            top: curve(&TOP_MM)?,
            radius,
            offset_at: v,
        })
    }

    /// Lengths of the bottom and the top edge, m.
    pub fn edge_lengths(&self) -> [f64; 2] {
        [self.bottom.length(), self.top.length()]
    }

    fn edge(&self, u: f64) -> (Point3<f64>, Vector3<f64>) {
        let (bottom, top) = (self.bottom.point(u), self.top.point(u));
        let low = Point3::new(bottom.x, bottom.y, 0.0);
        (low, Point3::new(top.x, top.y, S_HEIGHT) - low)
    }
}

impl FlankPath for SPiece {
    fn domain(&self) -> (f64, f64) {
        self.bottom.domain()
    }

    fn location(&self, u: f64) -> Location {
        let (low, ruling) = self.edge(u);
        let (_, normal) = self.surface(u, self.offset_at);
        Location {
            point: low + normal.into_inner() * self.radius,
            axis: Unit::new_normalize(ruling),
        }
    }

    fn towards_part(&self, u: f64) -> Vector3<f64> {
        -self.surface(u, 0.5).1.into_inner()
    }
}

impl RuledPart for SPiece {
    fn surface(&self, u: f64, v: f64) -> (Point3<f64>, Unit<Vector3<f64>>) {
        let (low, ruling) = self.edge(u);
        let [_, along_bottom, _] = self.bottom.derivatives(u);
        let [_, along_top, _] = self.top.derivatives(u);
        let along = along_bottom * (1.0 - v) + along_top * v;
        // Left of travel: upwards × along.
        let normal = ruling.cross(&Vector3::new(along.x, along.y, 0.0));
        (low + ruling * v, Unit::new_normalize(normal))
    }

    fn ruling(&self, u: f64) -> f64 {
        self.edge(u).1.norm()
    }
}

/// Cone frustum: base Ø80, 15° to the axis, 20 high, its axis leant by 10° about y; the path goes round once.
#[derive(Debug, Clone)]
pub struct ConeFrustum {
    radius: f64,
    base: f64,
    half_apex: f64,
    height: f64,
    leant: Rotation3<f64>,
}

impl ConeFrustum {
    /// For a cutter of `radius` (m).
    pub fn new(radius: f64) -> Self {
        Self {
            radius,
            base: 0.040,
            half_apex: 15.0_f64.to_radians(),
            height: 0.020,
            leant: Rotation3::from_axis_angle(&Vector3::y_axis(), 10.0_f64.to_radians()),
        }
    }

    /// Radius at the top, m.
    pub fn top_radius(&self) -> f64 {
        self.base - self.height * self.half_apex.tan()
    }

    /// Point of the base, direction of the generator, outward normal.
    fn generator(&self, angle: f64) -> (Point3<f64>, Unit<Vector3<f64>>, Unit<Vector3<f64>>) {
        let ((sin, cos), (s, c)) = (angle.sin_cos(), self.half_apex.sin_cos());
        let turn = |x, y, z| self.leant * Vector3::new(x, y, z);
        (
            Point3::from(turn(self.base * cos, self.base * sin, 0.0)),
            Unit::new_normalize(turn(-s * cos, -s * sin, c)),
            Unit::new_normalize(turn(c * cos, c * sin, s)),
        )
    }
}

impl FlankPath for ConeFrustum {
    fn domain(&self) -> (f64, f64) {
        (0.0, std::f64::consts::TAU)
    }

    fn location(&self, u: f64) -> Location {
        let (base, axis, normal) = self.generator(u);
        Location {
            point: base + normal.into_inner() * self.radius,
            axis,
        }
    }

    fn towards_part(&self, u: f64) -> Vector3<f64> {
        -self.generator(u).2.into_inner()
    }
}

impl RuledPart for ConeFrustum {
    fn surface(&self, u: f64, v: f64) -> (Point3<f64>, Unit<Vector3<f64>>) {
        let (base, axis, normal) = self.generator(u);
        (base + axis.into_inner() * (v * self.ruling(u)), normal)
    }

    fn ruling(&self, _: f64) -> f64 {
        self.height / self.half_apex.cos()
    }
}
