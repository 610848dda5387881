//! Points moved to their centroid and scaled to unit size, so that every fit works with numbers near one.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::{FitError, Point, Shape};

/// Relative size of the second or third principal extent under which points count as collinear or coplanar: what
/// the rounding of coordinates in 64 bits leaves of an exact line.
const FLAT: f64 = 1e-11;

/// Checked, centred and scaled points.
pub(super) struct Cloud {
    /// `(pᵢ − centroid)/scale`, dimensionless, rms distance 1.
    pub(super) points: Vec<Point>,
    /// Centroid in m.
    pub(super) centroid: Point,
    /// Root mean square distance from the centroid in m.
    pub(super) scale: f64,
    /// Principal axes of the points, columns by decreasing extent, right-handed.
    pub(super) principal: Matrix3<f64>,
}

impl Cloud {
    pub(super) fn new<S: Shape>(points: &[Point], needed: usize) -> Result<Self, FitError> {
        if let Some(index) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(FitError::NotFinite { index });
        }
        if points.len() < needed {
            return Err(FitError::TooFewPoints {
                shape: S::NAME,
                needed,
                given: points.len(),
            });
        }
        let n = points.len() as f64;
        let near = points.iter().sum::<Point>() / n;
        // The second sum removes what rounding left in the first when the points are far from the origin.
        let centroid = near + points.iter().map(|p| p - near).sum::<Point>() / n;
        let mean_square = points
            .iter()
            .map(|p| (p - centroid).norm_squared())
            .sum::<f64>()
            / n;
        let scale = mean_square.sqrt();
        let largest = centroid.amax().max(f64::MIN_POSITIVE);
        if !scale.is_finite() || scale <= 8.0 * f64::EPSILON * largest {
            return Err(FitError::Degenerate {
                shape: S::NAME,
                reason: "they coincide",
            });
        }
        let points: Vec<Point> = points.iter().map(|p| (p - centroid) / scale).collect();
        let scatter = points
            .iter()
            .map(|p| p * p.transpose())
            .sum::<Matrix3<f64>>()
            / n;
        let eigen = SymmetricEigen::new(scatter);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let e1: Vector3<f64> = eigen.eigenvectors.column(order[0]).into();
        let e2: Vector3<f64> = eigen.eigenvectors.column(order[1]).into();
        Ok(Self {
            points,
            centroid,
            scale,
            principal: Matrix3::from_columns(&[e1, e2, e1.cross(&e2)]),
        })
    }

    /// Refuses points on one straight line.
    pub(super) fn refuse_collinear<S: Shape>(&self) -> Result<(), FitError> {
        if self.thickness(1) > FLAT * self.noise() {
            return Ok(());
        }
        Err(FitError::Degenerate {
            shape: S::NAME,
            reason: "they lie on a straight line",
        })
    }

    /// Refuses points in one plane.
    pub(super) fn refuse_coplanar<S: Shape>(&self) -> Result<(), FitError> {
        self.refuse_collinear::<S>()?;
        if self.thickness(2) > FLAT * self.noise() {
            return Ok(());
        }
        Err(FitError::Degenerate {
            shape: S::NAME,
            reason: "they lie in one plane",
        })
    }

    /// Root mean square along a principal axis (0 longest, 2 shortest), summed anew: the eigenvalue knows it only to
    /// the square root of the rounding.
    fn thickness(&self, axis: usize) -> f64 {
        let rest: f64 = self
            .points
            .iter()
            .map(|p| {
                (axis..3)
                    .map(|k| p.dot(&self.principal.column(k)).powi(2))
                    .sum::<f64>()
            })
            .sum();
        (rest / self.points.len() as f64).sqrt()
    }

    /// How far the coordinates' own rounding reaches, relative to that of centred points.
    fn noise(&self) -> f64 {
        1.0_f64.max(1e-4 * self.centroid.amax() / self.scale)
    }
}

/// A right-handed frame with `axis` (unit) as third column.
pub(super) fn frame_about(axis: &Vector3<f64>) -> Matrix3<f64> {
    let mut side = Vector3::zeros();
    side[axis.iamin()] = 1.0;
    let e1 = (side - axis * axis.dot(&side)).normalize();
    Matrix3::from_columns(&[e1, axis.cross(&e1), *axis])
}

/// True if the component of largest magnitude is positive: the sign a direction without a sense is reported with.
pub(super) fn is_canonical(direction: &Vector3<f64>) -> bool {
    direction[direction.iamax()] > 0.0
}
