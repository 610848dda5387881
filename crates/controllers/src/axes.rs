//! How the joints of the machine model are called in the controller, and in which unit it counts them.

use serde::{Deserialize, Serialize};

/// Address letter of an axis in programs; in LinuxCNC its order is that of the controller's position reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
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
    /// All letters, in their order.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::A, Self::B, Self::C];

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

impl std::str::FromStr for Letter {
    type Err = NoLetter;

    fn from_str(text: &str) -> Result<Self, NoLetter> {
        Self::ALL
            .into_iter()
            .find(|letter| letter.to_string() == text)
            .ok_or_else(|| NoLetter(text.to_owned()))
    }
}

/// A text that is no letter of an axis.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is none of the axis letters X, Y, Z, A, B, C")]
pub struct NoLetter(String);

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
