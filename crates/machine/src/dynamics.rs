//! Inverse dynamics of the whole tree of a robot description: the effort that a motion takes, and how it depends on the
//! masses.
//!
//! Recursive Newton–Euler in body frames (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 5). Efforts are linear
//! in ten inertial parameters of each body (Atkeson, An and Hollerbach 1986): mass m (kg), first moment m·c (kg m) and the
//! inertia about the origin of the body's frame (kg m²), in the order of [`Inertial::parameters`]. Links
//! behind fixed joints belong to the body that carries them; a joint that is not driven (a gripper) is held where it is.
//! Gravity points along −z of `foundation`, whose own motion is none. rad, m, s, N m (N for a linear joint).

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

use crate::{
    Inertial, JointKind, PARAMETERS,
    chain::{FOUNDATION, PROBE_MOUNT, joint},
    description::ChainError,
    gravity::STANDARD_GRAVITY,
    urdf::Robot,
};

/// Frames that differ by no more are the same, m and rad.
const NEAR: f64 = 1e-9;

/// A wrench: force, and moment about the origin of a frame.
type Wrench = (Vector3<f64>, Vector3<f64>);

/// What one driven joint moves.
#[derive(Debug, Clone)]
pub struct Body {
    /// Name of the joint.
    pub joint: String,
    /// Name of the link behind it.
    pub link: String,
    /// What the joint lets move.
    pub kind: JointKind,
    /// Its inertial parameters by the description, links behind fixed joints included.
    pub parameters: [f64; PARAMETERS],
    /// Declared viscous friction, N m s/rad or N s/m.
    pub damping: f64,
    /// Declared dry friction, N m or N.
    pub friction: f64,
    /// Distance of what hangs on it, m: to the next joint or to twice its centre of mass, whichever is farther.
    pub reach: f64,
    /// Index of the body that carries it; `None` on the foundation.
    parent: Option<usize>,
    origin: Isometry3<f64>,
    axis: Unit<Vector3<f64>>,
}

/// A tree of bodies, each behind those that carry it.
#[derive(Debug, Clone)]
pub struct Dynamics {
    bodies: Vec<Body>,
    /// The body that carries `probe_mount`, and the frame of that link in it.
    mount: Option<(usize, Isometry3<f64>)>,
    /// The link whose frame is that of `probe_mount`.
    mount_link: Option<String>,
}

/// Motion of a frame in its own coordinates: angular speed and acceleration, and the acceleration of its origin less gravity.
#[derive(Clone, Copy)]
struct Motion {
    spin: Vector3<f64>,
    turning: Vector3<f64>,
    acceleration: Vector3<f64>,
}

impl Motion {
    /// Of a frame that is fixed in this one.
    fn at(&self, frame: &Isometry3<f64>) -> Self {
        let back = frame.rotation.inverse();
        let lever = frame.translation.vector;
        let acceleration = self.acceleration
            + self.turning.cross(&lever)
            + self.spin.cross(&self.spin.cross(&lever));
        Self {
            spin: back * self.spin,
            turning: back * self.turning,
            acceleration: back * acceleration,
        }
    }

    /// Wrenches that the inertial parameters need, each at one.
    fn wrenches(&self) -> [Wrench; PARAMETERS] {
        let Self {
            spin,
            turning,
            acceleration,
        } = *self;
        let zero = Vector3::zeros();
        let mut columns = [(zero, zero); PARAMETERS];
        columns[0] = (acceleration, zero);
        for axis in 0..3 {
            let unit = Vector3::ith(axis, 1.0);
            let force = turning.cross(&unit) + spin.cross(&spin.cross(&unit));
            columns[1 + axis] = (force, unit.cross(&acceleration));
        }
        for (column, (row, other)) in [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)]
            .into_iter()
            .enumerate()
        {
            let mut inertia = Matrix3::zeros();
            inertia[(row, other)] = 1.0;
            inertia[(other, row)] = 1.0;
            let moment = inertia * turning + spin.cross(&(inertia * spin));
            columns[4 + column] = (zero, moment);
        }
        columns
    }
}

