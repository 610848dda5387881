//! `drive.viscous_friction`: friction in proportion to the speed.
//!
//! f = coefficient·v.

use super::{Channel, Drive, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct ViscousFriction;

impl Effect for ViscousFriction {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.viscous_friction",
            name: "viscous friction of the drive",
            remedy: "declare the friction in the drive's feed-forward, or check the lubricant",
            parameters: &[("coefficient", "effort per (m/s or rad/s)", 1e4)],
            acts_on: acts_on(),
        }
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
