//! All postures of an arm that bring the probe to one place in one attitude: inverse kinematics of six revolute joints.
//!
//! Two families are solved in closed form, each with up to eight postures: arms with a spherical wrist behind two parallel
//! axes (A2 and A3; most industrial robots), and arms whose axes A2, A3 and A4 are parallel and whose A5 and A6 intersect
//! (Universal Robots). Both reduce to the canonical subproblems of B. Paden ("Kinematics and Control of Robot
//! Manipulators", 1986) in the form of A. J. Elias and J. T. Wen, "IK-Geo: Unified robot inverse kinematics using subproblem
//! decomposition" (2022), on the screws of the joints at position 0 seen from the part:
//!
//! ```text
//!   E = T·M⁻¹ = e₁·e₂·…·e₆      T wanted, M at position 0; eᵢ a rotation of qᵢ about axis i (point pᵢ, direction hᵢ)
//! ```
//!
//! The family is found by the description, not by a name, within what a description in six decimals leaves. Each posture
//! is then brought to full accuracy by [`Chain::reach`], which also makes up for axes that are nearly, not exactly, parallel
//! (a calibrated description). Other arms are solved by that search from many starts; it may miss a posture, and that is
//! all there is of a guarantee. Travels are kept, collisions are not known. Metres, radians, part frame.

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};

use crate::{
    chain::{Chain, JointKind, Side},
    inverse::Target,
};

/// Joints of an arm.
const JOINTS: usize = 6;
/// Directions within this angle count as parallel (rad), lines within this distance as intersecting (m).
const ALIKE: f64 = 1e-4;
/// Two postures are the same when no joint is farther apart, rad.
const SAME: f64 = 1e-4;
/// How far [`Chain::reach`] may correct a closed-form posture, rad.
const CORRECTION: f64 = 0.05;
/// Starts of the search for arms of no known family; it ends after so many in a row that found nothing new.
const STARTS: u32 = 300;
const IN_VAIN: u32 = 200;
/// Iterations of one of them: most starts that lead to a posture do so in fewer.
const ITERATIONS: usize = 40;
/// Bases of the Halton sequence (J. H. Halton, Numerische Mathematik 2, 1960) of those starts.
const BASES: [u32; JOINTS] = [2, 3, 5, 7, 11, 13];

/// A joint at position 0, seen from the part.
#[derive(Clone, Copy, Debug)]
struct Screw {
    point: Vector3<f64>,
    direction: Unit<Vector3<f64>>,
}

impl Screw {
    fn turned(&self, angle: f64, vector: &Vector3<f64>) -> Vector3<f64> {
        UnitQuaternion::from_axis_angle(&self.direction, angle) * vector
    }

    fn moved(&self, angle: f64, point: &Vector3<f64>) -> Vector3<f64> {
        self.point + self.turned(angle, &(point - self.point))
    }

    fn is_parallel(&self, other: &Self) -> bool {
        self.direction.cross(&other.direction).norm() < ALIKE
    }

    /// The point nearest to another axis, where that one meets it.
    fn meets(&self, other: &Self) -> Option<Vector3<f64>> {
        let normal = self.direction.cross(&other.direction);
        let square = normal.norm_squared();
        if square.sqrt() < ALIKE {
            return None;
        }
        let apart = other.point - self.point;
        let near = apart.dot(&normal).abs() / square.sqrt() < ALIKE;
        let along = apart.cross(&other.direction).dot(&normal) / square;
        near.then(|| self.point + self.direction.into_inner() * along)
    }

    fn is_through(&self, point: &Vector3<f64>) -> bool {
        self.direction.cross(&(point - self.point)).norm() < ALIKE
    }
}

/// What is known of an arm in closed form.
#[derive(Clone, Copy, Debug)]
enum Family {
    /// A4, A5 and A6 meet in this point at position 0; A2 is parallel to A3.
    SphericalWrist(Vector3<f64>),
    /// A5 and A6 meet in this point at position 0; A2, A3 and A4 are parallel.
    ThreeParallel(Vector3<f64>),
}

fn family(arm: &[Screw; JOINTS]) -> Option<Family> {
    let [_, second, third, fourth, fifth, sixth] = arm;
    if !second.is_parallel(third) {
        return None;
    }
    let wrist = fifth.meets(sixth)?;
    if fourth.is_through(&wrist) {
        Some(Family::SphericalWrist(wrist))
    } else if second.is_parallel(fourth) {
        Some(Family::ThreeParallel(wrist))
    } else {
        None
    }
}

