//! Places a part: best fit of small displacements to deviations along normals.
//!
//! Lengths in m, angles in rad. Equation of `docs/source_systems.md, B.3` in space: linear least squares,
//! since set-up errors are small. Points count equally. For a datum system see [`crate::datum`].

use nalgebra::{DMatrix, DVector, Matrix6, Vector3, Vector6};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Points that cannot be placed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum AlignmentError {
    /// Too few points.
    #[error("an alignment needs at least {needed} points, {given} given")]
    TooFewPoints {
        /// Smallest admissible number.
        needed: usize,
        /// Number given.
        given: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("pair {0} has a coordinate that is not a number")]
    NotFinite(usize),
    /// The points or normals leave `free` of the displacements undetermined.
    #[error("the points leave {free} displacements or rotations of the part undetermined")]
    Undetermined {
        /// How many.
        free: usize,
    },
}

/// Small displacement of a part that explains its deviations along the normals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SmallDisplacement {
    /// Shift of the origin, m.
    pub shift: Vector3<f64>,
    /// Rotation vector, rad.
    pub rotation: Vector3<f64>,
    /// Deviations less the displacement's, m: form.
    pub residuals: Vec<f64>,
    /// `(JᵀJ)⁻¹` of (shift, rotation), m and rad.
    pub cofactor: Matrix6<f64>,
}

