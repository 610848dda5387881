//! Builds the frame of a datum system from its datums in order of precedence.
//!
//! Lengths in m. ISO 5459: the primary datum orients first, each further one only what is still free, and each locks the
//! translations its geometry can. The datums come already associated with their features (see [`crate::fit`]); a
//! secondary direction is projected across the primary one, as orientation constraints demand.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One datum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Datum {
    /// A plane: locks the translation along its normal.
    Plane {
        /// A point on it, m.
        point: Vector3<f64>,
        /// Normal, any length.
        normal: Vector3<f64>,
    },
    /// The axis of a cylinder or cone, or a median line: locks the translations across it.
    Axis {
        /// A point on it, m.
        point: Vector3<f64>,
        /// Direction, any length.
        direction: Vector3<f64>,
    },
    /// The centre of a sphere, or the apex of a cone: locks all translations.
    Point(
        /// The point, m.
        Vector3<f64>,
    ),
}

/// Datums that make no frame.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum DatumError {
    /// A coordinate is not finite or a direction is zero.
    #[error("datum {0} has no finite position or direction")]
    NotFinite(usize),
    /// The primary datum is a point.
    #[error("the primary datum is a point and gives no direction")]
    PrimaryPoint,
    /// No datum fixes the rotation about the primary direction.
    #[error("no datum fixes the rotation about the primary direction")]
    FreeRotation,
    /// Translations remain free.
    #[error("{0} translations remain free")]
    FreeTranslations(usize),
}

/// Sine of the angle under which two directions count as parallel.
const PARALLEL: f64 = 1e-6;

impl Datum {
    fn direction(&self) -> Option<Vector3<f64>> {
        match self {
            Self::Plane { normal, .. } => Some(normal.normalize()),
            Self::Axis { direction, .. } => Some(direction.normalize()),
            Self::Point(_) => None,
        }
    }

    fn point(&self) -> Vector3<f64> {
        match self {
            Self::Plane { point, .. } | Self::Axis { point, .. } | Self::Point(point) => *point,
        }
    }

    /// Directions along which it locks the origin.
    fn locks(&self) -> Vec<Vector3<f64>> {
        let all = [Vector3::x(), Vector3::y(), Vector3::z()];
        match self {
            Self::Plane { normal, .. } => vec![normal.normalize()],
            Self::Axis { direction, .. } => {
                let d = direction.normalize();
                all.iter().map(|e| e - d * d.dot(e)).collect()
            }
            Self::Point(_) => all.to_vec(),
        }
    }

    fn is_sound(&self) -> bool {
        let finite = |v: &Vector3<f64>| v.iter().all(|c| c.is_finite());
        let directed = match self {
            Self::Plane { normal: d, .. } | Self::Axis { direction: d, .. } => {
                finite(d) && d.norm() > 0.0
            }
            Self::Point(_) => true,
        };
        directed && finite(&self.point())
    }
}

