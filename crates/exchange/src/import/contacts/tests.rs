//! A ball over three points of a plane, by poses and a contact signal.

use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint, Stylus};

use super::{Motion, Read, Settings, read};
use crate::ImportError;
use crate::import::frame::identity;

/// m/s, towards the surface.
const FEED: f64 = 10e-3;

/// Three points of a plane, and settings of a recording of the ball's centre over them.
fn settings() -> Settings {
    let point = |x: f64| InspectionPoint {
        position: [x, 0.0, 0.0].into(),
        normal: [0.0, 0.0, 1.0].into(),
        operation: -1,
        ..InspectionPoint::default()
    };
    Settings {
        plan: InspectionPlan {
            plan_id: "plane".to_owned(),
            part_pose: identity(),
            stylus: Stylus {
                ball_radius: 1e-3,
                ..Stylus::default()
            },
            features: vec![InspectionFeature {
                id: "plane".to_owned(),
                kind: InspectionFeature::SURFACE,
                axis: [0.0, 0.0, 1.0].into(),
                lower_tolerance: f64::NEG_INFINITY,
                upper_tolerance: f64::INFINITY,
                ..InspectionFeature::default()
            }],
            points: [0.0, 0.01, 0.02].map(point).to_vec(),
            ..InspectionPlan::default()
        },
        machine: None,
        delay: 0.0,
        time_uncertainty: 1e-3,
        within: 2e-3,
        position_limit: 20e-6,
        skip_strays: false,
    }
}

/// The ball goes down on each point from 5 mm above it, stops 20 µm below the surface, and goes up again twice as fast. Positions come
/// every `period`; gives the contacts as well.
fn motion(period: f64) -> (Motion, Vec<f64>) {
    let contacts: Vec<f64> = (0..3)
        .map(|point| f64::from(point) * 2.0 + 0.5037)
        .collect();
    let height = |since: f64| {
        if since < 2e-3 {
            -FEED * since
        } else {
            -FEED * 2e-3 + 2.0 * FEED * (since - 0.03).max(0.0)
        }
    };
    let samples = (0..(6.0 / period) as u32).map(|index| {
        let at = f64::from(index) * period;
        let point = (at / 2.0).floor().min(2.0);
        let up = height(at - contacts[point as usize]).min(5e-3);
        (at, vec![0.01 * point, 0.0, 1e-3 + up])
    });
    let samples = samples.collect();
    let joints = Vec::new();
    (Motion { joints, samples }, contacts)
}

/// High from each contact on, until the ball has left the surface for 10 ms.
fn signal(contacts: &[f64], rest: bool) -> Vec<(f64, bool)> {
    let mut signal = vec![(0.0, rest)];
    for at in contacts {
        signal.extend([(*at, !rest), (at + 0.041, rest)]);
    }
    signal.push((6.0, rest));
    signal
}

fn heights(read: &Read) -> Vec<f64> {
    let events = read.imported.events.iter();
    events.map(|event| event.tip.z - 1e-3).collect()
}

fn refusal(read: Result<Read, ImportError>) -> String {
    read.map(|_| ()).expect_err("refused").to_string()
}

#[test]
fn a_signal_that_is_high_at_rest_is_told_by_where_the_ball_goes() {
    let (motion, contacts) = motion(0.01);
    let right = read(&motion, &signal(&contacts, false), &settings()).expect("touches");
    assert!(heights(&right).iter().all(|height| height.abs() < 1e-6));
    let told = refusal(read(&motion, &signal(&contacts, true), &settings()));
    assert!(
        told.contains("at 3 of 3 rises") && told.contains("--normally-closed"),
        "{told}"
    );
}

#[test]
fn a_contact_in_a_pause_of_the_positions_is_refused_by_number() {
    let (mut motion, contacts) = motion(0.01);
    motion
        .samples
        .retain(|(at, _)| !(contacts[1] - 0.3..contacts[1] + 0.6).contains(at));
    let told = refusal(read(&motion, &signal(&contacts, false), &settings()));
    assert!(
        told.starts_with("contact 2 at 2.503700 s: no position is recorded for 0.9"),
        "{told}"
    );
    let skipping = Settings {
        skip_strays: true,
        ..settings()
    };
    let skipped = read(&motion, &signal(&contacts, false), &skipping).expect("touches");
    assert_eq!(
        (skipped.imported.counts.refused, heights(&skipped).len()),
        (1, 2)
    );
    assert!(heights(&skipped).iter().all(|height| height.abs() < 1e-6));
}

#[test]
fn an_interpolated_position_is_within_its_bound_or_refused() {
    let (motion, contacts) = motion(0.2);
    let told = refusal(read(&motion, &signal(&contacts, false), &settings()));
    assert!(
        told.starts_with("contact 1 at 0.503700 s") && told.contains("--position-limit-um"),
        "{told}"
    );
    let wide = Settings {
        position_limit: 10e-3,
        ..settings()
    };
    let read = read(&motion, &signal(&contacts, false), &wide).expect("touches");
    let worst = heights(&read).into_iter().map(f64::abs).fold(0.0, f64::max);
    assert!(
        worst > 100e-6 && worst <= read.position_bound,
        "{worst} {}",
        read.position_bound
    );
}

#[test]
fn a_polled_signal_gives_the_middle_of_its_period_and_a_bound() {
    let (motion, contacts) = motion(0.01);
    let level = |at: f64| {
        contacts
            .iter()
            .any(|contact| (*contact..contact + 0.041).contains(&at))
    };
    let polled = |period: f64| -> Vec<(f64, bool)> {
        let instants = (0..(6.0 / period) as u32).map(|index| f64::from(index) * period);
        instants.map(|at| (at, level(at))).collect()
    };
    let found = read(&motion, &polled(3.3e-3), &settings()).expect("touches");
    let worst = heights(&found)
        .into_iter()
        .map(f64::abs)
        .fold(0.0, f64::max);
    assert!(
        worst <= found.position_bound && found.position_bound < 20e-6,
        "{worst}"
    );
    assert!(
        found
            .imported
            .remarks
            .iter()
            .any(|one| one.contains("polled every 3.3 ms"))
    );
    let told = refusal(read(&motion, &polled(0.0203), &settings()));
    assert!(
        told.contains("its instant is known to 10.1 ms and the position to 1"),
        "{told}"
    );
    // A level that is repeated beside its changes comes when it changes.
    let mut repeated = signal(&contacts, false);
    repeated
        .extend((0..6).map(|second| (f64::from(second) + 0.17, level(f64::from(second) + 0.17))));
    repeated.sort_by(|a, b| a.0.total_cmp(&b.0));
    let found = read(&motion, &repeated, &settings()).expect("touches");
    assert!(heights(&found).iter().all(|height| height.abs() < 1e-6));
}

#[test]
fn a_retract_through_the_positions_of_its_approach_is_of_one_publisher() {
    let (mut motion, contacts) = motion(0.01);
    // Sampled on the same places, so that what goes up repeats what has gone down.
    for (_, place) in &mut motion.samples {
        place[2] = (place[2] / 100e-6).round() * 100e-6;
    }
    assert!(read(&motion, &signal(&contacts, false), &settings()).is_ok());
}
