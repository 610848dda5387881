//! Step by step: which plan is published for which request.

use graph::{Node, Outbox, Stamp};
use machine::Chain;
use path_planning::{Config, Input, Output, PathPlanningNode, RawConfig, State, part::RawPart};
use probecell_msgs::{OperationReport, OperationRequest, OperatorRequest};

/// A probe that moves freely over a part that turns about Z; its ball's centre is the mount's origin.
const ROBOT: &str = r#"<robot name="xyzc"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<link name="a"/><link name="b"/>
<joint name="C" type="revolute"><parent link="foundation"/><child link="workpiece"/><axis xyz="0 0 1"/>
<limit lower="-7" upper="7" effort="0" velocity="1"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
<limit lower="-0.1" upper="0.1" effort="0" velocity="0.1"/></joint>
<joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-0.1" upper="0.1" effort="0" velocity="0.1"/></joint>
<joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-0.1" upper="0.1" effort="0" velocity="0.1"/></joint></robot>"#;

/// A shaft of `radius_mm` touched at four places on its +X side.
fn config(radius_mm: f64) -> Config {
    round("cylinder", radius_mm)
}

/// The same of that kind of feature.
fn round(kind: &str, radius_mm: f64) -> Config {
    let text = format!(
        r#"
        id = "shaft"
        position_mm = [0.0, 0.0, 0.0]
        indexing_axis = "C"
        facing = [1.0, 0.0, 0.0]
        approach_mm = 1.0
        retract_mm = 1.0
        feed_mm_per_min = 300.0
        stylus = {{ id = "s", ball_center_mm = [0.0, 0.0, 0.0], ball_radius_mm = 2.0 }}
        [[operations]]
        id = "turn"
        tool_number = 2
        tool_radius_mm = 0.4
        feed_mm_per_min = 700.0
        [[features]]
        id = "D"
        kind = "{kind}"
        origin_mm = [0.0, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        radius_mm = {radius_mm}
        tolerance_um = [-10.0, 10.0]
        operation = "turn"
        touch_angles_deg = [0.0]
        touch_heights_mm = [40.0, 0.0, 30.0, 10.0]
        "#
    );
    let part: RawPart = toml::from_str(&text).unwrap_or_else(|error| panic!("{error}"));
    let chain = Chain::from_urdf(ROBOT).expect("a chain");
    RawConfig::default()
        .check(chain, &part, vec![0.5e-3, 0.0])
        .expect("sound settings")
}

/// The shaft with two more touches of a datum at its far end, clamped at its near one, and how far the axes go.
fn part_with_datum(clearance_mm: f64) -> Result<Config, path_planning::ConfigError> {
    let text = r#"
        id = "shaft"
        indexing_axis = "C"
        facing = [1.0, 0.0, 0.0]
        clamping_mm = [0.0, 0.0, 5.0]
        clamping_axis = [0.0, 0.0, 1.0]
        approach_mm = 1.0
        retract_mm = 1.0
        feed_mm_per_min = 300.0
        stylus = { id = "s", ball_center_mm = [0.0, 0.0, 0.0], ball_radius_mm = 2.0 }
        [[features]]
        id = "D"
        kind = "cylinder"
        axis = [0.0, 0.0, 1.0]
        radius_mm = 10.0
        tolerance_um = [-10.0, 10.0]
        touch_angles_deg = [0.0]
        touch_heights_mm = [0.0, 10.0]
        [[features]]
        id = "A"
        kind = "cylinder"
        axis = [0.0, 0.0, 1.0]
        radius_mm = 10.0
        tolerance_um = [-10.0, 10.0]
        touch_angles_deg = [0.0]
        touch_heights_mm = [20.0, 30.0]
        datum = true
        "#;
    let part: RawPart = toml::from_str(text).unwrap_or_else(|error| panic!("{error}"));
    let chain = Chain::from_urdf(ROBOT).expect("a chain");
    let settings = RawConfig {
        clearance_axis: "X".to_owned(),
        clearance_mm,
        ..RawConfig::default()
    };
    settings.check(chain, &part, Vec::new())
}

/// One step: what is said, and the timers asked for.
fn step(config: &Config, state: &mut State, input: Input) -> (Vec<Output>, Vec<u32>) {
    let mut out = Outbox::default();
    PathPlanningNode::step(config, state, Stamp(0), input, &mut out);
    let timers = out.timers().iter().map(|(at, id)| {
        assert_eq!(*at, Stamp(0), "at once");
        *id
    });
    (out.messages().to_vec(), timers.collect())
}

/// The step and all that it asks for; what is said, but how far it is.
fn whole(config: &Config, state: &mut State, input: Input) -> Vec<Output> {
    let (mut all, mut timers) = step(config, state, input);
    while let Some(id) = timers.pop() {
        let (said, asked) = step(config, state, Input::Timer(id));
        all.extend(said);
        timers.extend(asked);
    }
    all.retain(|output| !matches!(output, Output::Progress(_)));
    all
}

/// What the input makes the node say in the end, a line each.
fn check(config: &Config, input: Input, expected: &[&str]) {
    let mut state = PathPlanningNode::start(config);
    let said: Vec<String> = whole(config, &mut state, input).iter().map(line).collect();
    assert_eq!(said, expected);
}

fn line(output: &Output) -> String {
    match output {
        Output::Plan(one) => format!(
            "{} radius {:.2} mm",
            one.plan_id,
            one.features[0].radius * 1e3
        ),
        Output::Order(one) => {
            // The way back is as long: it counts as the same order.
            let mut order = one.order.clone();
            if order.first() > order.last() {
                order.reverse();
            }
            format!(
                "{} order {order:?} {:.2} s against {:.2} s",
                one.plan_id, one.air_time, one.given_air_time
            )
        }
        Output::Reply(one) => format!("{} accepted {}", one.request_id, one.accepted),
        Output::Progress(one) => format!("{} phase {}", one.plan_id, one.phase),
        Output::Fault(one) => one.code.clone(),
    }
}

fn measure(pass_number: u32) -> Input {
    let (kind, plan_id) = (OperationRequest::MEASURE, "p/1".to_owned());
    Input::Request(OperationRequest {
        kind,
        plan_id,
        pass_number,
        ..OperationRequest::default()
    })
}

#[test]
fn a_measurement_is_planned_on_the_sizes_of_its_pass_in_the_shortest_order() {
    // Along the shaft: 40 mm at 0.1 m/s with the sweep, 100 mm in the order given.
    let order = |radius: &str| {
        [
            format!("p/1 radius {radius} mm"),
            "p/1 order [0, 2, 3, 1] 0.40 s against 0.90 s".to_owned(),
        ]
    };
    for (pass, radius) in [(0, "10.25"), (1, "10.00")] {
        let expected = order(radius);
        check(&config(10.0), measure(pass), &[&expected[0], &expected[1]]);
    }
}

/// 0.5 mm on the diameter; each touch lies on the surface that is there.
#[test]
fn what_a_pass_leaves_makes_a_shaft_thicker_and_a_bore_narrower() {
    for (kind, radius) in [("cylinder", 10.25e-3), ("bore", 9.75e-3)] {
        let plan = round(kind, 10.0).part.plan(0.5e-3);
        assert!((plan.features[0].radius - radius).abs() < 1e-12, "{kind}");
        for point in &plan.points {
            let from_axis = point.position.x.hypot(point.position.y);
            assert!((from_axis - radius).abs() < 1e-12, "{kind}");
        }
    }
}

#[test]
fn cutting_needs_no_plan() {
    let cut = OperationRequest {
        kind: OperationRequest::CUT,
        ..OperationRequest::default()
    };
    check(&config(10.0), Input::Request(cut), &[]);
}

#[test]
fn a_part_out_of_reach_is_a_fault_for_the_cycle_and_a_refusal_for_an_operator() {
    check(&config(200.0), measure(1), &["plan_impossible"]);
    let asked = OperatorRequest {
        request_id: 4,
        ..OperatorRequest::default()
    };
    check(&config(200.0), Input::Plan(asked), &["4 accepted false"]);
}

#[test]
fn an_operator_gets_a_preview_of_the_finished_part() {
    let asked = OperatorRequest {
        request_id: 4,
        ..OperatorRequest::default()
    };
    check(
        &config(10.0),
        Input::Plan(asked),
        &[
            "preview radius 10.00 mm",
            "preview order [0, 2, 3, 1] 0.40 s against 0.90 s",
            "4 accepted true",
        ],
    );
}

/// A preview is published, so it would take the place of a plan that is being measured; afterwards it may.
#[test]
fn a_preview_is_refused_while_a_measurement_runs() {
    let config = config(10.0);
    let mut state = PathPlanningNode::start(&config);
    let mut said = |input: Input| -> Vec<String> {
        let said = whole(&config, &mut state, input);
        said.iter().map(line).collect()
    };
    let preview = || {
        Input::Plan(OperatorRequest {
            request_id: 4,
            ..OperatorRequest::default()
        })
    };
    let request = |kind: u8, request_id: u64, plan_id: &str| {
        Input::Request(OperationRequest {
            kind,
            request_id,
            plan_id: plan_id.to_owned(),
            ..OperationRequest::default()
        })
    };
    let report = |request_id: u64, outcome: u8| {
        Input::Report(OperationReport {
            request_id,
            outcome,
            ..OperationReport::default()
        })
    };
    // It ends by the report on it, however it ends, or by a stop; another report says nothing of it.
    for (number, outcome) in [(0, 0), (1, OperationReport::FAILED), (2, 0)] {
        let plan_id = format!("p/{number}");
        let (own, other) = (10 + number, 9 + number);
        assert_eq!(
            said(request(OperationRequest::MEASURE, own, &plan_id)).len(),
            2
        );
        assert_eq!(said(preview()), ["4 accepted false"]);
        said(report(other, OperationReport::DONE));
        assert_eq!(said(preview()), ["4 accepted false"]);
        if number == 2 {
            said(request(OperationRequest::STOP, 20, ""));
        } else {
            said(report(own, outcome));
        }
        assert_eq!(said(preview()).len(), 3);
    }
}

fn said(config: &Config, input: Input) -> Vec<Output> {
    let mut state = PathPlanningNode::start(config);
    whole(config, &mut state, input)
}

#[test]
fn a_datum_is_touched_first_and_points_know_how_far_they_stand_out() {
    let said = said(&part_with_datum(60.0).expect("sound settings"), measure(0));
    let [Output::Plan(plan), Output::Order(order)] = said.as_slice() else {
        panic!("{said:?}");
    };
    // Without stages it would be the sweep 0 1 2 3.
    assert_eq!(order.order, [3, 2, 1, 0]);
    let overhangs: Vec<f64> = plan
        .points
        .iter()
        .map(|point| point.overhang * 1e3)
        .collect();
    for (found, expected) in overhangs.iter().zip([0.0, 5.0, 15.0, 25.0]) {
        assert!((found - expected).abs() < 1e-9, "{overhangs:?}");
    }
}

#[test]
fn a_move_beyond_the_travel_of_an_axis_is_told_before_the_first_move() {
    let said = said(&part_with_datum(150.0).expect("sound settings"), measure(0));
    let [Output::Fault(fault)] = said.as_slice() else {
        panic!("{said:?}");
    };
    assert_eq!(
        fault.text,
        "a move to point 3 takes axis \"X\" to 0.150000 (m or rad), outside its travel -0.100000 to 0.100000"
    );
}

#[test]
fn what_is_left_of_a_broken_scan_is_planned_in_its_own_shortest_order() {
    let config = config(10.0);
    let plan = config.part.plan(0.0);
    let rules = config.rules();
    // Heights 40, 0 and 30 mm are left.
    let order = rules
        .order_of(&plan, &[0, 1, 2], &[], &[])
        .expect("in reach");
    assert!(
        order.order == [0, 2, 1] || order.order == [1, 2, 0],
        "{order:?}"
    );
    let whole = rules.order(&plan, &[]).expect("in reach");
    for one in &order.moves {
        let same = |other: &&probecell_msgs::ProbingMove| {
            other.kind == one.kind && other.point_index == one.point_index
        };
        let known = whole.moves.iter().find(same);
        let known = known.unwrap_or_else(|| panic!("{one:?} is no move of the whole scan"));
        let off = one.axis_positions.iter().zip(&known.axis_positions);
        assert!(off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-9);
    }
    let again = rules.order_of(&plan, &[2], &[], &[]).expect("in reach");
    assert_eq!(again.order, [2]);
    for wrong in [&[9][..], &[1, 1]] {
        assert!(rules.order_of(&plan, wrong, &[], &[]).is_err(), "{wrong:?}");
    }
}
