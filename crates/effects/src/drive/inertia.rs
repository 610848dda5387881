//! `drive.inertia`: the mass or inertia that a drive moves is other than declared.
//!
//! f = excess·a.

use super::{Channel, Drive, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct Inertia;

impl Effect for Inertia {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.inertia",
            name: "inertia of the drive other than declared",
            remedy: "declare the load of the axis in the robot description and in the drive",
            parameters: &[("excess", "effort per (m/s^2 or rad/s^2)", 1e3)],
            acts_on: acts_on(),
        }
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        let unit = "effort per (m/s^2 or rad/s^2)";
        let column = || {
            vec![vec![term(
                "excess",
                unit,
                drive.signals.acceleration.clone(),
            )]]
        };
        drive.on(Channel::Effort, self.id(), column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn it_is_the_acceleration() {
        assert_eq!(
            columns(&Inertia, Channel::Effort)[0],
            signals().acceleration
        );
    }
}
