//! Numbers of the cell file in the units of the messages.

use nalgebra::{Unit, Vector3};
use probecell_msgs::geometry_msgs;

use super::error::PartError;
use crate::error::MAX_TURNS;

/// Largest length (mm), angle (deg) or feed (mm/min) that is taken: far beyond any machine.
const LARGEST: f64 = 1e9;

/// Refuses NaN and infinity, and what is so large that sums and squares of it would become so.
pub(super) fn finite(key: &str, values: &[f64]) -> Result<(), PartError> {
    if values.iter().all(|value| value.abs() <= LARGEST) {
        Ok(())
    } else {
        Err(PartError::Number(key.to_owned(), " within ±1e9"))
    }
}

/// Refuses angles (deg) of a rotary axis that are many turns away.
pub(super) fn turns(key: &str, degrees: &[f64]) -> Result<(), PartError> {
    let most = 360.0 * MAX_TURNS;
    match degrees.iter().find(|angle| !(angle.abs() <= most)) {
        None => Ok(()),
        Some(&degrees) => Err(PartError::Turns {
            key: key.to_owned(),
            degrees,
        }),
    }
}

/// A vector of length 1, where there is a direction.
pub(super) fn direction(vector: [f64; 3]) -> Option<Vector3<f64>> {
    let vector = Vector3::from(vector);
    let direction = Unit::try_new(vector, 1e-9)?.into_inner();
    vector.norm().is_finite().then_some(direction)
}

pub(super) fn metres(mm: [f64; 3]) -> Vector3<f64> {
    Vector3::from(mm) * 1e-3
}

pub(super) fn ros_point(v: Vector3<f64>) -> geometry_msgs::Point {
    geometry_msgs::Point {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

pub(super) fn ros_vector(v: Vector3<f64>) -> geometry_msgs::Vector3 {
    geometry_msgs::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}