/// Angles θ at which h·R(k, θ)·p = d: none, one or two.
fn in_plane(h: &Vector3<f64>, k: &Unit<Vector3<f64>>, p: &Vector3<f64>, d: f64) -> Vec<f64> {
    let along = k.dot(p);
    let (a, b) = (h.dot(p) - h.dot(k) * along, h.dot(&k.cross(p)));
    let (size, wanted) = (a.hypot(b), d - h.dot(k) * along);
    if size < 1e-12 {
        // Any angle does: the arm stands in a singularity.
        return vec![0.0];
    }
    let (middle, cosine) = (b.atan2(a), wanted / size);
    if cosine.abs() > 1.0 + 1e-6 {
        return Vec::new();
    }
    let half = cosine.clamp(-1.0, 1.0).acos();
    vec![middle - half, middle + half]
}

/// Angle about `k` from `p` to `q`, 0 where one of them lies along `k`.
fn about(k: &Unit<Vector3<f64>>, p: &Vector3<f64>, q: &Vector3<f64>) -> f64 {
    let across = |v: &Vector3<f64>| v - k.into_inner() * k.dot(v);
    let (p, q) = (across(p), across(q));
    if p.norm() < 1e-9 || q.norm() < 1e-9 {
        return 0.0;
    }
    k.dot(&p.cross(&q)).atan2(p.dot(&q))
}

/// Angle of a rotation about `k`.
fn angle_of(k: &Unit<Vector3<f64>>, rotation: &UnitQuaternion<f64>) -> f64 {
    let least = k.iamin();
    let across = k.cross(&Vector3::ith(least, 1.0));
    about(k, &across, &(rotation * across))
}

/// Joint positions of the arm for a displacement from position 0, unchecked.
fn closed_form(
    arm: &[Screw; JOINTS],
    family: Family,
    wanted: &Isometry3<f64>,
) -> Vec<[f64; JOINTS]> {
    let (Family::SphericalWrist(wrist) | Family::ThreeParallel(wrist)) = family;
    let [first, second, ..] = arm;
    let turn = |screw: &Screw, angle: f64| UnitQuaternion::from_axis_angle(&screw.direction, angle);
    let reached = (wanted * Point3::from(wrist)).coords;
    let (arm_plane, height) = (
        second.direction.into_inner(),
        second.direction.dot(&(wrist - first.point)),
    );
    let mut postures = Vec::new();
    for back in in_plane(
        &arm_plane,
        &first.direction,
        &(reached - first.point),
        height,
    ) {
        // Without the first joint.
        let to = first.moved(back, &reached);
        let rotation = turn(first, back) * wanted.rotation;
        let found = match family {
            Family::SphericalWrist(_) => behind_elbow(arm, &wrist, &to)
                .into_iter()
                .flat_map(|[q2, q3]| {
                    let left = (turn(second, q2) * turn(&arm[2], q3)).inverse() * rotation;
                    wrist_angles(arm, &left).map(move |[q4, q5, q6]| [-back, q2, q3, q4, q5, q6])
                })
                .collect(),
            Family::ThreeParallel(_) => three_parallel(arm, &wrist, &to, &rotation)
                .into_iter()
                .map(|[q2, q3, q4, q5, q6]| [-back, q2, q3, q4, q5, q6])
                .collect::<Vec<_>>(),
        };
        postures.extend(found);
    }
    postures
}

/// Positions of A2 and A3 that bring `point` (carried by A3) to `to`.
fn behind_elbow(arm: &[Screw; JOINTS], point: &Vector3<f64>, to: &Vector3<f64>) -> Vec<[f64; 2]> {
    let [_, second, third, ..] = arm;
    let (lever, base) = (point - third.point, second.point - third.point);
    // Only what lies across the axes turns.
    let across = |v: Vector3<f64>| v - second.direction.into_inner() * second.direction.dot(&v);
    let (lever, base, distance) = (across(lever), across(base), across(to - second.point));
    let dot = 0.5 * (lever.norm_squared() + base.norm_squared() - distance.norm_squared());
    let elbows = in_plane(&base, &third.direction, &lever, dot).into_iter();
    elbows
        .map(|q3| {
            let at = third.moved(q3, point) - second.point;
            [about(&second.direction, &at, &(to - second.point)), q3]
        })
        .collect()
}

