//! `drive.effort_gain`: the unit or the torque constant of the effort is other than declared.
//!
//! f = gain·τ, with τ the effort by the robot description.

use super::acts_on;
use crate::effect::{Definition, Effect};

pub(super) struct EffortGain;

impl Effect for EffortGain {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.effort_gain",
            name: "gain of the measured effort",
            remedy: "check the unit and the torque constant by which the driver converts currents to efforts",
            parameters: &[("gain", "1", 0.5)],
            acts_on: acts_on(),
        }
    }
}
