//! Free-form profiles: what they deviate by, what is position and what is form, and how to cut them better.
//!
//! Lengths in m, angles in rad, plane coordinates. `docs/source_systems.md, B.1–B.4`. A deviation T_i is taken along
//! the outward normal n_i at the nominal point i, positive where material is left.

mod correction;
pub mod simulated;
mod spline;
mod split;

pub use correction::{
    Corrected, CorrectionError, CorrectionRules, Hindrance, Next, ProfileCorrection,
    ProfileJudgement, next_cut, segmented_path,
};
pub use spline::{Closest, Spline, SplineError, uniform_basis};
pub use split::{Split, split};

use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Summary of the deviations of a profile, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProfileDeviation {
    /// Mean of T.
    pub mean: f64,
    /// Smallest T.
    pub min: f64,
    /// Largest T.
    pub max: f64,
}

/// Deviations that cannot be judged.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum ProfileError {
    /// Fewer than the needed points.
    #[error("a profile needs at least {needed} points, {given} given")]
    TooFewPoints {
        /// Smallest admissible number.
        needed: usize,
        /// Number given.
        given: usize,
    },
    /// Points, normals and deviations differ in number.
    #[error(
        "{points} points, {normals} normals and {deviations} deviations do not belong together"
    )]
    Unequal {
        /// Number of points.
        points: usize,
        /// Number of normals.
        normals: usize,
        /// Number of deviations.
        deviations: usize,
    },
    /// A value is NaN or infinite.
    #[error("point {0} of the profile has a value that is not a number")]
    NotFinite(usize),
    /// The normals leave a displacement undetermined.
    #[error("the profile's normals do not determine its position")]
    Undetermined,
}

impl ProfileDeviation {
    /// Of at least one finite deviation (m).
    ///
    /// # Errors
    /// No deviation, or one that is not finite.
    pub fn of(deviations: &[f64]) -> Result<Self, ProfileError> {
        if deviations.is_empty() {
            return Err(ProfileError::TooFewPoints {
                needed: 1,
                given: 0,
            });
        }
        if let Some(index) = deviations.iter().position(|t| !t.is_finite()) {
            return Err(ProfileError::NotFinite(index));
        }
        Ok(Self {
            mean: deviations.iter().sum::<f64>() / deviations.len() as f64,
            min: deviations.iter().copied().fold(f64::INFINITY, f64::min),
            max: deviations.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }

    /// Profile height in m: max − min (B.2).
    pub fn height(&self) -> f64 {
        self.max - self.min
    }

    /// Form deviation in m: 2·max|T|, the zone symmetric about the nominal profile (B.2, ISO 1101).
    pub fn form(&self) -> f64 {
        2.0 * self.max.abs().max(self.min.abs())
    }
}

/// x_kor = x_nom − T n (B.1): points of the profile to command so that deviations `deviations` vanish.
///
/// # Errors
/// Numbers of points that differ.
pub fn corrected_points(
    points: &[Vector2<f64>],
    normals: &[Vector2<f64>],
    deviations: &[f64],
) -> Result<Vec<Vector2<f64>>, ProfileError> {
    check(points, normals, deviations, 1)?;
    Ok(points
        .iter()
        .zip(normals)
        .zip(deviations)
        .map(|((p, n), t)| p - n * *t)
        .collect())
}

/// Path of the centre of a cutter of `radius` (m) along `curve`, at equal arc lengths, on the left of travel.
///
/// # Errors
/// Fewer than two points, or a curve tighter than the cutter on its inner side (the path would cut into it).
pub fn tool_path(
    curve: &Spline,
    radius: f64,
    count: usize,
) -> Result<Vec<Vector2<f64>>, SplineError> {
    let parameters = curve.equally_spaced(count)?;
    parameters
        .iter()
        .map(|&u| {
            let curvature = curve.curvature(u);
            // Left of travel is the inner side where the curve bends left.
            if curvature * radius >= 1.0 {
                return Err(SplineError::Tight {
                    parameter: u,
                    radius: 1.0 / curvature,
                });
            }
            Ok(curve.point(u) + curve.normal(u) * radius)
        })
        .collect()
}

/// Position and orientation fitted to a profile's deviations, and the form that remains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProfileFit {
    /// dx, dy in m: displacement of the part.
    pub shift: Vector2<f64>,
    /// dφ in rad about the origin of the coordinates.
    pub rotation: f64,
    /// T less the fitted part, m: pure form.
    pub residuals: Vec<f64>,
    /// `(JᵀJ)⁻¹` of (dx, dy, dφ), m and rad.
    pub cofactor: Matrix3<f64>,
}

impl ProfileFit {
    /// Correlation coefficient of two of dx (0), dy (1), dφ (2).
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        self.cofactor[(a, b)] / (self.cofactor[(a, a)] * self.cofactor[(b, b)]).sqrt()
    }
}