/// Positions of A4, A5 and A6 of a wrist whose axes meet.
fn wrist_angles(
    arm: &[Screw; JOINTS],
    left: &UnitQuaternion<f64>,
) -> impl Iterator<Item = [f64; 3]> + use<> {
    let [_, _, _, fourth, fifth, sixth] = *arm;
    let left = *left;
    let (h4, h6) = (fourth.direction.into_inner(), sixth.direction.into_inner());
    let bends = in_plane(&h4, &fifth.direction, &h6, h4.dot(&(left * h6)));
    bends.into_iter().map(move |q5| {
        let q4 = about(&fourth.direction, &fifth.turned(q5, &h6), &(left * h6));
        let turn = |screw: &Screw, angle| UnitQuaternion::from_axis_angle(&screw.direction, angle);
        let last = (turn(&fourth, q4) * turn(&fifth, q5)).inverse() * left;
        [q4, q5, angle_of(&sixth.direction, &last)]
    })
}

/// Positions of A2 to A6 of an arm with three parallel axes that bring the wrist to `to`, turned by `rotation`.
fn three_parallel(
    arm: &[Screw; JOINTS],
    wrist: &Vector3<f64>,
    to: &Vector3<f64>,
    rotation: &UnitQuaternion<f64>,
) -> Vec<[f64; 5]> {
    let [_, second, third, fourth, fifth, sixth] = arm;
    let turn = |screw: &Screw, angle| UnitQuaternion::from_axis_angle(&screw.direction, angle);
    let (h2, h6) = (second.direction.into_inner(), sixth.direction.into_inner());
    let signs = [third, fourth].map(|axis| h2.dot(&axis.direction).signum());
    let mut postures = Vec::new();
    for q5 in in_plane(&h2, &fifth.direction, &h6, h2.dot(&(rotation * h6))) {
        let seen = turn(fifth, -q5) * h2;
        let q6 = -about(&sixth.direction, &seen, &(rotation.inverse() * h2));
        let lower = rotation * (turn(fifth, q5) * turn(sixth, q6)).inverse();
        let all = angle_of(&second.direction, &lower);
        // Where A4 has to be.
        let fourth_at = to - lower * (wrist - fourth.point);
        for [q2, q3] in behind_elbow(arm, &fourth.point, &fourth_at) {
            let q4 = signs[1] * (all - q2 - signs[0] * q3);
            postures.push([q2, q3, q4, q5, q6]);
        }
    }
    postures
}

/// Number `index` of the van der Corput sequence of a base, 0 to 1; several bases make a Halton sequence.
pub fn van_der_corput(mut index: u32, base: u32) -> f64 {
    let (mut share, mut digit) = (0.0, 1.0 / f64::from(base));
    while index > 0 {
        share += digit * f64::from(index % base);
        digit /= f64::from(base);
        index /= base;
    }
    share
}

/// A turn that takes one direction to another; where they are opposite, half a turn about some axis across them.
pub fn turn_onto(from: &Unit<Vector3<f64>>, to: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between_axis(from, to).unwrap_or_else(|| {
        let across = Unit::new_normalize(from.cross(&Vector3::ith(from.iamin(), 1.0)));
        UnitQuaternion::from_axis_angle(&across, std::f64::consts::PI)
    })
}

