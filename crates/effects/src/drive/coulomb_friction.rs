//! `drive.coulomb_friction`: friction of constant size against the motion.
//!
//! f = force·sgn(v), the sign smoothed around standstill (Armstrong-Hélouvry).

use machine::Chain;

use super::{Channel, Drive, UNDECLARABLE, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

pub(super) struct CoulombFriction;

impl Effect for CoulombFriction {
    fn id(&self) -> &'static str {
        "drive.coulomb_friction"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "Coulomb friction of the drive".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "declare the friction in the drive's feed-forward, or look after lubrication and cover strips"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![Parameter::new("force", "effort", 1e3)]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        let column = || vec![vec![term("force", "effort", drive.sign.clone())]];
        let offered = drive.on(Channel::Effort, self.id(), column);
        offered.map(|effect| effect.signed(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn it_has_the_sign_of_the_speed() {
        let column = &columns(&CoulombFriction, Channel::Effort)[0];
        for (value, speed) in column.iter().zip(&signals().speed) {
            assert!(value.abs() <= 1.0 && value * speed >= 0.0);
        }
        assert!(column[0] > 0.99 && column[50] < -0.99);
    }
}
