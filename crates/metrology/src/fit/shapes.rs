//! The ideal features, with the signed distance of a point from each. m and rad, frame of the points.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::Point;

/// An ideal feature that points can be measured against.
pub trait Shape {
    /// Name for messages.
    const NAME: &'static str;
    /// Names of the free parameters in the order of [`super::Fit::cofactor`]: `c1`…`c3` displacements along
    /// e1…e3 (m), `a1`, `a2` tilts of e3 towards e1, e2 (rad), `radius` (m), `half_angle` (rad).
    const PARAMETERS: &'static [&'static str];
    /// Signed orthogonal distance of `point` in m; + outside, or on the side of the normal.
    fn distance(&self, point: &Point) -> f64;
}

/// A plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// A point on it; of a fit, the centroid of the points.
    pub point: Point,
    /// Unit normal; of a fit, its largest component is positive.
    pub normal: Vector3<f64>,
}

/// A circle in space. Distances are taken in its plane, radially.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Circle {
    /// Centre.
    pub center: Point,
    /// Unit normal of its plane; of a fit, its largest component is positive.
    pub normal: Vector3<f64>,
    /// Radius in m.
    pub radius: f64,
}

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// Centre.
    pub center: Point,
    /// Radius in m.
    pub radius: f64,
}

/// An endless circular cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cylinder {
    /// Point of the axis; of a fit, the one nearest to the centroid of the points.
    pub point: Point,
    /// Unit direction of the axis; of a fit, its largest component is positive.
    pub axis: Vector3<f64>,
    /// Radius in m.
    pub radius: f64,
}

/// One nappe of a circular cone, described at a point of its axis so that slender cones stay well defined.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cone {
    /// Point of the axis; of a fit, the one nearest to the centroid of the points.
    pub point: Point,
    /// Unit direction of the axis, from the apex to the opening.
    pub axis: Vector3<f64>,
    /// Radius in m in the plane across the axis through `point`.
    pub radius: f64,
    /// Angle between axis and generatrix in rad, in [0, π/2).
    pub half_angle: f64,
}

impl Plane {
    /// The same plane with the normal on the side of `direction`; residuals measured before change sign with it.
    pub fn facing(self, direction: &Vector3<f64>) -> Self {
        if self.normal.dot(direction) < 0.0 {
            Self {
                normal: -self.normal,
                ..self
            }
        } else {
            self
        }
    }
}

impl Shape for Plane {
    const NAME: &'static str = "plane";
    const PARAMETERS: &'static [&'static str] = &["c3", "a1", "a2"];
    fn distance(&self, point: &Point) -> f64 {
        (point - self.point).dot(&self.normal)
    }
}

impl Shape for Circle {
    const NAME: &'static str = "circle";
    const PARAMETERS: &'static [&'static str] = &["c1", "c2", "radius", "c3", "a1", "a2"];
    fn distance(&self, point: &Point) -> f64 {
        across(&(point - self.center), &self.normal).norm() - self.radius
    }
}

impl Shape for Sphere {
    const NAME: &'static str = "sphere";
    const PARAMETERS: &'static [&'static str] = &["c1", "c2", "c3", "radius"];
    fn distance(&self, point: &Point) -> f64 {
        (point - self.center).norm() - self.radius
    }
}

impl Shape for Cylinder {
    const NAME: &'static str = "cylinder";
    const PARAMETERS: &'static [&'static str] = &["c1", "c2", "a1", "a2", "radius"];
    fn distance(&self, point: &Point) -> f64 {
        across(&(point - self.point), &self.axis).norm() - self.radius
    }
}

impl Shape for Cone {
    const NAME: &'static str = "cone";
    const PARAMETERS: &'static [&'static str] = &["c1", "c2", "a1", "a2", "radius", "half_angle"];
    fn distance(&self, point: &Point) -> f64 {
        let arm = point - self.point;
        let (sin, cos) = self.half_angle.sin_cos();
        (across(&arm, &self.axis).norm() - self.radius) * cos - arm.dot(&self.axis) * sin
    }
}

/// Part of `arm` at right angles to the unit vector `axis`.
fn across(arm: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
    arm - axis * arm.dot(axis)
}