/// Pose of the datum frame in the frame of the datums: z along the primary direction, x from the first later datum that
/// fixes a rotation (its direction, or the way to it), origin where the datums lock it.
///
/// # Errors
/// See [`DatumError`].
pub fn datum_frame(datums: &[Datum]) -> Result<Isometry3<f64>, DatumError> {
    if let Some(index) = datums.iter().position(|d| !d.is_sound()) {
        return Err(DatumError::NotFinite(index));
    }
    let primary = datums.first().ok_or(DatumError::PrimaryPoint)?;
    let z = primary.direction().ok_or(DatumError::PrimaryPoint)?;
    let across = |v: Vector3<f64>| v - z * z.dot(&v);
    let by_direction = datums[1..].iter().filter_map(Datum::direction).map(across);
    // Two holes, or a hole and a point, fix the rotation by the line between them.
    let located: Vec<Vector3<f64>> = datums
        .iter()
        .filter(|d| !matches!(d, Datum::Plane { .. }))
        .map(Datum::point)
        .collect();
    let by_position = located.windows(2).map(|pair| across(pair[1] - pair[0]));
    let size = located.iter().map(Vector3::amax).fold(1e-3, f64::max);
    let x = by_direction
        .filter(|v| v.norm() > PARALLEL)
        .chain(by_position.filter(|v| v.norm() > PARALLEL * size))
        .next()
        .ok_or(DatumError::FreeRotation)?
        .normalize();
    let mut origin = Vector3::zeros();
    let mut locked: Vec<Vector3<f64>> = Vec::with_capacity(3);
    for datum in datums {
        for normal in datum.locks() {
            // Only the part that no earlier datum has locked moves the origin.
            let free = locked.iter().fold(normal, |v, d| v - d * d.dot(&v));
            if free.norm() <= PARALLEL {
                continue;
            }
            let step = free.normalize();
            origin += step * (normal.dot(&(datum.point() - origin)) / normal.dot(&step));
            locked.push(step);
        }
    }
    if locked.len() < 3 {
        return Err(DatumError::FreeTranslations(3 - locked.len()));
    }
    let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Ok(Isometry3::from_parts(Translation3::from(origin), turn))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(point: [f64; 3], normal: [f64; 3]) -> Datum {
        Datum::Plane {
            point: point.into(),
            normal: normal.into(),
        }
    }
    fn axis(point: [f64; 3], direction: [f64; 3]) -> Datum {
        Datum::Axis {
            point: point.into(),
            direction: direction.into(),
        }
    }

    /// 3-2-1 on skewed faces: z stays with A, B turns about it, C only shifts; the origin lies on all three planes.
    #[test]
    fn three_planes_lock_in_order_of_precedence() {
        let (a, b, c) = ([0.001, 0.002, 1.0], [1.0, 0.01, 0.003], [0.02, 1.0, 0.0]);
        let points = [[0.1, 0.2, 0.05], [0.3, 0.0, 0.0], [0.0, -0.4, 0.1]];
        let datums = [
            plane(points[0], a),
            plane(points[1], b),
            plane(points[2], c),
        ];
        let frame = datum_frame(&datums).unwrap();
        let z = frame.rotation * Vector3::z();
        assert!((z - Vector3::from(a).normalize()).norm() < 1e-15);
        let x = frame.rotation * Vector3::x();
        assert!(x.dot(&z).abs() < 1e-15 && x.dot(&Vector3::from(b).normalize()) > 0.9999);
        for (point, normal) in points.iter().zip([a, b, c]) {
            let distance = (frame.translation.vector - Vector3::from(*point))
                .dot(&Vector3::from(normal).normalize());
            assert!(distance.abs() < 1e-15, "{distance:e}");
        }
    }

    #[test]
    fn a_face_and_two_holes_make_a_frame_at_the_first_hole() {
        let datums = [
            plane([0.0, 0.0, 0.02], [0.0, 0.0, 1.0]),
            axis([0.01, 0.03, 0.5], [0.0, 0.0, 1.0]),
            axis([0.01, 0.08, -0.5], [0.0, 0.0, 1.0]),
        ];
        let frame = datum_frame(&datums).unwrap();
        assert!((frame.translation.vector - Vector3::new(0.01, 0.03, 0.02)).norm() < 1e-15);
        assert!((frame.rotation * Vector3::x() - Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn a_shaft_a_shoulder_and_a_keyway_make_the_frame_of_a_turned_part() {
        let datums = [
            axis([0.0, 0.0, 0.0], [0.0, 0.0, 2.0]),
            plane([0.0, 0.0, 0.07], [0.0, 0.0, 1.0]),
            plane([0.01, 0.0, 0.0], [1.0, 1.0, 0.0]),
        ];
        let frame = datum_frame(&datums).unwrap();
        assert!((frame.translation.vector - Vector3::new(0.0, 0.0, 0.07)).norm() < 1e-15);
        let x = frame.rotation * Vector3::x();
        assert!((x - Vector3::new(1.0, 1.0, 0.0).normalize()).norm() < 1e-12);
    }

    #[test]
    fn incomplete_systems_say_what_is_missing() {
        let face = plane([0.0; 3], [0.0, 0.0, 1.0]);
        assert_eq!(datum_frame(&[face]), Err(DatumError::FreeRotation));
        let side = plane([0.0; 3], [1.0, 0.0, 0.0]);
        assert_eq!(
            datum_frame(&[face, side]),
            Err(DatumError::FreeTranslations(1))
        );
        assert_eq!(datum_frame(&[]), Err(DatumError::PrimaryPoint));
        assert_eq!(
            datum_frame(&[Datum::Point(Vector3::zeros())]),
            Err(DatumError::PrimaryPoint)
        );
        assert_eq!(
            datum_frame(&[plane([0.0; 3], [0.0; 3])]),
            Err(DatumError::NotFinite(0))
        );
    }
}
