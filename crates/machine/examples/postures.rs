//! Postures of the arm of `launch-scripts/robot_arm.urdf` for random places of its flange, one JSON object a line; for the
//! comparison with another implementation, `tests/interop/plans/arm_postures.py`.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "the program of a test, which reads what it prints"
)]

use machine::{Chain, Side};
use nalgebra::{Isometry3, Point3};

const ARM: &str = include_str!("../../../launch-scripts/robot_arm.urdf");
const PLACES: u32 = 10_000;

fn main() {
    let text = ARM.replace(
        "xyz=\"-0.1 0 0.06\" rpy=\"0 1.570796327 0\"",
        "xyz=\"0 0 0\"",
    );
    assert_ne!(text, ARM, "the probe mount is the flange");
    let chain = Chain::from_urdf(&text).unwrap();
    // The part frame is the base of the arm.
    let base = Isometry3::translation(0.0, 0.0, 0.4);
    let part_pose = chain.end_pose(Side::Part, &[0.0; 6]).inverse() * base;
    let (ball, mut number) = (Point3::origin(), 1_u64);
    for _ in 0..PLACES {
        let asked = [0, 1, 2, 3, 4, 5].map(|axis| {
            number = number
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let share = (number >> 11) as f64 / (1_u64 << 53) as f64;
            let (lower, upper) = chain.axis(axis).limits.unwrap();
            lower + (upper - lower) * share
        });
        let mount = chain.part_from_mount(&asked, &part_pose);
        let at = (&(mount * ball), &mount.rotation);
        let found = chain.postures(at, &[None; 6], &[0.0; 6], &part_pose, &ball);
        let matrix = mount.to_homogeneous();
        let rows: Vec<Vec<f64>> = matrix
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect();
        println!("{{\"flange\": {rows:?}, \"postures\": {found:?}}}");
    }
}
