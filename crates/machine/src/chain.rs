//! The kinematic chain of a cell: two branches of joints from `foundation`, to the part and to the probe.
//!
//! Metres and radians. Frames as in the interface contract: the part branch ends in link `workpiece`, the tool branch
//! in link `probe_mount`; each may be empty or share a beginning with the other. A joint is nominal origin, then
//! location error, then motion, then motion error (ISO 230-1 names for the errors). Limits of position and of motion
//! ([`crate::motion`]) belong to the axes; the chain knows no collisions and no dynamics, and carries masses along for
//! those who need them.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::{
    description::{ChainError, MAX_JOINTS},
    motion::Motion,
    urdf::{Link, RawJoint, Robot, Round},
};

/// Root link of every machine.
pub const FOUNDATION: &str = "foundation";
/// Link that carries the part.
pub const WORKPIECE: &str = "workpiece";
/// Link that carries the probe: spindle nose or robot flange.
pub const PROBE_MOUNT: &str = "probe_mount";

/// What a joint lets move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Nothing.
    Fixed,
    /// A translation along the axis, m.
    Prismatic,
    /// A rotation about the axis, rad.
    Revolute,
}

/// One joint on the way to the part or to the probe.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Its name; for a moving joint the axis name.
    pub name: String,
    /// What it lets move.
    pub kind: JointKind,
    /// Parent link from joint frame at position 0.
    pub origin: Isometry3<f64>,
    /// Direction of motion in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Lowest and highest position, m or rad; `None` where the description gives no usable pair.
    pub limits: Option<(f64, f64)>,
    /// Highest speed, m/s or rad/s; `None` where the description gives none.
    pub speed: Option<f64>,
    /// Mass of the child link, kg; 0 where the description gives none.
    pub mass: f64,
    /// Centre of mass of the child link in the joint frame, m.
    pub centre_of_mass: Vector3<f64>,
    /// Inertia of the child link about its centre of mass, kg m².
    pub inertia: Matrix3<f64>,
    /// Space that the child link fills, as far as the description gives it by cylinders and spheres.
    pub capsules: Vec<Capsule>,
}

/// A shaft with round ends, in the frame of a joint after its motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// Ends of its axis, m.
    pub ends: [Point3<f64>; 2],
    /// m
    pub radius: f64,
}

impl Joint {
    /// Joint frame at position 0 from joint frame at `position`.
    pub fn motion(&self, position: f64) -> Isometry3<f64> {
        match self.kind {
            JointKind::Fixed => Isometry3::identity(),
            JointKind::Prismatic => Translation3::from(self.axis.into_inner() * position).into(),
            JointKind::Revolute => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&self.axis, position),
            ),
        }
    }

    /// Goes from a frame at the joint's position 0 to the same moved by `position`.
    pub(crate) fn advance(&self, pose: &mut Isometry3<f64>, position: f64) {
        match self.kind {
            JointKind::Fixed => {}
            JointKind::Prismatic => {
                pose.translation.vector += pose.rotation * (self.axis.into_inner() * position);
            }
            JointKind::Revolute => {
                pose.rotation *= UnitQuaternion::from_axis_angle(&self.axis, position);
            }
        }
    }

    /// True for a joint that moves.
    pub fn moves(&self) -> bool {
        self.kind != JointKind::Fixed
    }
}

/// Which branch of the chain something belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Between foundation and part.
    Part,
    /// Between foundation and probe.
    Tool,
}

/// A machine as its robot description declares it.
#[derive(Debug, Clone)]
pub struct Chain {
    name: String,
    joints: Vec<Joint>,
    part_branch: Vec<usize>,
    tool_branch: Vec<usize>,
    axes: Vec<usize>,
    /// For each joint its index in `axes`.
    axis_of: Vec<Option<usize>>,
    motion: Motion,
}

