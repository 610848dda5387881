//! `drive.coulomb_friction`: friction of constant size against the motion.
//!
//! f = force·sgn(v), the sign smoothed around standstill (Armstrong-Hélouvry).

use super::{Channel, Drive, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct CoulombFriction;

impl Effect for CoulombFriction {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.coulomb_friction",
            name: "Coulomb friction of the drive",
            remedy: "declare the friction in the drive's feed-forward, or check lubrication and cover strips",
            parameters: &[("force", "effort", 1e3)],
            acts_on: acts_on(),
        }
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
