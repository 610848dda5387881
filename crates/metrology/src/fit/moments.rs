//! Sums of the products of up to four coordinates of points: all that linear equations for an axis need.
//!
//! Turned into the frame of an axis they give the equations in a fixed number of operations, however many points there
//! are; so many directions can be tried. Dimensionless, of the centred and scaled points of [`super::cloud`].

use nalgebra::{Matrix3, Matrix5, Vector3, Vector5};

use super::Point;

/// `Σ1`, `Σp`, `Σppᵀ`, and `Σ p pᵀ` weighted with each coordinate and each product of two.
pub(super) struct Moments {
    count: f64,
    first: Vector3<f64>,
    second: Matrix3<f64>,
    third: [Matrix3<f64>; 3],
    /// Weights xx, yy, zz, xy, xz, yz.
    fourth: [Matrix3<f64>; 6],
}

/// The pairs of coordinates that weigh the fourth moments; those of two coordinates count twice.
const PAIRS: [(usize, usize, f64); 6] = [
    (0, 0, 1.0),
    (1, 1, 1.0),
    (2, 2, 1.0),
    (0, 1, 2.0),
    (0, 2, 2.0),
    (1, 2, 2.0),
];

impl Moments {
    pub(super) fn new(points: &[Point]) -> Self {
        let mut moments = Self {
            count: points.len() as f64,
            first: Vector3::zeros(),
            second: Matrix3::zeros(),
            third: [Matrix3::zeros(); 3],
            fourth: [Matrix3::zeros(); 6],
        };
        for p in points {
            let square = p * p.transpose();
            moments.first += p;
            moments.second += square;
            for (axis, sum) in moments.third.iter_mut().enumerate() {
                *sum += square * p[axis];
            }
            for ((a, b, _), sum) in PAIRS.into_iter().zip(&mut moments.fourth) {
                *sum += square * (p[a] * p[b]);
            }
        }
        moments
    }

    /// The normal equations of `x² + y² = s·(x, y, 1, z, z²)` for the coordinates along the columns of `frame`: matrix and
    /// right side.
    pub(super) fn equations(&self, frame: &Matrix3<f64>) -> (Matrix5<f64>, Vector5<f64>) {
        let axis: Vector3<f64> = frame.column(2).into();
        let sum = frame.tr_mul(&self.first);
        let square = frame.tr_mul(&(self.second * frame));
        let weighted: Matrix3<f64> = self.third.iter().zip(&axis).map(|(m, a)| m * *a).sum();
        // Σ z²·(x, y, z), and Σ |p|²·(x, y, z).
        let zz = frame.tr_mul(&(weighted * axis));
        let traces = Vector3::from_fn(|k, _| self.third[k].trace());
        let cubes = frame.tr_mul(&traces);
        let mut twice = Matrix3::zeros();
        for ((a, b, count), m) in PAIRS.into_iter().zip(&self.fourth) {
            twice += m * (count * axis[a] * axis[b]);
        }
        let z4 = axis.dot(&(twice * axis));
        #[rustfmt::skip]
        let normal = Matrix5::new(
            square[(0, 0)], square[(0, 1)], sum.x, square[(0, 2)], zz.x,
            square[(0, 1)], square[(1, 1)], sum.y, square[(1, 2)], zz.y,
            sum.x, sum.y, self.count, sum.z, square[(2, 2)],
            square[(0, 2)], square[(1, 2)], sum.z, square[(2, 2)], zz.z,
            zz.x, zz.y, square[(2, 2)], zz.z, z4,
        );
        let right = Vector5::new(
            cubes.x - zz.x,
            cubes.y - zz.y,
            square[(0, 0)] + square[(1, 1)],
            cubes.z - zz.z,
            twice.trace() - z4,
        );
        (normal, right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::frame_about;

    #[test]
    fn turned_sums_are_sums_of_turned_points() {
        let points: Vec<Point> = (0..20)
            .map(|i| f64::from(i).sin_cos())
            .map(|(s, c)| Point::new(s, 0.3 + c * s, c - 0.2 * s * s))
            .collect();
        let frame = frame_about(&Vector3::new(0.3, -0.8, 0.5).normalize());
        let (mut normal, mut right) = (Matrix5::zeros(), Vector5::zeros());
        for q in points.iter().map(|p| frame.tr_mul(p)) {
            let row = Vector5::new(q.x, q.y, 1.0, q.z, q.z * q.z);
            normal += row * row.transpose();
            right += row * (q.x * q.x + q.y * q.y);
        }
        let (turned, turned_right) = Moments::new(&points).equations(&frame);
        assert!((turned - normal).amax() < 1e-12, "{turned}{normal}");
        assert!((turned_right - right).amax() < 1e-12);
    }
}
