//! How far a ball is from the features of a plan: signed distances to the exact, unbounded surfaces.
//!
//! Metres, part frame. Positive outside the material of a plane, cylinder, sphere or cone, and inside the hole of a
//! bore; profiles and surfaces have no closed form here and are taken as their tangent plane at the nominal point.
//! Which feature a ball touches is the plan's word, not decided here.

use nalgebra::{Point3, Unit, Vector3};

/// The surface a touch aims at.
#[derive(Debug, Clone, Copy)]
pub enum Surface {
    /// Through the point, with this outward normal.
    Plane(Point3<f64>, Unit<Vector3<f64>>),
    /// Outside of a cylinder: a point of its axis, direction, radius (m).
    Cylinder(Point3<f64>, Unit<Vector3<f64>>, f64),
    /// Inside of a cylinder: a point of its axis, direction, radius (m).
    Bore(Point3<f64>, Unit<Vector3<f64>>, f64),
    /// Outside of a ball: centre, radius (m).
    Sphere(Point3<f64>, f64),
    /// Inside of a ball: centre, radius (m).
    Socket(Point3<f64>, f64),
}

impl Surface {
    /// Distance of `centre` from the surface, m; outside the material is positive.
    pub fn distance(&self, centre: &Point3<f64>) -> f64 {
        match self {
            Self::Plane(point, normal) => normal.dot(&(centre - point)),
            Self::Cylinder(origin, axis, radius) => from_axis(centre, origin, axis) - radius,
            Self::Bore(origin, axis, radius) => radius - from_axis(centre, origin, axis),
            Self::Sphere(origin, radius) => (centre - origin).norm() - radius,
            Self::Socket(origin, radius) => radius - (centre - origin).norm(),
        }
    }

    /// Outward normal at the surface point nearest to `centre`; `None` on the axis or in the middle of a sphere.
    pub fn normal(&self, centre: &Point3<f64>) -> Option<Unit<Vector3<f64>>> {
        match self {
            Self::Plane(_, normal) => Some(*normal),
            Self::Cylinder(origin, axis, _) => Unit::try_new(off_axis(centre, origin, axis), 1e-12),
            Self::Bore(origin, axis, _) => Unit::try_new(-off_axis(centre, origin, axis), 1e-12),
            Self::Sphere(origin, _) => Unit::try_new(centre - origin, 1e-12),
            Self::Socket(origin, _) => Unit::try_new(origin - centre, 1e-12),
        }
    }
}

fn off_axis(centre: &Point3<f64>, origin: &Point3<f64>, axis: &Unit<Vector3<f64>>) -> Vector3<f64> {
    let arm = centre - origin;
    arm - axis.into_inner() * axis.dot(&arm)
}

fn from_axis(centre: &Point3<f64>, origin: &Point3<f64>, axis: &Unit<Vector3<f64>>) -> f64 {
    off_axis(centre, origin, axis).norm()
}
