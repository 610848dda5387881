//! `drive.compliance`: the load side yields to the force that moves it.
//!
//! Motion of an axis: δq = −c·load, the measured effort or, without one, the acceleration of the command.
//! Touches of an arm: joints yield to the weight they carry. Each revolute axis of the tool branch turns by c·torque, the
//! torque of the weights beyond it by the masses of the robot description, gravity along −z of the foundation. Where it has
//! no masses, nobody knows a torque: the axis turns by c for each metre of the ball's lever about that axis, rad/m. Weights pull
//! downwards and joints yield: no parameter is negative. Arms only: slides of a machine tool do not carry their load so.

use machine::{Chain, JointKind, Side};
use nalgebra::{Isometry3, Point3, Vector3};

use super::{Channel, Drive, acts_on, signals::derivative, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Constants, Definition, Effect, Instance};
use crate::observation::{Column, Observations, Pose};
use crate::variant::{Parameter, Variant, is_arm};

pub(super) struct Compliance;

impl Effect for Compliance {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.compliance",
            name: "compliance of the drive",
            remedy: "declare the stiffness of the joints, or calibrate the arm under the load that it carries",
            parameters: &[],
            acts_on: acts_on(),
        }
    }

    fn parameters(&self, chain: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        let (unit, plausible) = if has_masses(chain) {
            ("rad/(N m)", 1e-3)
        } else {
            ("rad/m", 1e-1)
        };
        let of = |&axis: &usize| {
            let name = chain.axis(axis).name.clone();
            Parameter::new(name, unit, plausible)
        };
        turning(chain).iter().map(of).collect()
    }

    /// Touches show it too.
    fn undeclarable(&self) -> Option<&'static str> {
        None
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        self.on_machine(&rows.chain).into_iter().collect()
    }

    fn declared(&self, chain: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        self.on_machine(chain).into_iter().collect()
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        let signals = drive.signals;
        let column = || {
            // Without a measured effort the load of a rigid inertia stands for it.
            let (unit, load) = if signals.effort.is_empty() {
                let (time, piece) = (&signals.time, &signals.piece);
                ("s^2", derivative(time, piece, &signals.command_speed))
            } else {
                ("rad/(N m) or m/N", signals.effort.clone())
            };
            vec![vec![term("c", unit, load)]]
        };
        let offered = drive.on(Channel::Motion, self.id(), column);
        // The load side stays behind what drives it.
        offered.map(|effect| effect.signed(-1.0))
    }
}

impl Compliance {
    fn on_machine(&self, chain: &Chain) -> Option<Variant> {
        if !is_arm(chain) {
            return None;
        }
        let turning = turning(chain);
        let parameters = self.parameters(chain, &Instance::default());
        let variant = Variant::linear(self.id(), parameters, move |rows| {
            let of = |pose: &Pose| torques(&rows.chain, pose, &turning);
            let loads: Vec<Vec<f64>> = rows
                .rows
                .iter()
                .map(|row| row.pose.as_ref().map(of).unwrap_or_default())
                .collect();
            let column = |number| yielding(rows, turning[number], &loads, number);
            (0..turning.len()).map(column).collect()
        });
        Some(variant.nonnegative())
    }
}

/// Revolute axes that carry the probe.
fn turning(chain: &Chain) -> Vec<usize> {
    (0..chain.axes().len())
        .filter(|&axis| chain.axis(axis).kind == JointKind::Revolute)
        .filter(|&axis| chain.carries(chain.axes()[axis], Side::Tool))
        .collect()
}

/// What an axis does that yields to the torque `number` of every row.
fn yielding(rows: &Observations, axis: usize, loads: &[Vec<f64>], number: usize) -> Column {
    let mut column = rows.machine_column(false, |_, _| Vector3::zeros());
    for (index, (row, load)) in rows.rows.iter().zip(loads).enumerate() {
        if let (Some(pose), Some(load)) = (&row.pose, load.get(number)) {
            let shift = pose.sensitivity.axes[axis] * *load;
            column.signature[index] = -row.normal.dot(&shift);
            column.shifts[index] = shift;
        }
    }
    column
}

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.80665;

/// True where the robot description says what the links that carry the probe weigh.
fn has_masses(chain: &Chain) -> bool {
    let mut carrying = chain.branch(Side::Tool).iter();
    carrying.any(|&index| chain.joints()[index].mass > 0.0)
}

/// Torque of the weights beyond each turning axis about it, N m; without masses the horizontal lever of the ball, m.
fn torques(chain: &Chain, pose: &Pose, turning: &[usize]) -> Vec<f64> {
    let mut frame = Isometry3::identity();
    let mut axes: Vec<(usize, Vector3<f64>, Vector3<f64>)> = Vec::new();
    let mut weights: Vec<(f64, Vector3<f64>)> = Vec::new();
    for &index in chain.branch(Side::Tool) {
        let joint = &chain.joints()[index];
        frame *= joint.origin;
        let axis = chain.axes().iter().position(|&moving| moving == index);
        axes.push((
            index,
            frame.translation.vector,
            frame.rotation * joint.axis.into_inner(),
        ));
        frame *= joint.motion(axis.map_or(0.0, |axis| pose.positions[axis]));
        weights.push((
            joint.mass,
            (frame * Point3::from(joint.centre_of_mass)).coords,
        ));
    }
    if !has_masses(chain) {
        let up: Vector3<f64> = pose.sensitivity.foundation[2];
        let lever = |&axis: &usize| -pose.sensitivity.axes[axis].dot(&up);
        return turning.iter().map(lever).collect();
    }
    let about = |&axis: &usize| {
        let first = axes
            .iter()
            .position(|(index, _, _)| *index == chain.axes()[axis])
            .unwrap_or(0);
        let (_, origin, direction) = axes[first];
        let pull = |(mass, centre): &(f64, Vector3<f64>)| {
            -mass * GRAVITY * direction.cross(&(centre - origin)).z
        };
        weights[first..].iter().map(pull).sum()
    };
    turning.iter().map(about).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn a_drive_yields_to_its_effort() {
        assert_eq!(columns(&Compliance, Channel::Motion)[0], signals().effort);
    }

    #[test]
    fn only_an_arm_yields_to_its_weight() {
        let rows = crate::observe(&crate::test_session::session()).expect("rows");
        assert!(Compliance.offer(&rows).is_empty());
    }
}
