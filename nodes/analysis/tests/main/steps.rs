//! Step by step: from touches to deviations and sizes.

use analysis::{
    AnalysisNode, Config, Distribution, Input, Output, RawConfig, RawContribution, Width,
};
use graph::{Node, Outbox, Stamp};
use machine::Chain;
use probecell_msgs::{
    FeatureResult, InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent,
    ReferenceMeasurement, Stylus,
    geometry_msgs::{Point, Pose, Quaternion, Vector3},
};

use crate::robot::{BALL, ROBOT};

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
        Output::ReferenceFeature(one) => {
            let (size, u) = (one.size * 1e3, one.standard_uncertainty * 1e6);
            format!("{} {}: {size:.4} mm, u {u:.1} µm", one.feature_id, one.text)
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

/// A bore, a width and a step from touches of ten repeats, and a stylus calibrated with four degrees of freedom in a room
/// that varies by ±1 µm.
#[test]
fn few_degrees_of_freedom_widen_the_coverage_factor() {
    let with = |edit: &dyn Fn(&mut RawConfig)| {
        let planes = ["right".to_owned(), "left".to_owned()];
        let size = |id: &str| Width {
            id: id.to_owned(),
            planes: planes.clone(),
            tolerance_um: [-10.0, 10.0],
        };
        let mut raw = RawConfig {
            widths: vec![size("L")],
            steps: vec![size("S")],
            ..RawConfig::default()
        };
        edit(&mut raw);
        let config = raw.check(Chain::from_urdf(ROBOT).expect("a chain"));
        let config = config.expect("sound settings");
        let mut state = AnalysisNode::start(&config);
        let mut out = Outbox::default();
        for input in std::iter::once(Input::Plan(plan())).chain((0..6).map(|i| event(i, 0.0))) {
            AnalysisNode::step(&config, &mut state, Stamp(0), input, &mut out);
        }
        let results = out.messages().iter().filter_map(|message| match message {
            Output::Feature(result) => {
                let (u, k) = (result.standard_uncertainty * 1e6, result.coverage_factor);
                Some((result.feature_id.clone(), format!("u {u:.3} k {k:.3}")))
            }
            _ => None,
        });
        let common = config.common_components(&plan());
        (
            results.collect::<std::collections::BTreeMap<_, _>>(),
            common,
        )
    };
    let (exact, common) = with(&|raw| raw.common_standard_uncertainty_um = 1.0);
    // A bore from four touches: u 2/√4; twice the common part. In the step it cancels.
    assert_eq!(exact["bore"], "u 2.236 k 2.000");
    assert_eq!(exact["right"], "u 1.414 k 2.000");
    assert_eq!(exact["L"], "u 2.449 k 2.000");
    assert_eq!(exact["S"], "u 1.414 k 2.000");
    let common = common
        .into_iter()
        .map(|(id, value)| format!("{id} {:+.1}", value * 1e6));
    let common: Vec<String> = common.collect();
    assert_eq!(
        common,
        ["L +2.0", "S +0.0", "bore -2.0", "left +1.0", "right +1.0"]
    );
    let (few, _) = with(&|raw| {
        raw.touch_degrees_of_freedom = Some(9.0);
        raw.common = vec![
            RawContribution {
                name: "stylus".to_owned(),
                standard_uncertainty_um: Some(0.8),
                degrees_of_freedom: Some(4.0),
                ..RawContribution::default()
            },
            RawContribution {
                name: "temperature".to_owned(),
                half_width_um: Some(1.0),
                distribution: Some(Distribution::Arcsine),
                ..RawContribution::default()
            },
        ];
    });
    // The step has the touches' nine degrees of freedom: t(95.45 %, 9) = 2.32.
    assert_eq!(few["S"], "u 1.414 k 2.320");
    // ν_eff of the bore is u⁴/(1⁴/9 + 1.6⁴/4) = 5.56²/1.7495 = 17.67; table G.2 of the GUM has 2.16 for 17 and 2.15 for 18.
    assert_eq!(few["bore"], "u 2.358 k 2.152");
}

#[test]
fn a_budget_line_that_is_none_is_refused() {
    let refused = |line: RawContribution, says: &str| {
        let raw = RawConfig {
            common: vec![RawContribution {
                name: "stylus".to_owned(),
                ..line
            }],
            ..RawConfig::default()
        };
        let chain = Chain::from_urdf(ROBOT).expect("a chain");
        let error = raw.check(chain).expect_err("refused").to_string();
        assert!(error.contains(says), "{error}");
    };
    let none = RawContribution::default;
    refused(none(), "\"stylus\" needs one of");
    let two = RawContribution {
        standard_uncertainty_um: Some(1.0),
        half_width_um: Some(1.0),
        ..none()
    };
    refused(two, "\"stylus\" needs one of");
    let alone = RawContribution {
        half_width_um: Some(1.0),
        degrees_of_freedom: Some(4.0),
        ..none()
    };
    refused(alone, "\"stylus\" needs one of");
    let single = RawContribution {
        deviation_um: Some(1.0),
        readings: Some(1),
        ..none()
    };
    refused(single, "the degrees of freedom of stylus are 0");
    let negative = RawContribution {
        standard_uncertainty_um: Some(-1.0),
        ..none()
    };
    refused(negative, "the standard uncertainty of stylus is");
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

fn reference(plan_id: &str, excess_um: [f64; 6]) -> ReferenceMeasurement {
    ReferenceMeasurement {
        plan_id: plan_id.to_owned(),
        instrument: "CMM".to_owned(),
        point_index: (0..6).collect(),
        deviation: excess_um.map(|um| um * 1e-6).to_vec(),
        standard_uncertainty: 1e-6,
        ..ReferenceMeasurement::default()
    }
}

/// 3 µm of excess in the bore take 6 µm off its diameter; planes 1 and 2 µm out make the width 3 µm wide. Uncertainties:
/// √(2² + 4·¼) = 2.2 µm of a diameter from four points; √(1² + 1²) of a plane; √(2² + 1² + 1²) of a width.
#[test]
fn a_reference_is_evaluated_as_the_touches_are_though_the_next_plan_is_here() {
    let next = InspectionPlan {
        plan_id: "q".to_owned(),
        ..plan()
    };
    let found = Input::Reference(reference("p", [3.0, 3.0, 3.0, 3.0, 1.0, 2.0]));
    check(
        vec![Input::Plan(plan()), Input::Plan(next), found],
        &[
            "bore by CMM: 19.9940 mm, u 2.2 µm",
            "right by CMM: 10.0010 mm, u 1.4 µm",
            "left by CMM: 10.0020 mm, u 1.4 µm",
            "L by CMM: 20.0030 mm, u 2.4 µm",
        ],
    );
}

#[test]
fn a_reference_that_tells_nothing_is_a_fault_that_says_why() {
    let refused = |reference: ReferenceMeasurement| {
        let mut state = AnalysisNode::start(&config());
        let mut out = Outbox::default();
        for input in [Input::Plan(plan()), Input::Reference(reference)] {
            AnalysisNode::step(&config(), &mut state, Stamp(0), input, &mut out);
        }
        let said: Vec<String> = out
            .messages()
            .iter()
            .map(|output| match output {
                Output::Fault(fault) => fault.text.clone(),
                other => line(other),
            })
            .collect();
        said.join("; ")
    };
    let sound = reference("p", [0.0; 6]);
    let with = |edit: fn(&mut ReferenceMeasurement)| {
        let mut wrong = sound.clone();
        edit(&mut wrong);
        refused(wrong)
    };
    for (said, expected) in [
        (
            with(|one| one.plan_id = "x".to_owned()),
            "of plan \"x\", which was not measured here lately",
        ),
        (
            with(|one| one.point_index[5] = 6),
            "point 6 is not in plan \"p\"",
        ),
        (
            with(|one| one.deviation[1] = f64::NAN),
            "the deviation of point 1 is NaN",
        ),
        (
            with(|one| one.standard_uncertainty = 0.0),
            "its standard uncertainty is 0 m",
        ),
        (
            with(|one| one.deviation.truncate(5)),
            "has 6 points and 5 deviations",
        ),
    ] {
        assert!(said.contains(expected), "{said}");
    }
}