/// Least squares of d_i = n_i·(shift + rotation × p_i) for `(point in m, unit normal, deviation in m)`, with only some of
/// the six displacements free: shifts along x, y and z, rotations about the axes through the origin. The others are 0, and
/// so are their rows and columns of the cofactor matrix.
///
/// # Errors
/// See [`AlignmentError`]: as many normals are needed as displacements are free, and they must oppose each of them; a
/// cylinder alone leaves two of six undetermined.
pub fn fit_displacement(
    touches: &[(Vector3<f64>, Vector3<f64>, f64)],
    free: &[bool; 6],
) -> Result<SmallDisplacement, AlignmentError> {
    let given = touches.len();
    let columns: Vec<usize> = (0..6).filter(|column| free[*column]).collect();
    let needed = columns.len();
    if given < needed || needed == 0 {
        return Err(AlignmentError::TooFewPoints {
            needed: needed.max(1),
            given,
        });
    }
    let finite = |v: &Vector3<f64>| v.iter().all(|c| c.is_finite());
    let sound =
        |(p, n, d): &(Vector3<f64>, Vector3<f64>, f64)| finite(p) && finite(n) && d.is_finite();
    if let Some(index) = touches.iter().position(|t| !sound(t)) {
        return Err(AlignmentError::NotFinite(index));
    }
    let count = given as f64;
    // A free body turns about its middle, which keeps rotations and shifts apart; one that is held turns about the origin.
    let centre = if needed == 6 {
        touches.iter().map(|t| t.0).sum::<Vector3<f64>>() / count
    } else {
        Vector3::zeros()
    };
    let squares: f64 = touches.iter().map(|t| (t.0 - centre).norm_squared()).sum();
    let size = (squares / count).sqrt().max(f64::MIN_POSITIVE);
    let design = DMatrix::from_fn(given, needed, |i, j| {
        let (p, n, _) = &touches[i];
        let moment = ((p - centre) / size).cross(n);
        let column = columns[j];
        if column < 3 {
            n[column]
        } else {
            moment[column - 3]
        }
    });
    let svd = design.clone().svd(true, true);
    let largest = svd.singular_values.max();
    let tolerance = 1e-9 * largest;
    let undetermined = svd
        .singular_values
        .iter()
        .filter(|s| **s <= tolerance)
        .count();
    let (0, Some(v_t)) = (undetermined, svd.v_t.as_ref()) else {
        return Err(AlignmentError::Undetermined {
            free: undetermined.max(1),
        });
    };
    let right = DVector::from_iterator(given, touches.iter().map(|t| t.2));
    let solution = svd
        .solve(&right, tolerance)
        .map_err(|_| AlignmentError::Undetermined { free: needed })?;
    let residuals = right - &design * &solution;
    let inverse = svd.singular_values.map(|s| 1.0 / (s * s));
    let scaled = v_t.transpose() * DMatrix::from_diagonal(&inverse) * v_t;
    // Rotation about the centre is rotation about the origin and a shift: shift₀ = shift + c × rotation.
    let mut back = Matrix6::identity();
    for axis in 0..3 {
        let mut unit = Vector3::zeros();
        unit[axis] = 1.0 / size;
        back.fixed_view_mut::<3, 1>(0, 3 + axis)
            .copy_from(&centre.cross(&unit));
        back[(3 + axis, 3 + axis)] = 1.0 / size;
    }
    let (mut all, mut cofactor) = (Vector6::zeros(), Matrix6::zeros());
    for (i, &row) in columns.iter().enumerate() {
        all[row] = solution[i];
        for (j, &column) in columns.iter().enumerate() {
            cofactor[(row, column)] = scaled[(i, j)];
        }
    }
    let moved = back * all;
    Ok(SmallDisplacement {
        shift: moved.fixed_rows::<3>(0).into(),
        rotation: moved.fixed_rows::<3>(3).into(),
        residuals: residuals.iter().copied().collect(),
        cofactor: back * cofactor * back.transpose(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    #[test]
    fn a_cylinder_leaves_two_displacements_undetermined() {
        let cylinder: Vec<_> = (0..20)
            .map(|i| {
                let n = Vector3::new(f64::from(i).cos(), f64::from(i).sin(), 0.0);
                (n * 0.01 + Vector3::z() * 0.001 * f64::from(i), n, 0.0)
            })
            .collect();
        assert_eq!(
            fit_displacement(&cylinder, &[true; 6]),
            Err(AlignmentError::Undetermined { free: 2 })
        );
    }

    #[test]
    fn a_small_displacement_of_a_block_is_recovered() {
        let mut rng = Pcg64::seed_from_u64(2);
        let (shift, rotation) = (
            Vector3::new(5e-6, -3e-6, 8e-6),
            Vector3::new(2e-5, -4e-5, 1e-5),
        );
        let touches: Vec<_> = (0..24)
            .map(|i| {
                let mut n = Vector3::zeros();
                n[i % 3] = if i % 2 == 0 { 1.0 } else { -1.0 };
                let p = Vector3::from_fn(|_, _| rng.random_range(0.1..0.2)) + n * 0.05;
                (p, n, n.dot(&(shift + rotation.cross(&p))))
            })
            .collect();
        let found = fit_displacement(&touches, &[true; 6]).unwrap();
        assert!((found.shift - shift).norm() < 1e-17 && (found.rotation - rotation).norm() < 1e-16);
        // The covariance against the definition.
        let design = DMatrix::from_fn(24, 6, |i, j| {
            let (p, n, _) = touches[i];
            if j < 3 { n[j] } else { p.cross(&n)[j - 3] }
        });
        let expected = (design.transpose() * &design).try_inverse().unwrap();
        for i in 0..6 {
            assert!((found.cofactor[(i, i)] / expected[(i, i)] - 1.0).abs() < 1e-8);
        }
    }

    /// A profile in a plane (B.3): two shifts and a turn are free, and found as if only they existed.
    #[test]
    fn displacements_that_are_held_stay_and_the_free_ones_are_those_of_the_plane() {
        let mut rng = Pcg64::seed_from_u64(3);
        let (dx, dy, dphi) = (2.3e-6, 8.3e-6, -4e-5);
        let touches: Vec<_> = (0..40)
            .map(|i| {
                let angle = f64::from(i) * 0.15;
                let n = Vector3::new(angle.cos(), angle.sin(), 0.0);
                let p = Vector3::new(0.05 * angle.cos() + 0.01, 0.03 * angle.sin(), 0.004);
                let moved = n.x * dx + n.y * dy + (p.x * n.y - p.y * n.x) * dphi;
                (p, n, moved + rng.random_range(-1e-7..1e-7))
            })
            .collect();
        let free = [true, true, false, false, false, true];
        let found = fit_displacement(&touches, &free).unwrap();
        let design = DMatrix::from_fn(40, 3, |i, j| {
            let (p, n, _) = touches[i];
            [n.x, n.y, p.x * n.y - p.y * n.x][j]
        });
        let right = DVector::from_iterator(40, touches.iter().map(|t| t.2));
        let inverse = (design.transpose() * &design).try_inverse().unwrap();
        let expected = &inverse * design.transpose() * right;
        let own = [found.shift.x, found.shift.y, found.rotation.z];
        for (j, own) in own.into_iter().enumerate() {
            assert!((own - expected[j]).abs() < 1e-10 * own.abs(), "{j}");
            let variance = found.cofactor[([0, 1, 5][j], [0, 1, 5][j])];
            assert!((variance / inverse[(j, j)] - 1.0).abs() < 1e-9);
        }
        let held = [found.shift.z, found.rotation.x, found.rotation.y];
        assert_eq!(held, [0.0; 3]);
        assert!((own_error(&found, [dx, dy, dphi])) < 1e-6);
        assert_eq!(
            fit_displacement(&touches, &[true; 6]),
            Err(AlignmentError::Undetermined { free: 3 })
        );
        assert_eq!(
            fit_displacement(&touches, &[false; 6]),
            Err(AlignmentError::TooFewPoints {
                needed: 1,
                given: 40
            })
        );
    }

    fn own_error(found: &SmallDisplacement, truth: [f64; 3]) -> f64 {
        let own = [found.shift.x, found.shift.y, found.rotation.z];
        let off = own
            .iter()
            .zip(truth)
            .map(|(own, truth)| (own - truth).abs());
        off.fold(0.0, f64::max)
    }
}
