//! A pose that is none.

use probecell_msgs::geometry_msgs::{Pose, Quaternion};

/// A pose that is none: at the origin, not rotated.
pub fn identity() -> Pose {
    Pose {
        orientation: Quaternion {
            w: 1.0,
            ..Quaternion::default()
        },
        ..Pose::default()
    }
}
