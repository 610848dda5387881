//! Any text as a robot description, and kinematics on what is accepted.

use machine::{Chain, Side};
use nalgebra::{Isometry3, Point3};

/// Reads the text and moves the machine that it describes.
pub fn target(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let Ok(chain) = Chain::from_urdf(text) else {
        return;
    };
    for &joint in chain.axes() {
        let joint = &chain.joints()[joint];
        let length = joint.axis.norm();
        assert!(
            (length - 1.0).abs() < 1e-9,
            "the axis of {:?} has length {length}",
            joint.name
        );
        assert!(joint.limits.is_none_or(|(lower, upper)| lower < upper));
    }
    let names: Vec<String> = chain.axis_names().map(str::to_owned).collect();
    let positions = chain
        .positions(&names, &vec![0.1; names.len()])
        .expect("positions of all axes");
    for side in [Side::Part, Side::Tool] {
        let turn = chain.end_pose(side, &positions).rotation;
        assert!(
            (turn.norm() - 1.0).abs() < 1e-6,
            "a rotation of length {}",
            turn.norm()
        );
    }
    let ball = chain.ball_in_part(
        &positions,
        &Isometry3::identity(),
        &Point3::new(0.0, 0.0, -0.1),
    );
    let reach = chain
        .joints()
        .iter()
        .map(|joint| joint.origin.translation.vector.amax())
        .fold(0.0, f64::max);
    // Beyond this, sums of what the description itself says may overflow.
    assert!(
        reach > 1e100 || ball.iter().all(|value| value.is_finite()),
        "the ball is at {ball}"
    );
}

/// A turn-mill, and machines with empty, shared and turned branches.
pub fn seeds() -> Vec<Vec<u8>> {
    let shared = r#"<robot name="a"><link name="foundation"/><link name="base"/><link name="workpiece"/>
<link name="probe_mount"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="A" type="continuous"><parent link="foundation"/><child link="base"/><axis xyz="1 0 0"/></joint>
<joint name="f" type="fixed"><parent link="base"/><child link="workpiece"/><origin xyz="0 0 1" rpy="0 1.5 0"/></joint>
<joint name="X" type="prismatic"><parent link="base"/><child link="probe_mount"/><axis xyz="0.6 0 0.8"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"#;
    vec![
        include_bytes!("../../launch-scripts/turn_mill.urdf").to_vec(),
        shared.as_bytes().to_vec(),
    ]
}