impl Dynamics {
    /// Reads a URDF text. Joints named in `driven` move; all others are held at `held` (rad, m), 0 where that says nothing.
    ///
    /// # Errors
    /// [`ChainError`] names what keeps the text from being a robot.
    pub fn from_urdf(
        text: &str,
        driven: &[String],
        held: &BTreeMap<String, f64>,
    ) -> Result<Self, ChainError> {
        let robot = Robot::read(text)?;
        let links: BTreeMap<&str, _> = (robot.links.iter())
            .map(|link| (link.name.as_str(), link))
            .collect();
        let mut of_parent: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (index, raw) in robot.joints.iter().enumerate() {
            of_parent.entry(&raw.parent).or_default().push(index);
        }
        let mut tree = Self {
            bodies: Vec::new(),
            mount: None,
            mount_link: None,
        };
        // Links to visit, with the body that carries them and their frame in it.
        let mut waiting: Vec<(&str, Option<usize>, Isometry3<f64>)> =
            vec![(FOUNDATION, None, Isometry3::identity())];
        let mut visited = 0;
        while let Some((name, carrier, frame)) = waiting.pop() {
            visited += 1;
            if visited > robot.links.len() {
                return Err(ChainError::Loop(name.to_owned()));
            }
            if let (PROBE_MOUNT, Some(body)) = (name, carrier) {
                tree.mount = Some((body, frame));
            }
            for &index in of_parent.get(name).into_iter().flatten() {
                let mut raw = robot.joints[index].clone();
                let child =
                    links
                        .get(raw.child.as_str())
                        .ok_or_else(|| ChainError::UnknownLink {
                            joint: raw.name.clone(),
                            link: raw.child.clone(),
                        })?;
                let moves = driven.contains(&raw.name);
                if !moves {
                    // Whatever it is, it is held.
                    raw.mimics = false;
                    if matches!(raw.kind.as_str(), "floating" | "planar") {
                        "fixed".clone_into(&mut raw.kind);
                    }
                }
                let read = joint(&raw, child)?;
                if child.name == PROBE_MOUNT && !moves && is_identity(&read.origin) {
                    tree.mount_link = Some(raw.parent.clone());
                }
                let (body, frame) = if moves && read.moves() {
                    tree.bodies.push(Body {
                        joint: raw.name.clone(),
                        link: raw.child.clone(),
                        kind: read.kind,
                        parameters: [0.0; PARAMETERS],
                        damping: raw.friction[0],
                        friction: raw.friction[1],
                        reach: 0.0,
                        parent: carrier,
                        origin: frame * read.origin,
                        axis: read.axis,
                    });
                    if let Some(carrier) = carrier {
                        let lever = (frame * read.origin).translation.vector.norm();
                        let reach = &mut tree.bodies[carrier].reach;
                        *reach = reach.max(lever);
                    }
                    (Some(tree.bodies.len() - 1), Isometry3::identity())
                } else {
                    let at = held.get(&raw.name).copied().unwrap_or(0.0);
                    (carrier, frame * read.origin * read.motion(at))
                };
                if let Some(body) = body {
                    let centre = frame * nalgebra::Point3::from(read.centre_of_mass);
                    let turn = frame.rotation.to_rotation_matrix();
                    let inertia = turn * read.inertia * turn.transpose();
                    let own = Inertial {
                        mass: read.mass,
                        centre: centre.coords,
                        inertia,
                    };
                    let own = own.parameters();
                    let carrier = &mut tree.bodies[body];
                    for (sum, own) in carrier.parameters.iter_mut().zip(own) {
                        *sum += own;
                    }
                }
                waiting.push((&child.name, body, frame));
            }
        }
        for body in &mut tree.bodies {
            let [mass, x, y, z, ..] = body.parameters;
            if mass > 0.0 {
                let centre = Vector3::new(x, y, z).norm() / mass;
                body.reach = body.reach.max(2.0 * centre);
            }
        }
        Ok(tree)
    }

    /// The bodies; positions, speeds, accelerations and efforts have their order.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// True where a link carries `probe_mount`, so that a load has a place.
    pub fn has_mount(&self) -> bool {
        self.mount.is_some()
    }

    /// The link to which `probe_mount` is fixed without an offset.
    pub fn mount_link(&self) -> Option<&str> {
        self.mount_link.as_deref()
    }

    /// Height of `probe_mount` in the foundation (m), and by how much each joint lifts it (m/rad, or 1); `None` where no body
    /// carries it.
    pub fn mount_height(&self, positions: &[f64]) -> Option<(f64, Vec<f64>)> {
        let (body, mount) = self.mount?;
        let still = vec![0.0; positions.len()];
        let (frames, _) = self.motions(positions, &still, &still);
        let (mut frame, mut at) = (mount, Some(body));
        while let Some(index) = at {
            frame = frames[index] * frame;
            at = self.bodies[index].parent;
        }
        // What holds a mass of 1 kg there lifts it.
        let held = self.load_regressor(positions, &still, &still);
        let lifts = held.iter().map(|row| row[0] / STANDARD_GRAVITY);
        Some((frame.translation.z, lifts.collect()))
    }

    /// Efforts per unit of each inertial parameter of each body: for each joint a row of [`PARAMETERS`] values per body.
    pub fn regressor(
        &self,
        positions: &[f64],
        speeds: &[f64],
        accelerations: &[f64],
    ) -> Vec<Vec<f64>> {
        let (frames, motions) = self.motions(positions, speeds, accelerations);
        let count = self.bodies.len();
        let mut rows = vec![vec![0.0; PARAMETERS * count]; count];
        for (body, motion) in motions.iter().enumerate() {
            let first = PARAMETERS * body;
            self.project(&frames, body, motion.wrenches(), |joint, column, effort| {
                rows[joint][first + column] = effort;
            });
        }
        rows
    }

