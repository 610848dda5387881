//! Step by step: from touches to deviations and sizes.

use analysis::{AnalysisNode, Config, Input, Output, RawConfig, Width};
use graph::{Node, Outbox, Stamp};
use machine::Chain;
use probecell_msgs::{
    FeatureResult, InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent, Stylus,
    geometry_msgs::{Point, Pose, Quaternion, Vector3},
};

/// The probe moves freely; its ball of 2 mm has its centre in the mount's origin.
const ROBOT: &str = r#"<robot name="xyz"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<link name="a"/><link name="b"/>
<joint name="W" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="0" velocity="1"/></joint>
<joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="0" velocity="1"/></joint>
<joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="0" velocity="1"/></joint></robot>"#;
const BALL: f64 = 2e-3;

fn config() -> Config {
    let planes = ["right".to_owned(), "left".to_owned()];
    let width = Width {
        id: "L".to_owned(),
        planes,
        tolerance_um: [-10.0, 10.0],
    };
    let raw = RawConfig {
        widths: vec![width],
        repeat_limit_um: 6.0,
        ..RawConfig::default()
    };
    raw.check(Chain::from_urdf(ROBOT).expect("a chain"))
        .expect("sound settings")
}

/// A bore of 20 mm about Z with four points, and two planes 10 mm from the origin with one point each.
fn plan() -> InspectionPlan {
    let vector = |x: f64, y: f64| Vector3 { x, y, z: 0.0 };
    let feature = |id: &str, kind: u8, axis: Vector3, x: f64| InspectionFeature {
        id: id.to_owned(),
        kind,
        axis,
        origin: Point { x, y: 0.0, z: 0.0 },
        radius: 10e-3,
        lower_tolerance: -10e-6,
        upper_tolerance: 10e-6,
        ..Default::default()
    };
    let point = |feature: u32, x: f64, y: f64, normal: Vector3| InspectionPoint {
        feature,
        position: Point { x, y, z: 0.0 },
        normal,
        ..Default::default()
    };
    let quarter = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
    let mut points: Vec<InspectionPoint> = quarter
        .iter()
        .map(|&(x, y)| point(0, 10e-3 * x, 10e-3 * y, vector(-x, -y)))
        .collect();
    points.push(point(1, 10e-3, 0.0, vector(1.0, 0.0)));
    points.push(point(2, -10e-3, 0.0, vector(-1.0, 0.0)));
    InspectionPlan {
        plan_id: "p".to_owned(),
        part_pose: Pose {
            orientation: Quaternion {
                w: 1.0,
                ..Default::default()
            },
            ..Default::default()
        },
        stylus: Stylus {
            ball_radius: BALL,
            ..Default::default()
        },
        features: vec![
            feature(
                "bore",
                InspectionFeature::BORE,
                Vector3 {
                    x: 0.0,
                    y: 0.0,
                    z: 1.0,
                },
                0.0,
            ),
            feature("right", InspectionFeature::PLANE, vector(1.0, 0.0), 10e-3),
            feature("left", InspectionFeature::PLANE, vector(-1.0, 0.0), -10e-3),
        ],
        points,
        ..Default::default()
    }
}

/// A touch of a point at which that much material (m) is in excess.
fn touch(point_index: u32, excess: f64) -> ProbeEvent {
    let plan = plan();
    let point = &plan.points[point_index as usize];
    let out = BALL + excess;
    let positions = vec![
        point.position.x + point.normal.x * out,
        point.position.y + point.normal.y * out,
        0.0,
    ];
    ProbeEvent {
        plan_id: "p".to_owned(),
        point_index,
        axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
        axis_positions: positions,
        ..ProbeEvent::default()
    }
}

fn event(point_index: u32, excess_um: f64) -> Input {
    Input::Event(touch(point_index, excess_um * 1e-6))
}

/// Everything that the inputs make the node say, a line each.
fn check(inputs: Vec<Input>, expected: &[&str]) {
    let config = config();
    let mut state = AnalysisNode::start(&config);
    let mut out = Outbox::default();
    for input in inputs {
        AnalysisNode::step(&config, &mut state, Stamp(0), input, &mut out);
    }
    let said: Vec<String> = out.messages().iter().map(line).collect();
    assert_eq!(said, expected);
}

