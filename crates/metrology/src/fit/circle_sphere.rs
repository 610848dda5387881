//! Least-squares circle (in its fitted plane) and sphere.
//!
//! Start: the linear algebraic fit `|p|² = 2c·p + k` (Kåsa 1976); then the orthogonal distances.

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector2, Vector3, Vector4};

use super::cloud::Cloud;
use super::plane::best_normal;
use super::refine::{Model, inverse, refine};
use super::{Circle, Fit, FitError, Point, Shape, Sphere, frame_about, spread};

/// Passes over the points before a fit is given up.
const LIMIT: usize = 500;

#[derive(Clone, Copy)]
pub(super) struct PlaneCircle {
    pub(super) center: Vector2<f64>,
    pub(super) radius: f64,
}

impl Model<3> for PlaneCircle {
    fn linearise(&self, p: &Point) -> (f64, Vector3<f64>) {
        let (x, y) = (p.x - self.center.x, p.y - self.center.y);
        let rho = (x * x + y * y).sqrt();
        let inv = if rho > 0.0 { 1.0 / rho } else { 0.0 };
        (rho - self.radius, Vector3::new(-x * inv, -y * inv, -1.0))
    }
    fn moved(&self, step: &Vector3<f64>) -> Option<Self> {
        let radius = self.radius + step.z;
        (radius > 0.0).then(|| Self {
            center: self.center + step.xy(),
            radius,
        })
    }
}

#[derive(Clone, Copy)]
pub(super) struct Ball {
    pub(super) center: Vector3<f64>,
    pub(super) radius: f64,
}

impl Model<4> for Ball {
    fn linearise(&self, p: &Point) -> (f64, Vector4<f64>) {
        let arm = p - self.center;
        let rho = arm.norm();
        let inv = if rho > 0.0 { -1.0 / rho } else { 0.0 };
        (
            rho - self.radius,
            Vector4::new(arm.x * inv, arm.y * inv, arm.z * inv, -1.0),
        )
    }
    fn moved(&self, step: &Vector4<f64>) -> Option<Self> {
        let radius = self.radius + step.w;
        (radius > 0.0).then(|| Self {
            center: self.center + step.xyz(),
            radius,
        })
    }
}

/// Solution of the D + 1 linear equations of `|q|² = 2c·q + k` in the first D coordinates: centre and radius.
pub(super) fn algebraic<const D: usize>(
    points: impl Iterator<Item = SVector<f64, D>>,
) -> Option<(SVector<f64, D>, f64)> {
    let mut moment = SMatrix::<f64, D, D>::zeros();
    let mut right = SVector::<f64, D>::zeros();
    let mut mean = SVector::<f64, D>::zeros();
    let mut mean_square = 0.0;
    let mut n = 0.0;
    for q in points {
        let square = q.norm_squared();
        moment += q * q.transpose();
        right += q * square;
        mean += q;
        mean_square += square;
        n += 1.0;
    }
    mean /= n;
    mean_square /= n;
    moment = moment / n - mean * mean.transpose();
    right = right / n - mean * mean_square;
    let center = moment.cholesky()?.solve(&right) * 0.5;
    let square = mean_square - 2.0 * center.dot(&mean) + center.norm_squared();
    (square > 0.0 && square.is_finite()).then(|| (center, square.sqrt()))
}

/// Best circle through at least three points (m): the plane first, then the circle of the points' projections.
///
/// The residuals are radial distances in the fitted plane; fit the plane by itself for the distances across it.
///
/// # Errors
/// Too few points, coordinates that are not finite, collinear points, or no finite best circle.
pub fn circle(points: &[Point]) -> Result<Fit<Circle>, FitError> {
    let cloud = Cloud::new::<Circle>(points, 3)?;
    cloud.refuse_collinear::<Circle>()?;
    let (normal, tilts) = best_normal(&cloud);
    let frame = frame_about(&normal);
    let flat: Vec<Point> = cloud.points.iter().map(|p| frame.tr_mul(p)).collect();
    let fail = FitError::NotConverged {
        shape: Circle::NAME,
        iterations: LIMIT,
    };
    let (center, radius) = algebraic(flat.iter().map(Point::xy)).ok_or_else(|| fail.clone())?;
    let minimum = refine(PlaneCircle { center, radius }, &flat, LIMIT).ok_or(fail)?;
    let best = minimum.model;
    let residuals: Vec<f64> = flat
        .iter()
        .map(|q| best.linearise(q).0 * cloud.scale)
        .collect();
    let (form, rms) = spread(&residuals);
    let mut cofactor = DMatrix::zeros(6, 6);
    let in_plane = inverse(&minimum.normal).ok_or(FitError::Degenerate {
        shape: Circle::NAME,
        reason: "their arc is too short",
    })?;
    cofactor.view_mut((0, 0), (3, 3)).copy_from(&in_plane);
    // The plane is known best at the centroid; at the centre its height also carries the tilts' uncertainty.
    let lever = best.center * cloud.scale;
    let carried = tilts * lever;
    cofactor[(3, 3)] = 1.0 / residuals.len() as f64 + lever.dot(&carried);
    for a in 0..2 {
        cofactor[(3, 4 + a)] = -carried[a];
        cofactor[(4 + a, 3)] = -carried[a];
    }
    cofactor.view_mut((4, 4), (2, 2)).copy_from(&tilts);
    Ok(Fit {
        shape: Circle {
            center: cloud.centroid + frame * best.center.push(0.0) * cloud.scale,
            normal,
            radius: best.radius * cloud.scale,
        },
        residuals,
        form,
        rms,
        frame,
        cofactor,
    })
}

/// Best sphere through at least four points (m) that are not in one plane.
///
/// # Errors
/// Too few points, coordinates that are not finite, coplanar points, or no finite best sphere.
pub fn sphere(points: &[Point]) -> Result<Fit<Sphere>, FitError> {
    let cloud = Cloud::new::<Sphere>(points, 4)?;
    cloud.refuse_coplanar::<Sphere>()?;
    let fail = FitError::NotConverged {
        shape: Sphere::NAME,
        iterations: LIMIT,
    };
    let (center, radius) = algebraic(cloud.points.iter().copied()).ok_or_else(|| fail.clone())?;
    let minimum = refine(Ball { center, radius }, &cloud.points, LIMIT).ok_or(fail)?;
    let best = minimum.model;
    let residuals: Vec<f64> = cloud
        .points
        .iter()
        .map(|p| best.linearise(p).0 * cloud.scale)
        .collect();
    let (form, rms) = spread(&residuals);
    let cofactor = inverse(&minimum.normal).ok_or(FitError::Degenerate {
        shape: Sphere::NAME,
        reason: "their cap is too small",
    })?;
    Ok(Fit {
        shape: Sphere {
            center: cloud.centroid + best.center * cloud.scale,
            radius: best.radius * cloud.scale,
        },
        residuals,
        form,
        rms,
        frame: Matrix3::identity(),
        cofactor: DMatrix::from_fn(4, 4, |a, b| cofactor[(a, b)]),
    })
}