impl Chain {
    /// Reads a URDF text; links and joints off the two branches are ignored.
    ///
    /// # Errors
    /// [`ChainError`] names the link or joint that keeps the text from being a machine.
    pub fn from_urdf(text: &str) -> Result<Self, ChainError> {
        let robot = Robot::read(text)?;
        let links = named_links(&robot)?;
        let parents = parents(&robot, &links)?;
        if let Some(missing) = [FOUNDATION, WORKPIECE, PROBE_MOUNT]
            .into_iter()
            .find(|link| !links.contains_key(link))
        {
            return Err(ChainError::MissingLink(missing.to_owned()));
        }
        let mut used = Vec::new();
        let mut branch_to = |end: &'static str| -> Result<Vec<usize>, ChainError> {
            let path = climb(&robot, &parents, end)?;
            Ok(path
                .into_iter()
                .map(|index| {
                    used.iter()
                        .position(|&known| known == index)
                        .unwrap_or_else(|| {
                            used.push(index);
                            used.len() - 1
                        })
                })
                .collect())
        };
        let part_branch = branch_to(WORKPIECE)?;
        let tool_branch = branch_to(PROBE_MOUNT)?;
        let joints = used
            .iter()
            .map(|&index| {
                let raw = &robot.joints[index];
                let (limits, speed) = travel_and_speed(raw)?;
                Ok(Joint {
                    limits,
                    speed,
                    ..joint(raw, &robot.links[links[raw.child.as_str()]])?
                })
            })
            .collect::<Result<Vec<_>, ChainError>>()?;
        let axes: Vec<usize> = (0..joints.len())
            .filter(|&index| joints[index].moves())
            .collect();
        let axis_of = (0..joints.len())
            .map(|index| axes.binary_search(&index).ok())
            .collect();
        let motion = Motion::at_speeds(axes.iter().map(|&index| joints[index].speed));
        Ok(Self {
            motion,
            name: robot.name,
            joints,
            part_branch,
            tool_branch,
            axes,
            axis_of,
        })
    }

    /// The same machine with other limits of its motion than the top speeds of its description.
    pub fn with_motion(self, motion: Motion) -> Self {
        Self { motion, ..self }
    }

    /// How its axes move together, in the order of a position vector.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Name of the machine in its description.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// All joints of both branches: those of the part branch first, each branch from the foundation outwards.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Indices into [`Self::joints`] from the foundation to the end of a branch.
    pub fn branch(&self, side: Side) -> &[usize] {
        match side {
            Side::Part => &self.part_branch,
            Side::Tool => &self.tool_branch,
        }
    }

    /// Indices into [`Self::joints`] of the moving joints; a position vector has this order.
    pub fn axes(&self) -> &[usize] {
        &self.axes
    }

    /// Index of a joint in a position vector; `None` for one that does not move.
    pub(crate) fn axis_of(&self, joint: usize) -> Option<usize> {
        self.axis_of[joint]
    }

    /// Names of the moving joints, in the order of a position vector.
    pub fn axis_names(&self) -> impl Iterator<Item = &str> {
        self.axes
            .iter()
            .map(|&index| self.joints[index].name.as_str())
    }

    /// Index of an axis in a position vector.
    pub fn axis_index(&self, name: &str) -> Option<usize> {
        self.axis_names().position(|known| known == name)
    }

    /// The moving joint at an index of a position vector.
    pub fn axis(&self, index: usize) -> &Joint {
        &self.joints[self.axes[index]]
    }

    /// True where the joint lies on the way to `side` only (a shared joint moves both and is on neither).
    pub fn carries(&self, joint: usize, side: Side) -> bool {
        let on_part = self.part_branch.contains(&joint);
        let on_tool = self.tool_branch.contains(&joint);
        match side {
            Side::Part => on_part && !on_tool,
            Side::Tool => on_tool && !on_part,
        }
    }
}

fn named_links(robot: &Robot) -> Result<BTreeMap<&str, usize>, ChainError> {
    let mut links = BTreeMap::new();
    for (index, link) in robot.links.iter().enumerate() {
        if links.insert(link.name.as_str(), index).is_some() {
            return Err(ChainError::Duplicate {
                kind: "link",
                name: link.name.clone(),
            });
        }
    }
    let mut joints = BTreeSet::new();
    for joint in &robot.joints {
        if !joints.insert(joint.name.as_str()) {
            return Err(ChainError::Duplicate {
                kind: "joint",
                name: joint.name.clone(),
            });
        }
    }
    Ok(links)
}

/// For each link that hangs on a joint, that joint.
fn parents<'a>(
    robot: &'a Robot,
    links: &BTreeMap<&str, usize>,
) -> Result<BTreeMap<&'a str, usize>, ChainError> {
    let mut parents = BTreeMap::new();
    for (index, joint) in robot.joints.iter().enumerate() {
        for link in [&joint.parent, &joint.child] {
            if !links.contains_key(link.as_str()) {
                return Err(ChainError::UnknownLink {
                    joint: joint.name.clone(),
                    link: link.clone(),
                });
            }
        }
        if parents.insert(joint.child.as_str(), index).is_some() {
            return Err(ChainError::Loop(joint.child.clone()));
        }
    }
    Ok(parents)
}

fn climb(
    robot: &Robot,
    parents: &BTreeMap<&str, usize>,
    end: &str,
) -> Result<Vec<usize>, ChainError> {
    let mut path = Vec::new();
    let mut link = end;
    while link != FOUNDATION {
        let Some(&index) = parents.get(link) else {
            return Err(ChainError::OtherRoot {
                link: end.to_owned(),
                root: link.to_owned(),
            });
        };
        if path.len() == robot.joints.len() {
            return Err(ChainError::Loop(link.to_owned()));
        }
        path.push(index);
        if path.len() > MAX_JOINTS {
            return Err(ChainError::TooLarge {
                what: "joints on the way to one link",
                given: path.len(),
                most: MAX_JOINTS,
            });
        }
        link = &robot.joints[index].parent;
    }
    path.reverse();
    Ok(path)
}

