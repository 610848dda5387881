//! Where the ball is: forward kinematics of a chain, with and without errors, and its derivatives.
//!
//! Metres and radians; results in the part frame. A twist is `[x, y, z, a, b, c]`: translations along and rotations
//! about the axes of the frame it acts in (ISO 230-1). Derivatives are analytic and exact at zero error; a finite
//! error is composed, not added, so that large errors keep their second order.
//! Contact is not decided here.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::chain::{Chain, JointKind, Side};

/// A small displacement: translations (m), then rotation vector (rad).
pub type Twist = [f64; 6];

/// No displacement.
pub const NO_TWIST: Twist = [0.0; 6];

/// Why positions do not fit a chain.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PositionError {
    /// Names and values differ in number.
    #[error("{names} axis names but {values} axis positions")]
    Length {
        /// Number of names.
        names: usize,
        /// Number of values.
        values: usize,
    },
    /// A named axis is not one of the machine.
    #[error("axis `{0}` is not a moving joint of the robot description")]
    Unknown(String),
    /// The machine has an axis that was not named.
    #[error("axis `{0}` of the robot description has no position")]
    Missing(String),
    /// Named twice.
    #[error("axis `{0}` is named twice")]
    Twice(String),
    /// NaN or infinite.
    #[error("position of axis `{0}` is not finite")]
    NotFinite(String),
}

/// Errors of a chain at one touch: what acts at each joint, at the part and at the ball.
#[derive(Debug, Clone, Default)]
pub struct ChainErrors {
    /// Per joint of [`Chain::joints`]: right after its origin, before its motion.
    pub location: Vec<Twist>,
    /// Per joint of [`Chain::joints`]: after its motion, in the moved frame.
    pub motion: Vec<Twist>,
    /// Of the part in its nominal frame.
    pub part: Twist,
    /// Of the ball centre in the frame of the probe mount, m.
    pub ball: [f64; 3],
}

impl ChainErrors {
    /// No error at any of `joints` joints.
    pub fn none(joints: usize) -> Self {
        Self {
            location: vec![NO_TWIST; joints],
            motion: vec![NO_TWIST; joints],
            ..Self::default()
        }
    }
}

/// Derivatives of the ball centre in the part frame, m per m or m per rad.
#[derive(Debug, Clone)]
pub struct Sensitivity {
    /// Ball centre in the part frame, m.
    pub ball: Point3<f64>,
    /// Per moving axis of [`Chain::axes`]: to its position.
    pub axes: Vec<Vector3<f64>>,
    /// Per moving axis: rotation vector of the mount against the part per unit of its position, part frame.
    pub turns: Vec<Vector3<f64>>,
    /// Per joint: to each component of its location error.
    pub location: Vec<[Vector3<f64>; 6]>,
    /// Per joint: to each component of its motion error.
    pub motion: Vec<[Vector3<f64>; 6]>,
    /// To each component of the part's displacement in its nominal frame.
    pub part: [Vector3<f64>; 6],
    /// To the ball's displacement along each axis of the probe mount: the columns of part-from-mount.
    pub mount: [Vector3<f64>; 3],
    /// Unit vectors of the foundation seen in the part frame.
    pub foundation: [Vector3<f64>; 3],
}

impl Chain {
    /// Orders named positions as [`Self::axes`].
    ///
    /// # Errors
    /// [`PositionError`] names the axis at fault.
    pub fn positions(&self, names: &[String], values: &[f64]) -> Result<Vec<f64>, PositionError> {
        if names.len() != values.len() {
            return Err(PositionError::Length {
                names: names.len(),
                values: values.len(),
            });
        }
        let mut found = vec![None; self.axes().len()];
        for (name, &value) in names.iter().zip(values) {
            let index = self
                .axis_index(name)
                .ok_or_else(|| PositionError::Unknown(name.clone()))?;
            if !value.is_finite() {
                return Err(PositionError::NotFinite(name.clone()));
            }
            if found[index].replace(value).is_some() {
                return Err(PositionError::Twice(name.clone()));
            }
        }
        found
            .into_iter()
            .enumerate()
            .map(|(index, value)| {
                value.ok_or_else(|| PositionError::Missing(self.axis(index).name.clone()))
            })
            .collect()
    }

    /// Foundation from the end link of a branch. `positions` in the order of [`Self::axes`].
    pub fn end_pose(&self, side: Side, positions: &[f64]) -> Isometry3<f64> {
        self.pose_along(self.branch(side), positions)
    }

    /// Foundation from the frame of a joint after its motion: that at a place in a branch.
    pub fn pose_after(&self, side: Side, place: usize, positions: &[f64]) -> Isometry3<f64> {
        self.pose_along(&self.branch(side)[..=place], positions)
    }

    fn pose_along(&self, joints: &[usize], positions: &[f64]) -> Isometry3<f64> {
        joints.iter().fold(Isometry3::identity(), |pose, &index| {
            let joint = &self.joints()[index];
            let mut pose = pose * joint.origin;
            joint.advance(&mut pose, self.position_of(index, positions));
            pose
        })
    }

    /// Foundation from the end link of a branch whose joints err.
    pub fn end_pose_with(
        &self,
        side: Side,
        positions: &[f64],
        errors: &ChainErrors,
    ) -> Isometry3<f64> {
        self.branch(side)
            .iter()
            .fold(Isometry3::identity(), |pose, &index| {
                let joint = &self.joints()[index];
                pose * joint.origin
                    * displacement(&errors.location[index])
                    * joint.motion(self.position_of(index, positions))
                    * displacement(&errors.motion[index])
            })
    }