    /// The same of what is fixed to `probe_mount`, in the frame of that link: for each joint a row of [`PARAMETERS`] values;
    /// zeros where no body carries it.
    pub fn load_regressor(
        &self,
        positions: &[f64],
        speeds: &[f64],
        accelerations: &[f64],
    ) -> Vec<[f64; PARAMETERS]> {
        let mut rows = vec![[0.0; PARAMETERS]; self.bodies.len()];
        let Some((body, mount)) = &self.mount else {
            return rows;
        };
        let (frames, motions) = self.motions(positions, speeds, accelerations);
        let columns = motions[*body].at(mount).wrenches();
        let columns = columns.map(|wrench| carried(mount, wrench));
        self.project(&frames, *body, columns, |joint, column, effort| {
            rows[joint][column] = effort;
        });
        rows
    }

    /// Efforts by the description: N m, N for a linear joint.
    pub fn efforts(&self, positions: &[f64], speeds: &[f64], accelerations: &[f64]) -> Vec<f64> {
        let rows = self.regressor(positions, speeds, accelerations);
        rows.iter().map(|row| self.nominal(row)).collect()
    }

    /// A row of [`Self::regressor`] at the parameters of the description.
    pub fn nominal(&self, row: &[f64]) -> f64 {
        let bodies = row.chunks(PARAMETERS).zip(&self.bodies);
        let each = bodies.flat_map(|(row, body)| row.iter().zip(&body.parameters));
        each.map(|(column, parameter)| column * parameter).sum()
    }

    /// Frame of each body in the one that carries it, and its motion.
    fn motions(
        &self,
        positions: &[f64],
        speeds: &[f64],
        accelerations: &[f64],
    ) -> (Vec<Isometry3<f64>>, Vec<Motion>) {
        let rest = Motion {
            spin: Vector3::zeros(),
            turning: Vector3::zeros(),
            acceleration: Vector3::new(0.0, 0.0, STANDARD_GRAVITY),
        };
        let mut frames = Vec::with_capacity(self.bodies.len());
        let mut motions: Vec<Motion> = Vec::with_capacity(self.bodies.len());
        for (index, body) in self.bodies.iter().enumerate() {
            let axis = body.axis.into_inner();
            let moved = match body.kind {
                JointKind::Prismatic => {
                    body.origin * nalgebra::Translation3::from(axis * positions[index])
                }
                _ => {
                    body.origin
                        * nalgebra::UnitQuaternion::from_axis_angle(&body.axis, positions[index])
                }
            };
            let carrier = body.parent.map_or(rest, |parent| motions[parent]);
            let mut motion = carrier.at(&moved);
            let (along, change) = (axis * speeds[index], axis * accelerations[index]);
            if body.kind == JointKind::Prismatic {
                motion.acceleration += change + 2.0 * motion.spin.cross(&along);
            } else {
                motion.turning += change + motion.spin.cross(&along);
                motion.spin += along;
            }
            frames.push(moved);
            motions.push(motion);
        }
        (frames, motions)
    }

    /// Efforts of wrenches on a body at each joint that carries it.
    fn project(
        &self,
        frames: &[Isometry3<f64>],
        body: usize,
        mut wrenches: [Wrench; PARAMETERS],
        mut show: impl FnMut(usize, usize, f64),
    ) {
        let mut at = Some(body);
        while let Some(index) = at {
            let own = &self.bodies[index];
            for (column, (force, moment)) in wrenches.iter().enumerate() {
                let along = match own.kind {
                    JointKind::Prismatic => force,
                    _ => moment,
                };
                show(index, column, own.axis.dot(along));
            }
            wrenches = wrenches.map(|wrench| carried(&frames[index], wrench));
            at = own.parent;
        }
    }
}

fn is_identity(frame: &Isometry3<f64>) -> bool {
    let (shift, turn) = (frame.translation.vector.norm(), frame.rotation.angle());
    shift < NEAR && turn < NEAR
}