/// Geometry and mass of a joint; its limits are those of a machine that is to move ([`travel_and_speed`]).
pub(crate) fn joint(joint: &RawJoint, child: &Link) -> Result<Joint, ChainError> {
    let name = joint.name.clone();
    let bad = |what| ChainError::BadNumber {
        joint: name.clone(),
        what,
    };
    let kind = match joint.kind.as_str() {
        "fixed" => JointKind::Fixed,
        "prismatic" => JointKind::Prismatic,
        "revolute" | "continuous" => JointKind::Revolute,
        _ => {
            return Err(ChainError::JointType {
                joint: name,
                kind: joint.kind.clone(),
            });
        }
    };
    if joint.mimics {
        return Err(ChainError::Mimic(name));
    }
    let axis = joint.axis;
    let axis = match kind {
        JointKind::Fixed => Vector3::x_axis(),
        // The squares of a huge axis overflow, and a division by infinity would leave no direction.
        _ if axis.norm().is_finite() => Unit::try_new(axis, 1e-9).ok_or_else(|| bad("axis"))?,
        _ => return Err(bad("axis")),
    };
    let origin = joint.origin.isometry().ok_or_else(|| bad("origin"))?;
    let centre = child
        .origin
        .isometry()
        .ok_or_else(|| bad("centre of mass"))?;
    let turn = centre.rotation.to_rotation_matrix();
    let inertia = turn * child.inertia * turn.transpose();
    let mass = child.mass;
    if !mass.is_finite() || !inertia.iter().all(|value| value.is_finite()) {
        return Err(bad("inertia"));
    }
    Ok(Joint {
        kind,
        origin,
        axis,
        limits: None,
        speed: None,
        mass,
        centre_of_mass: centre.translation.vector,
        inertia,
        capsules: (child.rounds.iter())
            .map(|round| capsule(round).ok_or_else(|| bad("collision geometry")))
            .collect::<Result<_, _>>()?,
        name,
    })
}

/// Lower and upper limit, m or rad, of an axis that has them.
type Travel = Option<(f64, f64)>;

/// Lower and upper limit, and top speed, of an axis; `None` where it has none. A revolute or prismatic joint has both, and only a
/// continuous one turns without limits (<http://wiki.ros.org/urdf/XML/joint>).
fn travel_and_speed(joint: &RawJoint) -> Result<(Travel, Option<f64>), ChainError> {
    let wrong = |what: String| ChainError::Limit {
        joint: joint.name.clone(),
        what,
    };
    let has_travel = matches!(joint.kind.as_str(), "revolute" | "prismatic");
    let meant = if joint.kind == "revolute" {
        ", or make it `continuous` if it turns without limits"
    } else {
        ""
    };
    let Some([lower, upper, speed]) = joint.limit else {
        if has_travel {
            let kind = &joint.kind;
            return Err(wrong(format!(
                "is {kind} and has no `limit`: state it{meant}"
            )));
        }
        return Ok((None, None));
    };
    if joint.kind == "fixed" {
        return Ok((None, None));
    }
    if !(speed.is_finite() && speed > 0.0) {
        return Err(wrong(format!(
            "has velocity {speed} in its `limit`, expected a speed above 0"
        )));
    }
    if !has_travel {
        return Ok((None, Some(speed)));
    }
    if !(lower.is_finite() && upper.is_finite()) {
        return Err(wrong(format!(
            "has limits from {lower} to {upper}, expected numbers"
        )));
    }
    if lower > upper {
        return Err(wrong(format!(
            "has its lower limit {lower} above its upper limit {upper}: are they exchanged?"
        )));
    }
    if lower == upper {
        return Err(wrong(format!(
            "has a travel from {lower} to {upper} (a limit that is left out is 0): state both limits{meant}"
        )));
    }
    Ok((Some((lower, upper)), Some(speed)))
}

/// The capsule around a cylinder: its axis ends where the flat faces are, so that it covers the edges' circles but for the
/// corners beyond its radius; `None` where a number is unusable.
fn capsule(round: &Round) -> Option<Capsule> {
    let origin = round.origin.isometry()?;
    let usable = round.radius.is_finite() && round.length.is_finite();
    let half = 0.5 * round.length;
    (usable && round.radius > 0.0 && half >= 0.0).then(|| Capsule {
        ends: [-half, half].map(|z| origin * Point3::new(0.0, 0.0, z)),
        radius: round.radius,
    })
}
