//! `drive.payload`: mass and centre of mass at the flange that the robot description does not have.
//!
//! Ten inertial parameters of what is fixed to `probe_mount` (Atkeson, An and Hollerbach 1986), judged by the efforts of all joints
//! together.

use super::acts_on;
use crate::effect::{Definition, Effect};

pub(super) struct Payload;

impl Effect for Payload {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.payload",
            name: "a load at the flange that the description lacks",
            remedy: "declare the load at the flange in the robot description and in the controller: mass and centre of mass",
            parameters: &[
                ("mass", "kg", 10.0),
                ("x", "m", 0.3),
                ("y", "m", 0.3),
                ("z", "m", 0.3),
            ],
            acts_on: acts_on(),
        }
    }
}
