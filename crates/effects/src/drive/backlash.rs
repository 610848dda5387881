//! `drive.backlash`: lost motion between motor and load on reversal.
//!
//! The position lags its command by half the lost motion, on the side from which it approaches: δq = −½·b·sgn(q̇).

use super::{Channel, Drive, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct Backlash;

impl Effect for Backlash {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.backlash",
            name: "backlash of the drive",
            remedy: "adjust the preload of the drive train",
            parameters: &[("b", "m or rad", 2e-4)],
            acts_on: acts_on(),
        }
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        let column = || {
            let direction = drive.signals.direction.iter();
            let column = direction.map(|s| -0.5 * s).collect();
            vec![vec![term("b", "m or rad", column)]]
        };
        let offered = drive.on(Channel::Motion, self.id(), column);
        offered.map(|effect| effect.signed(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn half_of_it_stands_on_either_side() {
        let column = &columns(&Backlash, Channel::Motion)[0];
        assert_eq!(*column, vec![-0.5; signals().time.len()]);
    }
}
