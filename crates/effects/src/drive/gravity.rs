//! `drive.gravity`: the weight of an unbalanced rotary axis.
//!
//! f = s·sin q + c·cos q. On a linear axis it is a constant offset by another name.

use machine::Chain;

use super::{Channel, Drive, UNDECLARABLE, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

pub(super) struct Gravity;

impl Effect for Gravity {
    fn id(&self) -> &'static str {
        "drive.gravity"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "gravity load of the drive".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "balance the axis, or declare mass and centre of mass in the robot description"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![
            Parameter::new("sin", "effort", 1e3),
            Parameter::new("cos", "effort", 1e3),
        ]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
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
        let chain = crate::specimen::chain();
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
