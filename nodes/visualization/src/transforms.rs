//! Frames of the links, as tf2 transforms.

use graph::Stamp;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use probecell_msgs::{
    InspectionPlan,
    geometry_msgs::{self, TransformStamped},
    sensor_msgs::JointState,
    tf2_msgs::TFMessage,
};

use crate::config::Config;

/// Nominal frame of the part, below `workpiece`.
pub(crate) const PART: &str = "part";
/// Nominal centre of the stylus ball, below `probe_mount`.
pub(crate) const STYLUS: &str = "stylus";

/// What never moves: fixed joints, and the plan's frames of part and stylus.
pub(crate) fn fixed(config: &Config, now: Stamp, plan: Option<&InspectionPlan>) -> TFMessage {
    let joints = config.joints.iter().filter(|joint| !joint.joint.moves());
    let links = joints.map(|joint| {
        let pose = joint.transform(0.0);
        stamped(now, &joint.parent, &joint.child, &pose)
    });
    let of_plan = plan.into_iter().flat_map(|plan| {
        let ball = &plan.stylus.ball_center;
        let stylus = Isometry3::translation(ball.x, ball.y, ball.z);
        let part = part_pose(&plan.part_pose);
        [
            part.map(|part| stamped(now, machine::chain::WORKPIECE, PART, &part)),
            Some(stamped(now, machine::chain::PROBE_MOUNT, STYLUS, &stylus)),
        ]
    });
    TFMessage {
        transforms: links.chain(of_plan.flatten()).collect(),
    }
}

/// The links that the named joints carry, at the stamp of the state.
pub(crate) fn moving(config: &Config, state: &JointState) -> TFMessage {
    let stamp = Stamp::from(&state.header.stamp);
    let named = state.name.iter().zip(&state.position);
    let transforms = named.filter_map(|(name, &position)| {
        let joint = (config.joints.iter()).find(|joint| joint.joint.name == *name)?;
        let moves = joint.joint.moves() && position.is_finite();
        moves.then(|| {
            let pose = joint.transform(position);
            stamped(stamp, &joint.parent, &joint.child, &pose)
        })
    });
    TFMessage {
        transforms: transforms.collect(),
    }
}

fn stamped(stamp: Stamp, parent: &str, child: &str, pose: &Isometry3<f64>) -> TransformStamped {
    let Vector3 { data, .. } = pose.translation.vector;
    let [[x, y, z]] = data.0;
    let turn = pose.rotation.coords;
    TransformStamped {
        header: stamp.header(parent),
        child_frame_id: child.to_owned(),
        transform: geometry_msgs::Transform {
            translation: geometry_msgs::Vector3 { x, y, z },
            rotation: geometry_msgs::Quaternion {
                x: turn.x,
                y: turn.y,
                z: turn.z,
                w: turn.w,
            },
        },
    }
}

/// As a transformation; `None` where the orientation is no rotation, which path planning and analysis report.
fn part_pose(pose: &geometry_msgs::Pose) -> Option<Isometry3<f64>> {
    let (at, turn) = (&pose.position, &pose.orientation);
    let rotation = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
    Some(Isometry3::from_parts(
        Translation3::new(at.x, at.y, at.z),
        UnitQuaternion::try_new(rotation, 1e-9)?,
    ))
}