impl Chain {
    /// All postures found that bring the ball (`ball` in the probe mount) to a place of the part in an attitude (part from
    /// probe mount). Each joint is given at the turn nearest to `near` within its travel; other full turns of the same
    /// posture are left out. `prescribed` and `near` are in the order of [`Self::axes`]; `None` marks the free axes, which
    /// must be six that can place and turn the probe. None where there are others, and where nothing reaches.
    pub fn postures(
        &self,
        (place, attitude): (&Point3<f64>, &UnitQuaternion<f64>),
        prescribed: &[Option<f64>],
        near: &[f64],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> Vec<Vec<f64>> {
        let axes = self.axes().len();
        let free: Vec<usize> = (0..axes)
            .filter(|&axis| prescribed[axis].is_none())
            .collect();
        let Ok(free) = <[usize; JOINTS]>::try_from(free) else {
            return Vec::new();
        };
        let target = Target {
            ball: *place,
            orientation: Some(*attitude),
        };
        let zero: Vec<f64> = prescribed.iter().map(|q| q.unwrap_or(0.0)).collect();
        let arm = self.screws(&free, &zero, part_pose, ball);
        let known = arm.and_then(|arm| Some((arm, family(&arm)?)));
        let starts: Vec<[f64; JOINTS]> = match known {
            Some((arm, family)) => {
                let mount = place.coords - attitude * ball.coords;
                let wanted = Isometry3::from_parts(mount.into(), *attitude)
                    * self.part_from_mount(&zero, part_pose).inverse();
                closed_form(&arm, family, &wanted)
            }
            None => (1..=STARTS).map(|start| self.start(&free, start)).collect(),
        };
        let mut postures: Vec<Vec<f64>> = Vec::new();
        let mut in_vain = 0;
        for start in starts {
            if known.is_none() {
                in_vain += 1;
                if in_vain > IN_VAIN {
                    break;
                }
            }
            let mut at = zero.clone();
            for (&axis, angle) in free.iter().zip(start) {
                at[axis] = self.nearest_turn(axis, angle, near[axis]).unwrap_or(angle);
            }
            let reached = self.reach_within(ITERATIONS, &target, prescribed, &at, part_pose, ball);
            let Ok(mut found) = reached else {
                continue;
            };
            let corrected = free.iter().map(|&axis| (found[axis] - at[axis]).abs());
            if known.is_some() && corrected.fold(0.0, f64::max) > CORRECTION {
                continue;
            }
            for &axis in &free {
                found[axis] =
                    (self.nearest_turn(axis, found[axis], near[axis])).unwrap_or(found[axis]);
            }
            let same = |known: &Vec<f64>| {
                let apart = known.iter().zip(&found).map(|(a, b)| (a - b).abs());
                apart.fold(0.0, f64::max) < SAME
            };
            if !postures.iter().any(same) {
                postures.push(found);
                in_vain = 0;
            }
        }
        postures
    }

    /// How far a posture is from a singularity: the least speed of the probe, in m/s and rad/s at the lever of
    /// [`Self::reach`], at unit speed (rad/s) of the free joints together. 0 in a singularity.
    pub fn dexterity(
        &self,
        positions: &[f64],
        prescribed: &[Option<f64>],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> f64 {
        let free: Vec<usize> = (0..self.axes().len())
            .filter(|&axis| prescribed[axis].is_none())
            .collect();
        let jacobian = self.free_jacobian(positions, &free, part_pose, ball);
        jacobian
            .singular_values()
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
    }

    /// The six free joints at position 0, where all of them turn and carry the probe.
    fn screws(
        &self,
        free: &[usize; JOINTS],
        zero: &[f64],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> Option<[Screw; JOINTS]> {
        let turning = |&axis: &usize| {
            self.axis(axis).kind == JointKind::Revolute
                && self.carries(self.axes()[axis], Side::Tool)
        };
        if !free.iter().all(turning) {
            return None;
        }
        let seen = self.sensitivity(zero, part_pose, ball);
        Some(free.map(|axis| {
            let direction = Unit::new_normalize(seen.turns[axis]);
            // The foot of the perpendicular from the ball.
            let point = seen.ball.coords + direction.cross(&seen.axes[axis]);
            Screw { point, direction }
        }))
    }

    /// The same angle in the turn nearest to `near` that is within the travel of an axis.
    fn nearest_turn(&self, axis: usize, angle: f64, near: f64) -> Option<f64> {
        use std::f64::consts::TAU;
        let joint = self.axis(axis);
        if joint.kind != JointKind::Revolute {
            return Some(angle);
        }
        let nearest = near + (angle - near + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
        let (least, most) = joint.limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let turns = [0.0, -TAU, TAU, -2.0 * TAU, 2.0 * TAU].into_iter();
        turns
            .map(|turn| nearest + turn)
            .find(|angle| (least..=most).contains(angle))
    }

    /// A start of the search, within the travels.
    fn start(&self, free: &[usize; JOINTS], number: u32) -> [f64; JOINTS] {
        let mut start = [0.0; JOINTS];
        for ((&axis, base), value) in free.iter().zip(BASES).zip(&mut start) {
            let joint = self.axis(axis);
            let most = match joint.kind {
                JointKind::Revolute => std::f64::consts::PI,
                _ => 1.0,
            };
            let (lower, upper) = joint.limits.unwrap_or((-most, most));
            *value = lower + (upper - lower) * van_der_corput(number, base);
        }
        start
    }
}
