//! Recordings of other cells, ../shared/trials/dev: every touch's deviation against NumPy, every plan ordered again.

#![allow(clippy::print_stdout, reason = "figures are printed")]

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::Command,
};

use analysis::AnalysisNode;
use bags::{Bag, Session};
use cell_tests::messages;
use graph::{Executor, Running, Stamp, topics};
use machine::{Chain, Nominal};
use path_planning::{MotionRules, Seed};
use probecell_msgs::{
    FeatureResult, InspectionPlan, ProbeEvent, ProbingMove, TouchDeviation, to_cdr,
};

/// The bags; none, noted in `target/skipped.txt`, where they are not there.
fn dev_bags() -> Vec<PathBuf> {
    let bags = shared_data::bags("trials/dev");
    assert!(bags.is_empty() || bags.len() >= 37, "{} bags", bags.len());
    bags
}

fn session(path: &Path) -> Session {
    let bag = Bag::open(path).unwrap_or_else(|error| panic!("{error}"));
    Session::read(&bag).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The plan and touches of a session through the analysis node, on virtual time.
fn analysed(session: &Session) -> (Vec<TouchDeviation>, BTreeMap<String, FeatureResult>) {
    let chain = Chain::from_urdf(&session.robot_description).expect("a chain");
    let config = analysis::RawConfig::default()
        .check(chain)
        .expect("defaults");
    let first = Stamp(session.events[0].log_time as i64).after_s(-1.0);
    let mut executor =
        Executor::new(vec![Box::new(Running::<AnalysisNode>::new(config))], first).expect("wiring");
    executor.inject(
        first,
        topics::INSPECTION_PLAN.name,
        to_cdr(session.plan.as_ref().expect("a plan")),
    );
    for event in &session.events {
        executor.inject(
            Stamp(event.log_time as i64),
            topics::PROBE_EVENTS.name,
            to_cdr(&event.message),
        );
    }
    executor.run_until(Stamp(i64::MAX));
    let log = executor.take_log();
    let faults: Vec<probecell_msgs::Fault> = messages(&log, topics::ANALYSIS_FAULTS.name);
    assert!(faults.is_empty(), "{faults:?}");
    let results: Vec<FeatureResult> = messages(&log, topics::FEATURE_RESULTS.name);
    let features = results
        .into_iter()
        .map(|result| (result.feature_id.clone(), result))
        .collect();
    (messages(&log, topics::TOUCH_DEVIATIONS.name), features)
}

/// Deviations by NumPy for each bag, by event number; `None` where no Python with what it needs is there.
fn by_numpy(bags: &[PathBuf]) -> Option<Vec<BTreeMap<String, f64>>> {
    let python = shared_data::python("numpy, mcap_ros2")?;
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/main/numpy_deviations.py"
    );
    let output = Command::new(&python)
        .arg(script)
        .args(bags)
        .output()
        .expect("Python");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let lines = String::from_utf8(output.stdout).expect("text");
    let of_line = |line: &str| {
        let mut value: serde_json::Value = serde_json::from_str(line).expect("JSON");
        serde_json::from_value(value["deviations"].take()).expect("numbers")
    };
    Some(lines.lines().map(of_line).collect())
}

#[test]
fn each_deviation_is_the_contracts_as_numpy_computes_it() {
    let bags = dev_bags();
    let Some(expected) = (!bags.is_empty()).then(|| by_numpy(&bags)).flatten() else {
        return;
    };
    assert_eq!(expected.len(), bags.len());
    let mut touches = 0;
    let mut largest: f64 = 0.0;
    for (path, expected) in bags.iter().zip(&expected) {
        let (deviations, features) = analysed(&session(path));
        assert_eq!(deviations.len(), expected.len(), "{}", path.display());
        assert!(!features.is_empty(), "{}", path.display());
        for touch in &deviations {
            let other = expected[&touch.sequence.to_string()];
            let difference = (touch.deviation - other).abs();
            assert!(
                difference < 1e-9,
                "{} event {}: {difference:e} m",
                path.display(),
                touch.sequence
            );
            largest = largest.max(difference);
            touches += 1;
        }
    }
    println!(
        "{touches} touches of {} bags, largest difference {largest:.1e} m",
        bags.len()
    );
    assert_eq!(touches, 4056);
}