fn line(output: &Output) -> String {
    match output {
        Output::Deviation(one) => format!("{} {:+.3} µm", one.point_index, one.deviation * 1e6),
        Output::Feature(one) if one.decision == FeatureResult::INVALID => {
            format!("{} invalid: {}", one.feature_id, one.text)
        }
        Output::Feature(one) => {
            let decision =
                ["conforms", "does not conform", "indeterminate"][usize::from(one.decision)];
            format!("{} {:.4} mm {decision}", one.feature_id, one.size * 1e3)
        }
        Output::Alignment(one) => format!("placed by {:?} {}", one.feature_ids, one.text),
        Output::Fault(one) => one.code.clone(),
    }
}

#[test]
fn a_deviation_is_positive_where_material_is_in_excess() {
    check(
        vec![Input::Plan(plan()), event(4, 3.0)],
        &["4 +3.000 µm", "right 10.0030 mm conforms"],
    );
    check(vec![Input::Plan(plan()), event(0, -2.5)], &["0 -2.500 µm"]);
}

#[test]
fn a_feature_is_reported_when_its_last_point_has_been_tried() {
    // Material in excess makes a bore smaller: by twice 4 µm.
    check(
        vec![
            Input::Plan(plan()),
            event(3, 4.0),
            event(0, 4.0),
            event(2, 4.0),
            event(1, 4.0),
        ],
        &[
            "3 +4.000 µm",
            "0 +4.000 µm",
            "2 +4.000 µm",
            "1 +4.000 µm",
            "bore 19.9920 mm indeterminate",
        ],
    );
}

#[test]
fn a_width_is_reported_after_both_its_planes() {
    check(
        vec![Input::Plan(plan()), event(5, -20.0), event(4, -20.0)],
        &[
            "5 -20.000 µm",
            "left 9.9800 mm does not conform",
            "4 -20.000 µm",
            "right 9.9800 mm does not conform",
            "L 19.9600 mm does not conform",
        ],
    );
}

#[test]
fn a_feature_that_was_not_touched_is_invalid_and_so_is_its_width() {
    let missed = ProbeEvent {
        outcome: ProbeEvent::OUTCOME_NO_CONTACT,
        ..touch(4, 0.0)
    };
    check(
        vec![Input::Plan(plan()), event(5, 0.0), Input::Event(missed)],
        &[
            "5 +0.000 µm",
            "left 10.0000 mm conforms",
            "right invalid: 1 of 1 probing moves gave no usable touch",
            "L invalid: right: 1 of 1 probing moves gave no usable touch",
        ],
    );
}

#[test]
fn repeated_touches_that_differ_too_much_make_a_feature_invalid() {
    check(
        vec![Input::Plan(plan()), event(4, 0.0), event(4, 6.5)],
        &[
            "4 +0.000 µm",
            "right 10.0000 mm conforms",
            "4 +6.500 µm",
            "right invalid: repeated touches of one point differ by 6.5 µm, more than 6.0 µm",
        ],
    );
}

#[test]
fn events_wait_for_their_plan_and_a_new_plan_forgets_the_old_touches() {
    check(vec![event(4, 1.0)], &[]);
    check(
        vec![event(4, 1.0), Input::Plan(plan())],
        &["4 +1.000 µm", "right 10.0010 mm conforms"],
    );
    let again = vec![
        Input::Plan(plan()),
        event(5, 0.0),
        Input::Plan(plan()),
        event(4, 0.0),
    ];
    check(
        again,
        &[
            "5 +0.000 µm",
            "left 10.0000 mm conforms",
            "4 +0.000 µm",
            "right 10.0000 mm conforms",
        ],
    );
}

#[test]
fn an_event_that_cannot_be_used_is_a_fault_and_its_feature_has_no_size() {
    let mut broken = touch(4, 0.0);
    broken.axis_positions[0] = f64::NAN;
    check(
        vec![Input::Plan(plan()), Input::Event(broken)],
        &[
            "event_not_usable",
            "right invalid: 1 of 1 probing moves gave no usable touch",
        ],
    );
    let nowhere = ProbeEvent {
        point_index: 6,
        ..touch(4, 0.0)
    };
    check(
        vec![Input::Plan(plan()), Input::Event(nowhere)],
        &["event_not_usable"],
    );
}
