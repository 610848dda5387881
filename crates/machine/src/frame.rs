//! What a work offset moves: a linear axis, or, where the machine has none, the frame in which an arm's programme runs.
//!
//! The frame of an arm (its base or work object) is the part frame where it is nominal; its offsets X, Y, Z shift all
//! programmed places along the axes of the part frame, and the arm's inverse kinematics keeps attitude and configuration.
//! Metres, radians.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::{
    chain::{Chain, JointKind, Side},
    inverse::{ReachError, Target},
};

/// What a work offset of a name moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkOffset {
    /// A linear axis, by its index in a position vector.
    Axis(usize),
    /// The frame of an arm's programme, along an axis of the part frame: x, y, z.
    Frame(usize),
}

impl Chain {
    /// What the work offset `name` moves: the linear axis of that name; X, Y or Z of the programme's frame where no axis is
    /// linear; else nothing.
    pub fn work_offset(&self, name: &str) -> Option<WorkOffset> {
        let linear = |axis: &usize| self.axis(*axis).kind == JointKind::Prismatic;
        if let Some(axis) = self.axis_index(name).filter(linear) {
            return Some(WorkOffset::Axis(axis));
        }
        let none_linear = !(0..self.axes().len()).any(|axis| linear(&axis));
        let frame = ["X", "Y", "Z"].iter().position(|known| *known == name);
        frame.filter(|_| none_linear).map(WorkOffset::Frame)
    }

    /// Where the axes stand (m, rad) for programmed positions with these work offsets (m).
    ///
    /// # Errors
    /// [`ReachError`] where an arm does not get to the displaced place.
    pub fn with_work_offsets(
        &self,
        positions: &[f64],
        offsets: impl Iterator<Item = (WorkOffset, f64)>,
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> Result<Vec<f64>, ReachError> {
        let (mut moved, mut shift) = (positions.to_vec(), Vector3::zeros());
        for (of, value) in offsets {
            match of {
                WorkOffset::Axis(axis) => moved[axis] += value,
                WorkOffset::Frame(along) => shift[along] += value,
            }
        }
        if shift == Vector3::zeros() {
            return Ok(moved);
        }
        // What moves the part stands where it is programmed.
        let prescribed: Vec<Option<f64>> = (self.axes().iter().zip(&moved))
            .map(|(&joint, &position)| (!self.carries(joint, Side::Tool)).then_some(position))
            .collect();
        let mount = self.part_from_mount(&moved, part_pose);
        let target = Target {
            ball: mount * ball + shift,
            orientation: Some(mount.rotation),
        };
        self.reach(&target, &prescribed, &moved, part_pose, ball)
    }
}
