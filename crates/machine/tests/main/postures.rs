//! Inverse kinematics of arms: closed forms against the forward chain, and against each other's search.

use machine::{Chain, Target};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

/// Universal Robots' family, with a bracket and a spindle across the flange.
const THREE_PARALLEL: &str = include_str!("../../../../launch-scripts/robot_arm.urdf");
const TURNTABLE: &str = include_str!("../../../../launch-scripts/robot_arm_turntable.urdf");

/// An arm with a spherical wrist from its dimensions: the proportions of a KUKA KR 60-3 (A1 350/815 mm, upper arm 850, forearm
/// 145 and 820, flange 170), with A1 and A4 to A6 as a real one has them.
fn spherical_wrist() -> String {
    arm(&[
        ("0 0 0", "0 0 -1"),
        ("0.35 0 0.815", "0 1 0"),
        ("0.85 0 0", "0 1 0"),
        ("0 0 0.145", "-1 0 0"),
        ("0.82 0 0", "0 1 0"),
        ("0 0 0", "-1 0 0"),
    ])
}

/// Neither family: A2 stands oblique to A3, and A5 passes A6.
fn oblique() -> String {
    arm(&[
        ("0 0 0", "0 0 1"),
        ("0.1 0 0.4", "0.2 1 0"),
        ("0.5 0 0", "0 1 0.1"),
        ("0.1 0 0.1", "1 0 0"),
        ("0.4 0 0", "0 1 0"),
        ("0.05 0.03 0", "1 0 0.2"),
    ])
}

fn arm(joints: &[(&str, &str); 6]) -> String {
    let mut text = String::from(
        r#"<robot name="arm"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
        <joint name="table" type="fixed"><parent link="foundation"/><child link="workpiece"/><origin xyz="1 0 0.5"/></joint>"#,
    );
    let mut parent = "foundation".to_owned();
    for (number, (origin, axis)) in joints.iter().enumerate() {
        let (name, link) = (format!("A{}", number + 1), format!("link_{number}"));
        let link_and_joint = format!(
            r#"<link name="{link}"/><joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{link}"/>
            <origin xyz="{origin}"/><axis xyz="{axis}"/><limit lower="-3.1" upper="3.1" velocity="2" effort="1"/></joint>"#
        );
        text.push_str(&link_and_joint);
        parent = link;
    }
    text + &format!(
        r#"<joint name="flange" type="fixed"><parent link="{parent}"/><child link="probe_mount"/>
        <origin xyz="0.17 0 0" rpy="0.3 1.2 0"/></joint></robot>"#
    )
}

fn chain(text: &str) -> Chain {
    Chain::from_urdf(text).unwrap()
}

/// Numbers in [0, 1) by a linear congruential generator (Knuth's MMIX).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn part_pose() -> Isometry3<f64> {
    Isometry3::from_parts(
        Vector3::new(0.02, -0.03, 0.01).into(),
        UnitQuaternion::from_euler_angles(0.1, -0.2, 0.7),
    )
}

const BALL: Point3<f64> = Point3::new(0.0, 0.0, -0.15);

/// Positions within the travels.
fn random(chain: &Chain, numbers: &mut Numbers) -> Vec<f64> {
    (0..chain.axes().len())
        .map(|axis| {
            let (lower, upper) = chain.axis(axis).limits.unwrap();
            lower + (upper - lower) * numbers.next()
        })
        .collect()
}

/// Difference of two angles but for full turns.
fn apart(a: f64, b: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    ((a - b + PI).rem_euclid(TAU) - PI).abs()
}

/// From random postures there and back: each posture found stands where it was asked for, within the travels, and the one
/// that was asked about is among them, unless it is next to a singularity. How many postures there were, by number.
fn round_trips(chain: &Chain, prescribed: &[Option<f64>], count: u32) -> [u32; 17] {
    let mut numbers = Numbers(7);
    let pose = part_pose();
    let mut found_by_number = [0; 17];
    for _ in 0..count {
        let mut asked = random(chain, &mut numbers);
        for (position, prescribed) in asked.iter_mut().zip(prescribed) {
            *position = prescribed.unwrap_or(*position);
        }
        let mount = chain.part_from_mount(&asked, &pose);
        let (place, attitude) = (mount * BALL, mount.rotation);
        let found = chain.postures((&place, &attitude), prescribed, &asked, &pose, &BALL);
        for posture in &found {
            let reached = chain.part_from_mount(posture, &pose);
            assert!(
                (reached * BALL - place).norm() < 1e-9,
                "{asked:?} {posture:?}"
            );
            assert!(reached.rotation.angle_to(&attitude) < 1e-7);
            for (axis, position) in posture.iter().enumerate() {
                let (lower, upper) = chain.axis(axis).limits.unwrap();
                assert!((lower..=upper).contains(position));
            }
        }
        let same = |posture: &&Vec<f64>| {
            let joints = posture.iter().zip(&asked);
            joints.map(|(a, b)| apart(*a, *b)).fold(0.0, f64::max) < 1e-6
        };
        let singular = chain.dexterity(&asked, prescribed, &pose, &BALL) < 1e-4;
        assert!(
            singular || found.iter().any(|one| same(&one)),
            "{asked:?} {found:?}"
        );
        found_by_number[found.len().min(16)] += 1;
    }
    found_by_number
}

