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
        let still = rows.rows.iter().all(|row| row.feed == 0.0);
        let under_masses = self.under_masses(&rows.chain).filter(|_| still);
        (self.on_machine(&rows.chain).into_iter().chain(under_masses)).collect()
    }

    fn declared(&self, chain: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        let under_masses = self.under_masses(chain);
        (self.on_machine(chain).into_iter().chain(under_masses)).collect()
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
    /// Axes that yield to the torque of the declared weights.
    fn on_machine(&self, chain: &Chain) -> Option<Variant> {
        let turning = turning(chain);
        let parameters = self.parameters(chain, &Instance::default());
        let of = turning.clone();
        let variant = self.yielding(chain, parameters, turning, move |chain, pose| {
            torques(chain, pose, &of)
        })?;
        Some(variant.nonnegative())
    }

    /// Masses that nobody declares: one at each turning axis beyond, and one at the ball. Each axis turns by its compliance
    /// times the torque of each.
    fn under_masses(&self, chain: &Chain) -> Option<Variant> {
        let turning = turning(chain);
        let name = |axis: usize| chain.axis(axis).name.as_str();
        let pairs: Vec<(usize, Option<usize>)> = (0..turning.len())
            .flat_map(|own| {
                let beyond = turning[own + 1..].iter().copied().map(Some).chain([None]);
                let own = turning[own];
                beyond.map(move |other| (own, other))
            })
            .collect();
        let parameters = pairs.iter().map(|&(own, other)| {
            let name = format!("{} under {}", name(own), other.map_or("tool", name));
            Parameter::new(name, "kg rad/(N m)", 1e-4)
        });
        let parameters = parameters.collect();
        let axes = pairs.iter().map(|&(own, _)| own).collect();
        self.yielding(chain, parameters, axes, move |chain, pose| {
            unit_torques(chain, pose, &pairs)
        })
    }

    /// An arm whose axes yield, each to one of the torques (N m, or their like) of a pose; `None` for another machine.
    fn yielding(
        &self,
        chain: &Chain,
        parameters: Vec<Parameter>,
        axes: Vec<usize>,
        torques: impl Fn(&Chain, &Pose) -> Vec<f64> + Send + Sync + 'static,
    ) -> Option<Variant> {
        if !is_arm(chain) {
            return None;
        }
        Some(Variant::linear(self.id(), parameters, move |rows| {
            let of = |pose: &Pose| torques(&rows.chain, pose);
            let loads: Vec<Vec<f64>> = rows
                .rows
                .iter()
                .map(|row| row.pose.as_ref().map(of).unwrap_or_default())
                .collect();
            let columns = axes.iter().enumerate();
            columns
                .map(|(number, &axis)| yielding(rows, axis, &loads, number))
                .collect()
        }))
    }
}

/// A joint of the branch that carries the probe, in the frame of the foundation.
struct Carrying {
    /// Index in [`Chain::joints`].
    joint: usize,
    /// Where its axis is, m, and in which direction.
    origin: Vector3<f64>,
    direction: Vector3<f64>,
    /// The frame behind its motion.
    frame: Isometry3<f64>,
}

/// All joints that carry the probe, from the foundation outwards.
fn carrying(chain: &Chain, pose: &Pose) -> Vec<Carrying> {
    let mut frame = Isometry3::identity();
    let one = |&index: &usize| {
        let joint = &chain.joints()[index];
        frame *= joint.origin;
        let (origin, direction) = (
            frame.translation.vector,
            frame.rotation * joint.axis.into_inner(),
        );
        let axis = chain.axes().iter().position(|&moving| moving == index);
        frame *= joint.motion(axis.map_or(0.0, |axis| pose.positions[axis]));
        Carrying {
            joint: index,
            origin,
            direction,
            frame,
        }
    };
    chain.branch(Side::Tool).iter().map(one).collect()
}

/// What each axis moves the ball sideways by, seen from above, m/rad: the lever of a weight at the ball.
fn lever(pose: &Pose, axis: usize) -> f64 {
    -pose.sensitivity.axes[axis].dot(&pose.sensitivity.foundation[2])
}

/// Torque about the first axis of some pairs of 1 kg at the other one, or at the ball, N m.
fn unit_torques(chain: &Chain, pose: &Pose, pairs: &[(usize, Option<usize>)]) -> Vec<f64> {
    let all = carrying(chain, pose);
    let at = |axis: usize| all.iter().find(|one| one.joint == chain.axes()[axis]);
    let torque = |&(own, other): &(usize, Option<usize>)| match other {
        None => GRAVITY * lever(pose, own),
        Some(other) => at(own).zip(at(other)).map_or(0.0, |(own, other)| {
            -GRAVITY * own.direction.cross(&(other.origin - own.origin)).z
        }),
    };
    pairs.iter().map(torque).collect()
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
    if !has_masses(chain) {
        return turning.iter().map(|&axis| lever(pose, axis)).collect();
    }
    let all = carrying(chain, pose);
    let about = |&axis: &usize| {
        let is_own = |one: &Carrying| one.joint == chain.axes()[axis];
        let first = all.iter().position(is_own).unwrap_or(0);
        let own = &all[first];
        let pull = |one: &Carrying| {
            let joint = &chain.joints()[one.joint];
            let centre = (one.frame * Point3::from(joint.centre_of_mass)).coords;
            -joint.mass * GRAVITY * own.direction.cross(&(centre - own.origin)).z
        };
        all[first..].iter().map(pull).sum()
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
