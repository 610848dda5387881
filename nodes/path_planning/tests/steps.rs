//! Step by step: which plan is published for which request.

use graph::{Node, Outbox, Stamp};
use machine::Chain;
use path_planning::{Config, Input, Output, PathPlanningNode, RawConfig, part::RawPart};
use probecell_msgs::{OperationRequest, OperatorRequest};

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
        kind = "cylinder"
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

/// What the input makes the node say, a line each.
fn check(config: &Config, input: Input, expected: &[&str]) {
    let mut state = PathPlanningNode::start(config);
    let mut out = Outbox::default();
    PathPlanningNode::step(config, &mut state, Stamp(0), input, &mut out);
    let said: Vec<String> = out.messages().iter().map(line).collect();
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
