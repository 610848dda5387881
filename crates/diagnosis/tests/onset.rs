//! Streams of parts in which an effect begins at an unknown part: when it is named, as what, and how often falsely.
//!
//! The parts are rings of touches round a block, of a machine whose deviations are written down by hand: a ball that is too
//! small gives a constant, a part that has moved its shift along the normal. Nothing of the library makes them.
#![allow(clippy::unwrap_used, reason = "a test stops at what should not happen")]

use diagnosis::onset::{Change, Watch};
use diagnosis::{Options, Session};
use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent};
use statrs::distribution::{Binomial, DiscreteCDF};

const MACHINE: &str = r#"<robot name="block"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<link name="a"/><link name="b"/>
<joint name="table" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="0" velocity="0.3"/></joint>
<joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="0" velocity="0.3"/></joint>
<joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="0" velocity="0.3"/></joint></robot>"#;
/// m; ball, noise of a touch, spread of the clamping from part to part.
const BALL: f64 = 1e-3;
const NOISE: f64 = 1e-6;
const CLAMPING: f64 = 1e-6;

/// Numbers of a small generator (Steele, Lea and Flood 2014).
struct Numbers(u64);

impl Numbers {
    fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    }

    /// Box and Muller 1958.
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.share().max(1e-300).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.share()).cos()
    }
}

/// Normals and places of the touches: five on each side and on top of a block.
fn touches() -> Vec<([f64; 3], [f64; 3])> {
    let mut touches = Vec::new();
    for k in 0..5 {
        let along = -0.04 + 0.02 * f64::from(k);
        let deep = -0.005 - 0.004 * f64::from(k % 3);
        touches.push(([1.0, 0.0, 0.0], [0.05, along, deep]));
        touches.push(([-1.0, 0.0, 0.0], [-0.05, along, deep]));
        touches.push(([0.0, 1.0, 0.0], [along, 0.05, deep]));
        touches.push(([0.0, -1.0, 0.0], [along, -0.05, deep]));
        touches.push(([0.0, 0.0, 1.0], [along, 0.7 * along, 0.0]));
    }
    touches
}

/// What begins.
#[derive(Clone, Copy)]
enum Begins {
    Nothing,
    /// The ball is smaller, m: everything reads as much more material.
    Ball(f64),
    /// The part sits farther along X, m.
    Shift(f64),
}

fn part(number: u64, random: &mut Numbers, begins: Begins) -> Session {
    let clamping = [0; 3].map(|_| CLAMPING * random.normal());
    let mut plan = InspectionPlan {
        plan_id: format!("part {number}/measure"),
        ..InspectionPlan::default()
    };
    plan.part_pose.orientation.w = 1.0;
    plan.stylus.ball_radius = BALL;
    let mut events = Vec::new();
    for (index, (normal, place)) in touches().into_iter().enumerate() {
        let side = normal.map(f64::abs).iter().position(|n| *n > 0.5).unwrap() * 2
            + usize::from(normal.iter().sum::<f64>() > 0.0);
        if plan.features.len() <= side {
            plan.features.resize_with(side + 1, || {
                let mut feature = InspectionFeature::default();
                feature.axis.z = 1.0;
                feature
            });
        }
        let feature = &mut plan.features[side];
        feature.id = format!("side {side}");
        (feature.axis.x, feature.axis.y, feature.axis.z) = (normal[0], normal[1], normal[2]);
        (feature.origin.x, feature.origin.y, feature.origin.z) = (place[0], place[1], place[2]);
        let mut point = InspectionPoint {
            feature: side as u32,
            approach_distance: 3e-3,
            retract_distance: 3e-3,
            feed: 5e-3,
            operation: -1,
            ..InspectionPoint::default()
        };
        (point.position.x, point.position.y, point.position.z) = (place[0], place[1], place[2]);
        (point.normal.x, point.normal.y, point.normal.z) = (normal[0], normal[1], normal[2]);
        plan.points.push(point);
        let shifted = match begins {
            Begins::Shift(shift) => [clamping[0] + shift, clamping[1], clamping[2]],
            _ => clamping,
        };
        let ball = if let Begins::Ball(ball) = begins {
            -ball
        } else {
            0.0
        };
        let along: f64 = normal.iter().zip(shifted).map(|(n, shift)| n * shift).sum();
        let deviation = along + ball + NOISE * random.normal();
        let mut event = ProbeEvent {
            sequence: index as u64,
            plan_id: plan.plan_id.clone(),
            point_index: index as u32,
            outcome: ProbeEvent::OUTCOME_TOUCHED,
            axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
            axis_positions: (0..3)
                .map(|axis| place[axis] + normal[axis] * (BALL + deviation))
                .collect(),
            feed: 5e-3,
            ..ProbeEvent::default()
        };
        (event.approach.x, event.approach.y, event.approach.z) =
            (-normal[0], -normal[1], -normal[2]);
        event.header.stamp.sec = (1000 + 600 * number) as i32 + index as i32;
        events.push(event);
    }
    Session {
        name: "live".to_owned(),
        robot_description: MACHINE.to_owned(),
        plan: Some(plan),
        events,
        ..Session::default()
    }
}