    /// Ball centre in the part frame; `part_pose` is workpiece from part, `ball` the ball centre in the probe mount.
    pub fn ball_in_part(
        &self,
        positions: &[f64],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> Point3<f64> {
        let foundation_from_part = self.end_pose(Side::Part, positions) * part_pose;
        foundation_from_part.inverse_transform_point(&(self.end_pose(Side::Tool, positions) * ball))
    }

    /// Ball centre in the frame of the part that really lies there, when the chain errs by `errors`.
    pub fn ball_in_part_with(
        &self,
        positions: &[f64],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
        errors: &ChainErrors,
    ) -> Point3<f64> {
        let foundation_from_part = self.end_pose_with(Side::Part, positions, errors)
            * part_pose
            * displacement(&errors.part);
        let true_ball = ball + Vector3::from(errors.ball);
        foundation_from_part.inverse_transform_point(
            &(self.end_pose_with(Side::Tool, positions, errors) * true_ball),
        )
    }

    /// Part from probe mount: where the tool side stands seen from the part.
    pub fn part_from_mount(&self, positions: &[f64], part_pose: &Isometry3<f64>) -> Isometry3<f64> {
        (self.end_pose(Side::Part, positions) * part_pose).inverse()
            * self.end_pose(Side::Tool, positions)
    }

    /// Part that really lies there from probe mount, when the chain errs by `errors`; their ball is not part of it.
    pub fn part_from_mount_with(
        &self,
        positions: &[f64],
        part_pose: &Isometry3<f64>,
        errors: &ChainErrors,
    ) -> Isometry3<f64> {
        (self.end_pose_with(Side::Part, positions, errors) * part_pose * displacement(&errors.part))
            .inverse()
            * self.end_pose_with(Side::Tool, positions, errors)
    }

    /// All first derivatives of [`Self::ball_in_part`] and of [`Self::ball_in_part_with`] at zero error.
    pub fn sensitivity(
        &self,
        positions: &[f64],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> Sensitivity {
        let count = self.joints().len();
        let part = self.end_pose(Side::Part, positions) * part_pose;
        let mount = self.end_pose(Side::Tool, positions);
        // Everything is seen from the part.
        let to_part = part.inverse();
        let ball = part.inverse_transform_point(&(mount * ball));
        let zero = [Vector3::zeros(); 6];
        let mut result = Sensitivity {
            ball,
            axes: vec![Vector3::zeros(); self.axes().len()],
            turns: vec![Vector3::zeros(); self.axes().len()],
            location: vec![zero; count],
            motion: vec![zero; count],
            part: zero,
            mount: basis(&(to_part.rotation * mount.rotation)),
            foundation: basis(&to_part.rotation),
        };
        for (side, sign) in [(Side::Part, -1.0), (Side::Tool, 1.0)] {
            let mut pose = to_part;
            for &index in self.branch(side) {
                let joint = &self.joints()[index];
                pose *= joint.origin;
                let turn = pose.rotation.to_rotation_matrix().into_inner() * sign;
                let arm = ball.coords - pose.translation.vector;
                add_twist(&mut result.location[index], &turn, &arm);
                let Some(axis) = self.axis_of(index) else {
                    add_twist(&mut result.motion[index], &turn, &arm);
                    continue;
                };
                let direction = turn * joint.axis.into_inner();
                joint.advance(&mut pose, positions[axis]);
                if joint.kind == JointKind::Revolute {
                    result.turns[axis] += direction;
                    result.axes[axis] += direction.cross(&arm);
                    let turn = pose.rotation.to_rotation_matrix().into_inner() * sign;
                    add_twist(&mut result.motion[index], &turn, &arm);
                } else {
                    result.axes[axis] += direction;
                    let arm = ball.coords - pose.translation.vector;
                    add_twist(&mut result.motion[index], &turn, &arm);
                }
            }
        }
        add_twist(&mut result.part, &-Matrix3::identity(), &ball.coords);
        result
    }

    fn position_of(&self, joint: usize, positions: &[f64]) -> f64 {
        self.axis_of(joint).map_or(0.0, |axis| positions[axis])
    }
}

/// The rigid displacement of a twist: rotated by the rotation vector, then shifted.
pub fn displacement(twist: &Twist) -> Isometry3<f64> {
    let [x, y, z, a, b, c] = *twist;
    if *twist == NO_TWIST {
        return Isometry3::identity();
    }
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_scaled_axis(Vector3::new(a, b, c)),
    )
}

fn basis(rotation: &UnitQuaternion<f64>) -> [Vector3<f64>; 3] {
    [
        rotation * Vector3::x(),
        rotation * Vector3::y(),
        rotation * Vector3::z(),
    ]
}

/// Adds how a twist moves the end of `arm`, which begins at the frame it acts in; `turn` has that frame's axes as columns.
fn add_twist(columns: &mut [Vector3<f64>; 6], turn: &Matrix3<f64>, arm: &Vector3<f64>) {
    for component in 0..3 {
        let direction = turn.column(component).into_owned();
        columns[component] += direction;
        columns[component + 3] += direction.cross(arm);
    }
}
