//! `drive.inertia`: the mass or inertia that a drive moves is other than declared.
//!
//! f = excess·a.

use machine::Chain;

use super::{Channel, Drive, UNDECLARABLE, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

pub(super) struct Inertia;

impl Effect for Inertia {
    fn id(&self) -> &'static str {
        "drive.inertia"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "inertia of the drive other than declared".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "declare the load of the axis in the robot description and in the drive"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![Parameter::new(
            "excess",
            "effort per (m/s^2 or rad/s^2)",
            1e3,
        )]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
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