#[test]
fn an_arm_with_three_parallel_axes_comes_back_from_ten_thousand_postures() {
    let chain = chain(THREE_PARALLEL);
    let found = round_trips(&chain, &[None; 6], 10_000);
    assert_eq!(
        found[9..].iter().sum::<u32>(),
        0,
        "at most eight: {found:?}"
    );
    assert!(found[4..].iter().sum::<u32>() > 1_000, "{found:?}");
}

#[test]
fn an_arm_with_a_spherical_wrist_comes_back_from_ten_thousand_postures() {
    let found = round_trips(&chain(&spherical_wrist()), &[None; 6], 10_000);
    assert_eq!(
        found[9..].iter().sum::<u32>(),
        0,
        "at most eight: {found:?}"
    );
    assert!(found[4..].iter().sum::<u32>() > 1_000, "{found:?}");
}

#[test]
fn a_rotary_table_under_the_part_stands_where_it_is_told() {
    let chain = chain(TURNTABLE);
    let mut prescribed = vec![None; 7];
    prescribed[chain.axis_index("C").unwrap()] = Some(0.8);
    round_trips(&chain, &prescribed, 2_000);
}

#[test]
fn an_arm_of_no_known_family_is_searched() {
    round_trips(&chain(&oblique()), &[None; 6], 20);
}

/// The search from many starts knows nothing of the closed form: whatever it finds, the closed form has found.
#[test]
fn the_closed_form_misses_no_posture_that_a_search_finds() {
    let (pose, mut numbers) = (part_pose(), Numbers(3));
    for text in [THREE_PARALLEL.to_owned(), spherical_wrist()] {
        let chain = chain(&text);
        for _ in 0..15 {
            let asked = random(&chain, &mut numbers);
            let mount = chain.part_from_mount(&asked, &pose);
            let target = Target {
                ball: mount * BALL,
                orientation: Some(mount.rotation),
            };
            let known = chain.postures(
                (&target.ball, &mount.rotation),
                &[None; 6],
                &asked,
                &pose,
                &BALL,
            );
            for _ in 0..60 {
                let start = random(&chain, &mut numbers);
                let Ok(found) = chain.reach(&target, &[None; 6], &start, &pose, &BALL) else {
                    continue;
                };
                let same = |posture: &Vec<f64>| {
                    let joints = posture.iter().zip(&found);
                    joints.map(|(a, b)| apart(*a, *b)).fold(0.0, f64::max) < 1e-4
                };
                let singular = chain.dexterity(&found, &[None; 6], &pose, &BALL) < 1e-3;
                assert!(
                    singular || known.iter().any(same),
                    "{found:?} is not among {known:?}"
                );
            }
        }
    }
}

/// Straight out and up: A1 turns freely where the wrist stands over it, A4 and A6 turn against each other where A5 is 0.
#[test]
fn in_singularities_the_dexterity_is_nil_and_a_posture_is_still_found() {
    let chain = chain(&spherical_wrist());
    for asked in [
        [0.3, -0.9, 1.4, 0.4, 0.0, 0.2],
        [0.0, -1.2, 0.9, -0.7, 0.0, 0.9],
    ] {
        let pose = part_pose();
        let mount = chain.part_from_mount(&asked, &pose);
        assert!(chain.dexterity(&asked, &[None; 6], &pose, &BALL) < 1e-9);
        let place = mount * BALL;
        let found = chain.postures((&place, &mount.rotation), &[None; 6], &asked, &pose, &BALL);
        assert!(!found.is_empty());
        for posture in found {
            assert!((chain.part_from_mount(&posture, &pose) * BALL - place).norm() < 1e-9);
        }
    }
}

#[test]
fn what_is_out_of_reach_or_no_arm_has_no_posture() {
    let (pose, up) = (Isometry3::identity(), UnitQuaternion::identity());
    let far = Point3::new(4.0, 0.0, 0.0);
    let arm = chain(THREE_PARALLEL);
    assert!(
        arm.postures((&far, &up), &[None; 6], &[0.0; 6], &pose, &BALL)
            .is_empty()
    );
    let mill = chain(include_str!("../../../../launch-scripts/three_axis.urdf"));
    let here = Point3::new(0.0, 0.0, 0.1);
    let found = mill.postures((&here, &up), &[None; 3], &[0.0; 3], &pose, &BALL);
    assert!(found.is_empty());
}
