//! Least-squares plane: principal axes of the points, then one Gauss–Newton polish.
//!
//! The best plane passes through the centroid (Pearson 1901). The eigenvector alone is exact only to the
//! rounding of the squared extents; the polish works on the distances themselves.

use nalgebra::{DMatrix, Matrix2, Matrix3, Vector2, Vector3};

use super::cloud::{Cloud, frame_about, is_canonical};
use super::{Fit, FitError, Plane, Point, spread};

/// Best plane through at least three points (m) that are not on one line.
///
/// # Errors
/// Too few points, coordinates that are not finite, coincident or collinear points.
pub fn plane(points: &[Point]) -> Result<Fit<Plane>, FitError> {
    let cloud = Cloud::new::<Plane>(points, 3)?;
    cloud.refuse_collinear::<Plane>()?;
    let (normal, tilts) = best_normal(&cloud);
    let residuals: Vec<f64> = cloud
        .points
        .iter()
        .map(|p| p.dot(&normal) * cloud.scale)
        .collect();
    let (form, rms) = spread(&residuals);
    let mut cofactor = DMatrix::zeros(3, 3);
    cofactor[(0, 0)] = 1.0 / residuals.len() as f64;
    cofactor.view_mut((1, 1), (2, 2)).copy_from(&tilts);
    Ok(Fit {
        shape: Plane {
            point: cloud.centroid,
            normal,
        },
        residuals,
        form,
        rms,
        frame: frame_about(&normal),
        cofactor,
    })
}

/// Unit normal of the best plane, and the cofactor of its tilts towards e1, e2 of [`frame_about`] it, 1/m².
pub(super) fn best_normal(cloud: &Cloud) -> (Vector3<f64>, Matrix2<f64>) {
    let mut normal: Vector3<f64> = cloud.principal.column(2).into();
    let mut frame = cloud.principal;
    for _ in 0..3 {
        let (normal_matrix, gradient) = tilt_sums(cloud, &frame);
        let Some(tilt) = normal_matrix.cholesky().map(|c| c.solve(&gradient)) else {
            break;
        };
        // Residual z + a1·x + a2·y is smallest at a = −N⁻¹g, which tilts the normal by the same.
        normal = (frame * Vector3::new(-tilt.x, -tilt.y, 1.0)).normalize();
        frame = frame_about(&normal);
    }
    if !is_canonical(&normal) {
        normal = -normal;
    }
    let (normal_matrix, _) = tilt_sums(cloud, &frame_about(&normal));
    let cofactor = normal_matrix.try_inverse().unwrap_or_else(Matrix2::zeros) / cloud.scale.powi(2);
    (normal, cofactor)
}

fn tilt_sums(cloud: &Cloud, frame: &Matrix3<f64>) -> (Matrix2<f64>, Vector2<f64>) {
    let mut normal_matrix = Matrix2::zeros();
    let mut gradient = Vector2::zeros();
    for p in &cloud.points {
        let q = frame.tr_mul(p);
        let xy = Vector2::new(q.x, q.y);
        normal_matrix += xy * xy.transpose();
        gradient += xy * q.z;
    }
    (normal_matrix, gradient)
}
