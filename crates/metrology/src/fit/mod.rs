//! Least-squares fits of line, plane, circle, sphere, cylinder and cone to measured points.
//!
//! The sum of squared *orthogonal* distances is minimised (the Gaussian associated feature of ISO 14405-1 and
//! ISO 10360-6). Lengths in m, angles in rad, all in the frame of the points. Points count equally; the feature's
//! nominal plays no part, starting values are found from the points alone.
//!
//! Each fit carries the cofactor matrix `(JᵀJ)⁻¹` of its parameters in a local frame, so that
//! `u²·(JᵀJ)⁻¹` is their covariance for independent points of standard uncertainty `u` (GUM, JCGM 100, 5.1.2,
//! first order). What these fits do not do: reject outliers ([`robust`]), touch the
//! points ([`zone`]), or judge the result.

mod circle_sphere;
mod cloud;
mod cylinder_cone;
mod enclosing;
mod linear_program;
mod moments;
mod plane;
mod refine;
pub mod robust;
mod shapes;
pub mod zone;

pub use circle_sphere::{circle, sphere};
pub use cylinder_cone::{cone, cylinder, cylinder_about};
pub use plane::plane;
pub use shapes::{Circle, Cone, Cylinder, Plane, Shape, Sphere};

use cloud::frame_about;
use nalgebra::{DMatrix, Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A position in m, or a direction, in the caller's frame.
pub type Point = Vector3<f64>;

/// Why points have no fit.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FitError {
    /// Fewer points than the shape has parameters.
    #[error("a {shape} needs at least {needed} points, {given} given")]
    TooFewPoints {
        /// The shape's name.
        shape: &'static str,
        /// Smallest admissible number.
        needed: usize,
        /// Number given.
        given: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} has a coordinate that is not a number")]
    NotFinite {
        /// Index of the first such point.
        index: usize,
    },
    /// The points lie so that they leave the shape undetermined.
    #[error("the points do not determine a {shape}: {reason}")]
    Degenerate {
        /// The shape's name.
        shape: &'static str,
        /// How they lie.
        reason: &'static str,
    },
    /// No minimum was found; the best shape lies at infinity or the points are far from the shape.
    #[error("no best {shape} found within {iterations} iterations")]
    NotConverged {
        /// The shape's name.
        shape: &'static str,
        /// Iterations spent.
        iterations: usize,
    },
}

/// A shape through points, and how well they determine it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit<S> {
    /// The fitted shape.
    pub shape: S,
    /// Orthogonal distance of each point in m, in the order given; + outside of round shapes and on the side of a
    /// plane's normal. For a line the distance itself, never negative.
    pub residuals: Vec<f64>,
    /// Form deviation in m about this shape: largest minus smallest residual; for a line the diameter of the
    /// enclosing cylinder about it.
    pub form: f64,
    /// Root mean square residual in m, divisor n.
    pub rms: f64,
    /// Local frame of the parameters: columns e1, e2, e3 in the frame of the points. e3 is the axis or normal; for
    /// a sphere the frame is that of the points.
    pub frame: Matrix3<f64>,
    /// `(JᵀJ)⁻¹`, p × p, for the parameters that [`Shape::PARAMETERS`] names, in that order, m and rad.
    pub cofactor: DMatrix<f64>,
}

impl<S: Shape> Fit<S> {
    /// Covariance of the parameters, p × p in m and rad, for points of standard uncertainty `point_uncertainty` (m).
    pub fn covariance(&self, point_uncertainty: f64) -> DMatrix<f64> {
        &self.cofactor * (point_uncertainty * point_uncertainty)
    }

    /// Standard uncertainty of the named parameter for points of standard uncertainty `point_uncertainty` (m);
    /// `None` if the shape has no such parameter.
    pub fn uncertainty(&self, parameter: &str, point_uncertainty: f64) -> Option<f64> {
        let index = S::PARAMETERS.iter().position(|name| *name == parameter)?;
        Some(point_uncertainty * self.cofactor[(index, index)].sqrt())
    }
}

/// Largest minus smallest and root mean square of residuals in m.
fn spread(residuals: &[f64]) -> (f64, f64) {
    let (low, high, squares) = residuals.iter().fold(
        (f64::INFINITY, f64::NEG_INFINITY, 0.0),
        |(low, high, squares), r| (r.min(low), r.max(high), r.mul_add(*r, squares)),
    );
    (high - low, (squares / residuals.len() as f64).sqrt())
}
