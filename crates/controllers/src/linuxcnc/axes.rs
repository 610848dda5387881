//! How the joints of the machine model are called in the controller, and in which unit it counts them.

use serde::Deserialize;

/// Address letter of an axis in LinuxCNC's programs; its order is that of the controller's position reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
pub enum Letter {
    /// Linear, mm.
    X,
    /// Linear, mm.
    Y,
    /// Linear, mm.
    Z,
    /// Rotary about X, degrees.
    A,
    /// Rotary about Y, degrees.
    B,
    /// Rotary about Z, degrees.
    C,
}

impl Letter {
    /// Place in a position report and in the groups of numbered parameters.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Counted in degrees, not in mm.
    pub fn is_rotary(self) -> bool {
        self >= Self::A
    }

    /// From m or rad to mm or degrees.
    pub fn to_controller(self, value: f64) -> f64 {
        if self.is_rotary() {
            value.to_degrees()
        } else {
            value * 1e3
        }
    }

    /// From mm or degrees to m or rad.
    pub fn from_controller(self, value: f64) -> f64 {
        if self.is_rotary() {
            value.to_radians()
        } else {
            value * 1e-3
        }
    }
}

impl std::fmt::Display for Letter {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        std::fmt::Debug::fmt(self, formatter)
    }
}

/// One axis as the cell knows it and as the controller knows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Joint of the machine model.
    pub name: String,
    /// Letter in programs.
    pub letter: Letter,
    /// Number of the controller's joint, 0 to 5.
    pub joint: usize,
    /// m or rad; no program goes outside.
    pub limits: Option<[f64; 2]>,
}
