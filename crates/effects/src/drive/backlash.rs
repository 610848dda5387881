//! `drive.backlash`: lost motion between motor and load on reversal.
//!
//! The position stands half the lost motion behind its command, on the side from which it comes: δq = −½·b·sgn(q̇).

use machine::Chain;

use super::{Channel, Drive, UNDECLARABLE, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

pub(super) struct Backlash;

impl Effect for Backlash {
    fn id(&self) -> &'static str {
        "drive.backlash"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "backlash of the drive".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "adjust the preload of the drive train"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![Parameter::new("b", "m or rad", 2e-4)]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
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
