//! `drive.saturation`: a servo that follows its command with a limited acceleration.
//!
//! The servo plans its own way to the command: as fast as it can still stop there, accelerating by no more than a limit, rad/s² or
//! m/s². Slow motions do not tell it.

use super::acts_on;
use crate::effect::{Definition, Effect};

pub(super) struct Saturation;

impl Effect for Saturation {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.saturation",
            name: "limit of the acceleration reached",
            remedy: "command within the limit, or raise it in the servo",
            parameters: &[("acceleration", "rad/s² or m/s²", 100.0)],
            acts_on: acts_on(),
        }
    }
}
