//! `drive.friction_offset`: a constant part of the effort, such as friction that differs between the directions.
//!
//! f = offset. On a linear axis the weight of the load is the same to first order.

use super::{Channel, Drive, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct FrictionOffset;

impl Effect for FrictionOffset {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.friction_offset",
            name: "constant offset of the drive's effort",
            remedy: "balance the weight of the axis, or set the offset in the drive",
            parameters: &[("offset", "effort", 1e3)],
            acts_on: acts_on(),
        }
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        let column = || {
            vec![vec![term(
                "offset",
                "effort",
                vec![1.0; drive.signals.speed.len()],
            )]]
        };
        let effect = drive.on(Channel::Effort, self.id(), column)?;
        Some(if drive.turns() {
            effect
        } else {
            effect.same_as("drive.gravity".to_owned())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn it_is_constant() {
        let column = &columns(&FrictionOffset, Channel::Effort)[0];
        assert_eq!(*column, vec![1.0; signals().speed.len()]);
    }
}