/// Parts until something is found, or all of them.
fn watched(seed: u64, onset: u64, parts: u64, begins: Begins) -> (Option<Change>, u64) {
    let mut random = Numbers(seed.wrapping_mul(0x2545_F491_4F6C_DD1D));
    let mut watch = Watch::default();
    for number in 0..parts {
        let begins = if number >= onset {
            begins
        } else {
            Begins::Nothing
        };
        let found = watch
            .part(&part(number, &mut random, begins), &Options::default(), 1.0)
            .unwrap();
        if found.is_some() {
            return (found, number + 1);
        }
    }
    (None, parts)
}

/// 200 streams: a stylus ball that is 3 µm smaller, or a part that sits 4 µm farther, from a part on that nobody knows.
#[test]
fn an_effect_that_begins_is_named_with_its_onset() {
    let (mut delays, mut named, mut exact, mut early, mut missed, mut parts) =
        (Vec::new(), 0, 0, 0, 0, 0_u64);
    let streams = 200;
    for seed in 0..streams {
        let onset = 8 + (seed * 7) % 23;
        let (begins, cause) = if seed % 2 == 0 {
            (Begins::Ball(-3e-6), "probe.ball_radius")
        } else {
            (Begins::Shift(4e-6), "fixture.shift")
        };
        let (found, seen) = watched(seed + 1, onset, onset + 40, begins);
        parts += seen.min(onset);
        match found {
            Some(_) if seen <= onset => early += 1,
            Some(change) => {
                delays.push(seen - onset);
                let effect = change.cause.as_ref();
                named += u32::from(
                    effect.is_some_and(|effect| effect.group.iter().any(|name| name == cause)),
                );
                exact += u32::from(change.onset.abs_diff(onset + 1) <= 1);
                assert_eq!(change.part, seen);
                let first = 1000 + 600 * (change.onset as i64 - 1);
                assert_eq!(
                    change.since,
                    first * 1_000_000_000,
                    "the instant of its first touch"
                );
                assert!(effect.is_none_or(|effect| effect.remedy().is_some()));
            }
            None => missed += 1,
        }
    }
    delays.sort_unstable();
    let (median, late) = (delays[delays.len() / 2], delays[delays.len() * 9 / 10]);
    println!(
        "delay {median} parts in the median, 90 % within {late}; {named} of {} named, {exact} onsets within a part; \
         {early} early in {parts} parts, {missed} missed",
        delays.len()
    );
    let expected = Binomial::new(1e-3, parts).unwrap();
    assert!(
        early == 0 || 1.0 - expected.cdf(early - 1) > 0.05,
        "{early} false alarms in {parts} parts"
    );
    let found = delays.len() as u32;
    assert!(missed <= 2 && median <= 4 && late <= 10, "{delays:?}");
    assert!(
        named * 100 >= found * 95 && exact * 100 >= found * 90,
        "{named} {exact} of {found}"
    );
}

/// Parts that do not change raise nothing beyond the stated rate.
#[test]
fn parts_that_do_not_change_raise_nothing() {
    let (mut alarms, mut parts) = (0_u64, 0_u64);
    for seed in 0..20 {
        let (found, seen) = watched(5000 + seed, u64::MAX, 100, Begins::Nothing);
        alarms += u64::from(found.is_some());
        parts += seen;
    }
    let expected = Binomial::new(1e-3, parts).unwrap();
    println!("{alarms} false alarms in {parts} parts");
    assert!(
        alarms == 0 || 1.0 - expected.cdf(alarms - 1) > 0.05,
        "{alarms} in {parts}"
    );
}

/// At one feed a late trigger displaces a touch as a wrong ball does (feed times delay): only another feed tells them apart, and
/// the further touches of the finding ask for one.
#[test]
fn further_touches_discriminate_what_has_changed() {
    let (found, _) = watched(3, 10, 40, Begins::Ball(-3e-6));
    let change = found.unwrap();
    let group = change.cause.unwrap().group;
    let has = |name: &str| group.iter().any(|one| one == name);
    assert!(
        has("probe.ball_radius") && has("probe.trigger_latency"),
        "{group:?}"
    );
    assert!(!change.further.is_empty() && change.further.len() <= 8);
    let plan = part(0, &mut Numbers(1), Begins::Nothing).plan.unwrap();
    let sides = plan.features.len() as u32;
    assert!(change.further.iter().all(|point| point.feature < sides));
    let other_feed = |point: &InspectionPoint| (point.feed - 5e-3).abs() > 1e-3;
    assert!(
        change.further.iter().any(other_feed),
        "{:?}",
        change.further
    );
}
