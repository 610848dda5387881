//! Closed-form inverse of a swivel-head machine XFYZBA: tool tip and tool axis to axis positions.
//!
//! Metres and radians, part frame = frame of the table. `docs/source_systems.md, E.4`: I = Ry(B) Rx(A) k, pivot
//! Q = P + L I, x = −Q_x, y = Q_y, z = Q_z. [`Chain::reach`](crate::Chain::reach) prescribes all of the orientation or none
//! of it; here the turn about the tool axis is left free. Travels are not checked.

use nalgebra::{Point3, Unit, Vector3};

/// Names of the axes in the order of [`SwivelHead::positions`].
pub const HEAD_AXES: [&str; 5] = ["X", "Y", "Z", "B", "A"];

/// A head whose axes B and A meet in one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwivelHead {
    /// L: distance from that point to the tool tip, m.
    pub pivot_length: f64,
}

impl SwivelHead {
    /// The tool tip in the probe mount, m.
    pub fn tip(&self) -> Point3<f64> {
        Point3::new(0.0, 0.0, -self.pivot_length)
    }

    /// Positions of X, Y, Z (m), B and A (rad, A within ±90°) for a tip at `point` and a tool axis along `axis`,
    /// which points from the tip to the spindle.
    pub fn positions(&self, point: &Point3<f64>, axis: &Unit<Vector3<f64>>) -> [f64; 5] {
        let pivot = point + axis.into_inner() * self.pivot_length;
        // Rounding may leave a unit vector's component beyond one.
        let a = -axis.y.clamp(-1.0, 1.0).asin();
        let b = axis.x.atan2(axis.z);
        [-pivot.x, pivot.y, pivot.z, b, a]
    }
}