/// The plan of the points touched, in the order of their first touches, and where the axes then stood.
fn touched(session: &Session, chain: &Chain) -> (InspectionPlan, Vec<Seed>) {
    let recorded = session.plan.as_ref().expect("a plan");
    let part_pose = Nominal::from_plan(recorded)
        .expect("a usable plan")
        .part_pose;
    let mut plan = InspectionPlan {
        points: Vec::new(),
        ..recorded.clone()
    };
    let mut seeds = Vec::new();
    let mut seen = std::collections::BTreeSet::new();
    for event in session.events.iter().map(|stamped| &stamped.message) {
        let event: &ProbeEvent = event;
        if seen.insert(event.point_index) {
            let positions = chain
                .positions(&event.axis_names, &event.axis_positions)
                .expect("positions");
            let fixed = plan.rotary_names.is_empty();
            let attitude = fixed.then(|| chain.part_from_mount(&positions, &part_pose).rotation);
            seeds.push(Seed {
                positions,
                attitude,
            });
            plan.points
                .push(recorded.points[event.point_index as usize].clone());
        }
    }
    (plan, seeds)
}

#[test]
fn each_plan_is_ordered_again_validly_and_no_longer_than_it_was_measured() {
    const OVERTRAVEL: f64 = 2e-3;
    let (mut given, mut found) = (0.0, 0.0);
    let bags = dev_bags();
    if bags.is_empty() {
        return;
    }
    for path in bags {
        let name = path.display();
        let session = session(&path);
        let chain = Chain::from_urdf(&session.robot_description).expect("a chain");
        let (plan, seeds) = touched(&session, &chain);
        let rules = MotionRules {
            chain: &chain,
            clearance: None,
            attitudes: None,
            overtravel: OVERTRAVEL,
            kicks: 2000,
        };
        let order = rules
            .order(&plan, &seeds)
            .unwrap_or_else(|error| panic!("{name}: {error}"));

        let mut once = order.order.clone();
        once.sort_unstable();
        assert!(
            once.iter().copied().eq(0..plan.points.len() as u32),
            "{name}: not each point once"
        );
        assert!(
            order.air_time <= order.given_air_time + 1e-9,
            "{name}: {} s",
            order.air_time
        );
        given += order.given_air_time;
        found += order.air_time;

        let part = Nominal::from_plan(&plan).expect("a usable plan");
        let mut touches = Vec::new();
        for one in &order.moves {
            for (index, &position) in one.axis_positions.iter().enumerate() {
                assert!(position.is_finite(), "{name}");
                if let Some((lower, upper)) = chain.axis(index).limits {
                    assert!(
                        (lower - 1e-9..=upper + 1e-9).contains(&position),
                        "{name}: axis {index} at {position}"
                    );
                }
            }
            let nominal = &plan.points[one.point_index as usize];
            let height = match one.kind {
                ProbingMove::APPROACH => nominal.approach_distance,
                ProbingMove::TOUCH => {
                    touches.push(one.point_index);
                    -OVERTRAVEL
                }
                ProbingMove::RETRACT => nominal.retract_distance,
                _ => continue,
            };
            let (point, normal) = &part.points[one.point_index as usize];
            let wanted = point + normal.into_inner() * (part.ball_radius + height);
            let reached = chain.ball_in_part(&one.axis_positions, &part.part_pose, &part.ball);
            let miss = (reached - wanted).norm();
            assert!(
                miss < 1e-6,
                "{name} point {}: {miss:e} m off the normal",
                one.point_index
            );
        }
        assert_eq!(
            touches, order.order,
            "{name}: the moves are not in the order"
        );
    }
    println!("moves between touches: {found:.1} s against {given:.1} s as measured");
    assert!(found <= given);
}
