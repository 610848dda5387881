//! Every link of a robot description, as a viewer draws it.
//!
//! [`Chain`](crate::Chain) knows the two branches that a touch depends on; a viewer (RViz, Foxglove) needs the transform of
//! every link, guards and tables off the branches included, as `robot_state_publisher` gives them.

use nalgebra::Isometry3;

use crate::{Joint, chain, description::ChainError, urdf::Robot};

/// A joint with the links that it connects.
#[derive(Debug, Clone)]
pub struct TreeJoint {
    /// Link nearer to the root.
    pub parent: String,
    /// Link that the joint carries.
    pub child: String,
    /// Its nominal geometry.
    pub joint: Joint,
}

impl TreeJoint {
    /// Frame of the child link in that of the parent, at a position (m or rad) of the joint.
    pub fn transform(&self, position: f64) -> Isometry3<f64> {
        self.joint.origin * self.joint.motion(position)
    }
}

/// All joints of a URDF text whose motion is one number, in the order of the text. Joints of other types (`floating`,
/// `planar`, those that mimic another) are left out: nothing says where their links are.
///
/// # Errors
/// [`ChainError::Urdf`] where the text is no robot description.
pub fn joints(text: &str) -> Result<Vec<TreeJoint>, ChainError> {
    let robot = Robot::read(text)?;
    let link = |name: &str| robot.links.iter().find(|link| link.name == name);
    let joints = robot.joints.iter().filter_map(|raw| {
        Some(TreeJoint {
            parent: raw.parent.clone(),
            child: raw.child.clone(),
            joint: chain::joint(raw, link(&raw.child)?).ok()?,
        })
    });
    Ok(joints.collect())
}

/// Names of all joints of a URDF text, of whatever type.
///
/// # Errors
/// [`ChainError::Urdf`] where the text is no robot description.
pub fn joint_names(text: &str) -> Result<Vec<String>, ChainError> {
    let robot = Robot::read(text)?;
    Ok(robot.joints.into_iter().map(|joint| joint.name).collect())
}
