//! A six-axis arm whose flange a laser tracker follows: nominal Denavit–Hartenberg parameters, real ones, gravity.

use std::f64::consts::FRAC_PI_2;
use std::fmt::Write;

use diagnosis::Session;

use super::{Chance, Reading, V, session};

/// a, alpha, d, offset of each joint (standard Denavit–Hartenberg), m and rad.
const NOMINAL: [[f64; 4]; 6] = [
    [0.15, -FRAC_PI_2, 0.45, 0.0],
    [0.6, 0.0, 0.0, -FRAC_PI_2],
    [0.12, -FRAC_PI_2, 0.0, 0.0],
    [0.0, FRAC_PI_2, 0.62, 0.0],
    [0.0, -FRAC_PI_2, 0.0, 0.0],
    [0.0, 0.0, 0.1, 0.0],
];
const NAMES: [&str; 6] = ["A1", "A2", "A3", "A4", "A5", "A6"];
/// The reflector in the flange, m.
const REFLECTOR: V = [0.03, 0.0, 0.05];

/// What is wrong with the arm.
#[derive(Clone, Copy)]
pub(crate) struct Errors {
    /// Zeros of the joints, rad.
    pub(crate) zeros: [f64; 6],
    /// Of the third and the fifth parameter a and d, m.
    pub(crate) lengths: [f64; 2],
    /// Turn of the second and third joint for each metre of the reflector's horizontal lever, rad/m.
    pub(crate) sag: [f64; 2],
    pub(crate) noise: f64,
}

type M = [[f64; 4]; 4];

fn product(a: &M, b: &M) -> M {
    std::array::from_fn(|i| std::array::from_fn(|k| (0..4).map(|j| a[i][j] * b[j][k]).sum()))
}

fn link([a, alpha, d, offset]: [f64; 4], q: f64) -> M {
    let ((s, c), (sa, ca)) = ((q + offset).sin_cos(), alpha.sin_cos());
    [
        [c, -s * ca, s * sa, a * c],
        [s, c * ca, -c * sa, a * s],
        [0.0, sa, ca, d],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// Reflector in the base, and the origin of each joint's axis with its direction.
fn reflector(links: &[[f64; 4]; 6], q: &[f64; 6]) -> (V, Vec<(V, V)>) {
    let mut pose: M = std::array::from_fn(|i| std::array::from_fn(|k| f64::from(u8::from(i == k))));
    let mut axes = Vec::new();
    for (own, &q) in links.iter().zip(q) {
        axes.push(([0, 1, 2].map(|i| pose[i][3]), [0, 1, 2].map(|i| pose[i][2])));
        pose = product(&pose, &link(*own, q));
    }
    let at = [0, 1, 2].map(|i| (0..3).map(|k| pose[i][k] * REFLECTOR[k]).sum::<f64>() + pose[i][3]);
    (at, axes)
}

/// Where the reflector of the real arm is.
fn really(errors: &Errors, q: &[f64; 6]) -> V {
    let mut links = NOMINAL;
    for (own, zero) in links.iter_mut().zip(errors.zeros) {
        own[3] += zero;
    }
    links[2][0] += errors.lengths[0];
    links[3][2] += errors.lengths[1];
    let (at, axes) = reflector(&links, q);
    let mut bent = *q;
    for (joint, sag) in [(1, errors.sag[0]), (2, errors.sag[1])] {
        let (origin, z) = axes[joint];
        let arm: V = std::array::from_fn(|i| at[i] - origin[i]);
        // What a turn about the joint lowers the reflector by.
        let down = -(z[0] * arm[1] - z[1] * arm[0]);
        bent[joint] += sag * down;
    }
    reflector(&links, &bent).0
}

fn urdf() -> String {
    let mut text = String::from(
        r#"<robot name="arm"><link name="foundation"/><link name="workpiece"/><joint name="table" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>"#,
    );
    let mut parent = "foundation".to_owned();
    let mut origin = [0.0; 4];
    for (name, own) in NAMES.iter().zip(NOMINAL) {
        write!(
            text,
            r#"<link name="{name}"/><joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}"/><origin xyz="{} 0 {}" rpy="{} 0 0"/><axis xyz="0 0 1"/><limit lower="-6.3" upper="6.3" effort="1" velocity="1"/></joint>"#,
            origin[0], origin[2], origin[1]
        ).unwrap();
        (*name).clone_into(&mut parent);
        origin = own;
    }
    write!(
        text,
        r#"<link name="probe_mount"/><joint name="flange" type="fixed"><parent link="{parent}"/><child link="probe_mount"/><origin xyz="{} 0 {}" rpy="{} 0 0"/></joint></robot>"#,
        origin[0], origin[2], origin[1]
    ).unwrap();
    text
}

/// `poses` poses, the first axis sweeping with time; the tracker stands turned by `turn` (about z) and `shift` off.
pub(crate) fn tracked(
    errors: &Errors,
    poses: usize,
    (turn, shift): (f64, V),
    seed: u64,
) -> Session {
    let mut chance = Chance::new(seed);
    let mut readings = Vec::new();
    for number in 0..poses {
        let share = number as f64 / poses as f64;
        let mut between = |low: f64, high: f64| low + (high - low) * chance.uniform();
        // The control counts its joints from its own zeros, here the offsets of the nominal parameters.
        let q = [
            -1.3 + 2.6 * share + between(-0.1, 0.1),
            between(-0.3, 1.0),
            between(-0.6, 0.7),
            between(-1.5, 1.5),
            between(-1.2, 1.2),
            between(-2.5, 2.5),
        ];
        let at = really(errors, &q);
        let (sin, cos) = turn.sin_cos();
        let seen = [
            cos * at[0] - sin * at[1] + shift[0],
            sin * at[0] + cos * at[1] + shift[1],
            at[2] + shift[2],
        ]
        .map(|part| part + errors.noise * chance.normal());
        // The robot description has no offsets: a joint turns from its nominal place.
        let read: Vec<f64> = q.iter().zip(NOMINAL).map(|(q, own)| q + own[3]).collect();
        for axis in 0..3 {
            let mut normal = [0.0; 3];
            normal[axis] = 1.0;
            readings.push(Reading {
                feature: number as u32,
                point: seen,
                normal,
                feed: 0.0,
                axes: read.clone(),
                time: 10.0 * number as f64,
            });
        }
    }
    session(
        &format!("arm {seed}"),
        &urdf(),
        &NAMES,
        (REFLECTOR, 0.0),
        &readings,
    )
}
