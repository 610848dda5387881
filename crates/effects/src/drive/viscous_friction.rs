//! `drive.viscous_friction`: friction in proportion to the speed.
//!
//! f = coefficient·v.

use machine::Chain;

use super::{Channel, Drive, UNDECLARABLE, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

pub(super) struct ViscousFriction;

impl Effect for ViscousFriction {
    fn id(&self) -> &'static str {
        "drive.viscous_friction"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "viscous friction of the drive".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "declare the friction in the drive's feed-forward, or check the lubricant"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![Parameter::new(
            "coefficient",
            "effort per (m/s or rad/s)",
            1e4,
        )]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        let unit = "effort per (m/s or rad/s)";
        let column = || vec![vec![term("coefficient", unit, drive.signals.speed.clone())]];
        let offered = drive.on(Channel::Effort, self.id(), column);
        offered.map(|effect| effect.signed(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn it_is_the_speed() {
        assert_eq!(
            columns(&ViscousFriction, Channel::Effort)[0],
            signals().speed
        );
    }
}