/// B.3: the (dx, dy, dφ) that minimise Σ(T_i − [n_ix dx + n_iy dy + (x_i n_iy − y_i n_ix) dφ])².
///
/// # Errors
/// See [`ProfileError`]; a straight or circular profile does not determine its position.
pub fn fit_position(
    points: &[Vector2<f64>],
    normals: &[Vector2<f64>],
    deviations: &[f64],
) -> Result<ProfileFit, ProfileError> {
    check(points, normals, deviations, 3)?;
    let n = points.len() as f64;
    let centre = points.iter().sum::<Vector2<f64>>() / n;
    let size = (points
        .iter()
        .map(|p| (p - centre).norm_squared())
        .sum::<f64>()
        / n)
        .sqrt();
    // About the centre and scaled to the size; the columns are then of order one.
    let design = DMatrix::from_fn(points.len(), 3, |i, j| {
        let arm = (points[i] - centre) / size;
        [normals[i].x, normals[i].y, arm.perp(&normals[i])][j]
    });
    let qr = design.clone().qr();
    let r = qr.r();
    let pivots = r.diagonal().abs();
    if pivots.min().is_nan() || pivots.min() <= 1e-9 * pivots.max() {
        return Err(ProfileError::Undetermined);
    }
    let right = DVector::from_column_slice(deviations);
    let solution = r
        .solve_upper_triangular(&(qr.q().transpose() * &right))
        .ok_or(ProfileError::Undetermined)?;
    let inverse = r
        .solve_upper_triangular(&DMatrix::identity(3, 3))
        .ok_or(ProfileError::Undetermined)?;
    let residuals = right - design * &solution;
    let rotation = solution[2] / size;
    // A rotation about the centre is one about the origin and a shift.
    let back = Matrix3::new(
        1.0,
        0.0,
        centre.y / size,
        0.0,
        1.0,
        -centre.x / size,
        0.0,
        0.0,
        1.0 / size,
    );
    let inverse = Matrix3::from_fn(|i, j| inverse[(i, j)]);
    let shift = back * Vector3::new(solution[0], solution[1], solution[2]);
    Ok(ProfileFit {
        shift: shift.xy(),
        rotation,
        residuals: residuals.iter().copied().collect(),
        cofactor: back * inverse * inverse.transpose() * back.transpose(),
    })
}

fn check(
    points: &[Vector2<f64>],
    normals: &[Vector2<f64>],
    deviations: &[f64],
    needed: usize,
) -> Result<(), ProfileError> {
    let given = points.len();
    if normals.len() != given || deviations.len() != given {
        return Err(ProfileError::Unequal {
            points: given,
            normals: normals.len(),
            deviations: deviations.len(),
        });
    }
    if given < needed {
        return Err(ProfileError::TooFewPoints { needed, given });
    }
    let finite = |v: &Vector2<f64>| v.x.is_finite() && v.y.is_finite();
    let broken = (0..given)
        .find(|&i| !(finite(&points[i]) && finite(&normals[i]) && deviations[i].is_finite()));
    broken.map_or(Ok(()), |index| Err(ProfileError::NotFinite(index)))
}
