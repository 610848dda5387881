//! `drive.gravity`: the weight of an unbalanced rotary axis.
//!
//! f = s·sin q + c·cos q. On a linear axis it is a constant offset by another name.

use super::{Channel, Drive, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct Gravity;

impl Effect for Gravity {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.gravity",
            name: "gravity load of the drive",
            remedy: "balance the axis, or declare mass and centre of mass in the robot description",
            parameters: &[("sin", "effort", 1e3), ("cos", "effort", 1e3)],
            acts_on: acts_on(),
        }
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        if !drive.turns() {
            return None;
        }
        let column = |wave: fn(f64) -> f64| -> Vec<f64> {
            let position = drive.signals.position.iter();
            position.map(|&q| wave(q)).collect()
        };
        drive.on(Channel::Effort, self.id(), || {
            vec![vec![
                term("sin", "effort", column(f64::sin)),
                term("cos", "effort", column(f64::cos)),
            ]]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Signals;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn it_follows_the_angle_of_a_rotary_axis_only() {
        let chain = crate::test_session::chain();
        let slide = signals();
        assert!(
            Gravity
                .drive(&Drive::new(&chain, &slide, Channel::Effort), &[])
                .is_none()
        );
        let table = Signals {
            axis: "C".to_owned(),
            ..slide
        };
        let found = Gravity.drive(&Drive::new(&chain, &table, Channel::Effort), &[]);
        let shape = &found.expect("a rotary axis").shapes[0];
        assert!((shape[0].column[30] - table.position[30].sin()).abs() < 1e-15);
        assert_eq!(
            columns(&crate::drive::inertia::Inertia, Channel::Effort).len(),
            1
        );
    }
}