/// A wrench of a frame, in the frame that carries it.
fn carried(frame: &Isometry3<f64>, (force, moment): Wrench) -> Wrench {
    let force = frame.rotation * force;
    let lever = frame.translation.vector;
    (force, frame.rotation * moment + lever.cross(&force))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Chain;

    const ARM: &str = include_str!("../../../launch-scripts/robot_arm_turntable.urdf");

    fn arm() -> (Chain, Dynamics) {
        let chain = Chain::from_urdf(ARM).expect("a machine");
        let driven: Vec<String> = chain.axis_names().map(str::to_owned).collect();
        let dynamics = Dynamics::from_urdf(ARM, &driven, &BTreeMap::new()).expect("a tree");
        (chain, dynamics)
    }

    /// Positions in the order of the chain, in that of the bodies.
    fn ordered(chain: &Chain, dynamics: &Dynamics, positions: &[f64]) -> Vec<f64> {
        let of = |body: &Body| positions[chain.axis_index(&body.joint).expect("an axis")];
        dynamics.bodies().iter().map(of).collect()
    }

    #[test]
    fn at_rest_it_holds_the_weight() {
        let (chain, dynamics) = arm();
        let at = [0.4, 0.3, -1.1, 1.3, -0.5, 0.7, 0.2];
        let rest = vec![0.0; at.len()];
        let held = dynamics.efforts(&ordered(&chain, &dynamics, &at), &rest, &rest);
        let pulled = ordered(&chain, &dynamics, &chain.gravity_efforts(&at));
        for (held, pulled) in held.iter().zip(pulled) {
            assert!((held + pulled).abs() < 1e-9, "{held} {pulled}");
        }
    }

    /// Kinetic energy ½ vᵀM v, with the mass matrix from efforts at unit accelerations, and the power that efforts bring in:
    /// the work of a motion is the energy that it gains.
    #[test]
    fn the_work_of_a_motion_is_the_energy_it_gains() {
        let (chain, dynamics) = arm();
        let count = dynamics.bodies().len();
        let motion = |t: f64| -> [Vec<f64>; 3] {
            let wave = |k: usize, order: u32| {
                let omega = 0.7 + 0.3 * k as f64;
                let phase = omega * t + k as f64;
                match order {
                    0 => 0.6 * phase.sin(),
                    1 => 0.6 * omega * phase.cos(),
                    _ => -0.6 * omega * omega * phase.sin(),
                }
            };
            [0, 1, 2].map(|order| (0..count).map(|k| wave(k, order)).collect())
        };
        let zero = vec![0.0; count];
        let energy = |t: f64| {
            let [q, v, _] = motion(t);
            let weight = dynamics.efforts(&q, &zero, &zero);
            let inertia = dynamics.efforts(&q, &zero, &v);
            let kinetic = (0..count).map(|k| 0.5 * v[k] * (inertia[k] - weight[k]));
            kinetic.sum::<f64>()
        };
        let power = |t: f64| {
            let [q, v, a] = motion(t);
            let efforts = dynamics.efforts(&q, &v, &a);
            let weight = dynamics.efforts(&q, &zero, &zero);
            (0..count)
                .map(|k| v[k] * (efforts[k] - weight[k]))
                .sum::<f64>()
        };
        assert_eq!(count, chain.axes().len());
        for t in [0.0, 0.9, 2.3, 7.1] {
            let gain = (energy(t + 1e-5) - energy(t - 1e-5)) / 2e-5;
            assert!(
                (gain - power(t)).abs() < 1e-6 * power(t).abs().max(1.0),
                "{t}: {gain} {}",
                power(t)
            );
        }
    }

    /// A mass on the flange, declared in the description or given as a load, takes the same effort.
    #[test]
    fn a_load_at_the_mount_is_the_same_as_a_link_there() {
        let (_, dynamics) = arm();
        let loaded = ARM.replacen(
            "</robot>",
            "<link name=\"load\"><inertial><origin xyz=\"0.02 -0.03 0.1\"/><mass value=\"2.5\"/>\
             <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.03\"/></inertial></link>\
             <joint name=\"held\" type=\"fixed\"><parent link=\"probe_mount\"/><child link=\"load\"/></joint></robot>",
            1,
        );
        let driven: Vec<String> = (dynamics.bodies().iter())
            .map(|body| body.joint.clone())
            .collect();
        let heavy = Dynamics::from_urdf(&loaded, &driven, &BTreeMap::new()).expect("a tree");
        let count = driven.len();
        let some =
            |seed: f64| -> Vec<f64> { (0..count).map(|k| (seed + 1.7 * k as f64).sin()).collect() };
        let (q, v, a) = (some(0.3), some(1.1), some(2.9));
        let centre = Vector3::new(0.02, -0.03, 0.1);
        let inertia = Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.03));
        let own = Inertial {
            mass: 2.5,
            centre,
            inertia,
        };
        let own = own.parameters();
        let light = dynamics.efforts(&q, &v, &a);
        for (joint, row) in dynamics.load_regressor(&q, &v, &a).iter().enumerate() {
            let extra: f64 = row.iter().zip(own).map(|(column, own)| column * own).sum();
            let whole = heavy.efforts(&q, &v, &a)[joint];
            assert!(
                (light[joint] + extra - whole).abs() < 1e-9,
                "{joint} {extra} {whole}"
            );
        }
    }
}
