//! A positioning error that neither a scale nor a pitch can say is named, with the table that was made.

use diagnosis::{Options, Session, Verdict, diagnose};
use effects::session::perfect::with_nominal_touches;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, Stylus, geometry_msgs::Point,
    geometry_msgs::Vector3,
};

const MACHINE: &str = r#"<robot name="three_axis">
  <link name="foundation"/><link name="workpiece"/><link name="x"/><link name="y"/><link name="probe_mount"/>
  <joint name="clamping" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
  <joint name="X" type="prismatic"><parent link="foundation"/><child link="x"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="Y" type="prismatic"><parent link="x"/><child link="y"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="Z" type="prismatic"><parent link="y"/><child link="probe_mount"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"#;

/// Errors at the three inner targets of the table, m.
const TABLE: [f64; 3] = [6e-6, -5e-6, 4e-6];

/// A step gauge along X: faces to either side every 8 mm, four touches on each, and the floor between them.
fn step_gauge() -> Session {
    let (mut features, mut points) = (Vec::new(), Vec::new());
    let mut add = |x: f64, normal: [f64; 3]| {
        let vector = Vector3 {
            x: normal[0],
            y: normal[1],
            z: normal[2],
        };
        features.push(InspectionFeature {
            id: format!("face {}", features.len()),
            kind: InspectionFeature::PLANE,
            origin: Point { x, y: 0.0, z: 0.0 },
            axis: vector,
            ..InspectionFeature::default()
        });
        for (number, (y, z)) in [(-0.03, 0.01), (0.02, 0.012), (-0.01, 0.03), (0.035, 0.033)]
            .into_iter()
            .enumerate()
        {
            let flat = normal[2] > 0.0;
            points.push(InspectionPoint {
                feature: features.len() as u32 - 1,
                position: Point {
                    x: if flat { x + 0.2 * z } else { x },
                    y,
                    z: if flat { 0.0 } else { z },
                },
                normal: vector,
                feed: if number % 2 == 0 { 0.002 } else { 0.005 },
                operation: -1,
                ..InspectionPoint::default()
            });
        }
    };
    for step in 0..24 {
        let x = 0.008 * f64::from(step) + 0.0003 * f64::from(step % 3);
        add(x, [1.0, 0.0, 0.0]);
        add(x + 0.004, [-1.0, 0.0, 0.0]);
        add(x + 0.006, [0.0, 0.0, 1.0]);
    }
    let mut plan = InspectionPlan {
        plan_id: "step gauge".to_owned(),
        stylus: Stylus {
            id: "probe".to_owned(),
            ball_center: Point {
                x: 0.0,
                y: 0.0,
                z: -0.1,
            },
            ball_radius: 0.001,
        },
        features,
        points,
        ..InspectionPlan::default()
    };
    plan.part_pose.orientation.w = 1.0;
    with_nominal_touches(&Session {
        name: "step gauge".to_owned(),
        robot_description: MACHINE.to_owned(),
        plan: Some(plan),
        ..Session::default()
    })
    .unwrap()
}

/// Twelve uniform numbers of a linear congruential generator less their mean: nearly normal, of unit variance.
fn noise(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

#[test]
fn a_table_of_positioning_errors_is_named_and_measured() {
    let mut session = step_gauge();
    let read = |session: &Session| -> Vec<f64> {
        session
            .events
            .iter()
            .map(|event| event.axis_positions[0])
            .collect()
    };
    let positions = read(&session);
    let low = positions.iter().copied().fold(f64::INFINITY, f64::min);
    let high = positions.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let error = |q: f64| {
        let along = 4.0 * (q - low) / (high - low);
        let hat = |k: usize| (1.0 - (along - (k + 1) as f64).abs()).max(0.0);
        (0..3).map(|k| TABLE[k] * hat(k)).sum::<f64>()
    };
    let mut state = 7;
    for event in &mut session.events {
        assert_eq!(event.axis_names[0], "X");
        // The ball touches where it should: the axis reads too little where it has gone too far.
        let gone = error(event.axis_positions[0]);
        event.axis_positions[0] -= gone;
        for position in &mut event.axis_positions {
            *position += 5e-7 * noise(&mut state);
        }
    }
    let report = diagnose(&session, &Options::default()).unwrap();
    let named: Vec<&str> = report
        .effects
        .iter()
        .map(|one| one.effect.as_str())
        .collect();
    assert_eq!(named, ["axis.X.positioning"], "{report}");
    assert_eq!(report.verdict, Verdict::Explained);
    assert!(report.effects[0].rms_after < 0.3 * report.effects[0].rms_before);
    let value = |name: &str| {
        let mut parameters = report.effects[0].parameters.iter();
        parameters.find(|one| one.name == name).unwrap().value
    };
    for (target, truth) in ["e1", "e2", "e3"].into_iter().zip(TABLE) {
        let found = value(target);
        assert!(
            (found - truth).abs() < 5e-7,
            "{target}: {found:e} m for {truth:e} m"
        );
    }
    assert!((value("from") - low).abs() < 1e-4 && (value("to") - high).abs() < 1e-4);
}
