//! Bodies that must not be hit, by lower bounds of the distance from them.

use nalgebra::{Point3, Unit, Vector3};

/// Outward unit normal of a plane, and its offset from the origin along that normal, m.
pub type Face = (Vector3<f64>, f64);

/// A point of a straight line, and its direction.
pub type Line = (Point3<f64>, Unit<Vector3<f64>>);

/// A body of the part, part frame, m.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// All points below every face and outside of every bore (axis and radius): a convex block, or a plane as far as it
    /// is touched, with holes.
    Block {
        /// Faces all round.
        faces: Vec<Face>,
        /// Holes of any depth.
        bores: Vec<(Line, f64)>,
    },
    /// Between two heights along an axis and two radii around it: a shaft, the wall of a bore, a disc.
    Round {
        /// Axis.
        axis: Line,
        /// Lowest and highest point along the axis, from its origin.
        heights: [f64; 2],
        /// Inner and outer radius; inner 0: solid.
        radii: [f64; 2],
    },
    /// A ball.
    Ball {
        /// Centre.
        centre: Point3<f64>,
        /// Radius.
        radius: f64,
    },
}

impl Body {
    /// Distance of a point from the surface, m; negative inside. Near edges and corners of a block it is the distance
    /// from the farthest face, which is too small, so that no collision is missed. It changes by no more than the point
    /// moves (Lipschitz constant 1), which is what [`super::Stylus`] and [`super::Surroundings`] build upon.
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        match self {
            Self::Block { faces, bores } => {
                let outside = faces
                    .iter()
                    .map(|(normal, offset)| normal.dot(&point.coords) - offset);
                let inside = bores
                    .iter()
                    .map(|(line, radius)| radius - cylindrical(line, point)[1]);
                outside.chain(inside).fold(f64::NEG_INFINITY, f64::max)
            }
            Self::Round {
                axis,
                heights: [low, high],
                radii: [inner, outer],
            } => {
                let [height, radius] = cylindrical(axis, point);
                let inside = if *inner > 0.0 {
                    inner - radius
                } else {
                    f64::NEG_INFINITY
                };
                let across = (radius - outer).max(inside);
                let along = (height - high).max(low - height);
                if across > 0.0 && along > 0.0 {
                    (across * across + along * along).sqrt()
                } else {
                    across.max(along)
                }
            }
            Self::Ball { centre, radius } => (point - centre).norm() - radius,
        }
    }
}

/// Height along a line and distance from it, m.
pub(super) fn cylindrical((origin, axis): &Line, point: &Point3<f64>) -> [f64; 2] {
    let arm = point - origin;
    let height = axis.dot(&arm);
    [height, (arm - axis.into_inner() * height).norm()]
}
