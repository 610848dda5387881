//! Step by step: which triggers are touches, and what is said of the others.

use graph::{Node, Outbox, Stamp};
use machine::Chain;
use probe_events::{Config, Input, Output, ProbeEventsNode};
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent, ProbeTrigger, Stylus,
    geometry_msgs::{Point, Pose, Quaternion, Vector3},
};

const ROBOT: &str = r#"<robot name="one_axis"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<joint name="W" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="Z" type="prismatic"><parent link="foundation"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="0" velocity="1"/></joint></robot>"#;

/// A plane at z = 0 with three points, touched from above by a ball of 3 mm whose centre is the mount's origin.
fn plan(plan_id: &str) -> Input {
    let up = Vector3 {
        x: 0.0,
        y: 0.0,
        z: 1.0,
    };
    let feature = InspectionFeature {
        id: "top".to_owned(),
        kind: InspectionFeature::PLANE,
        axis: up,
        ..Default::default()
    };
    let point = InspectionPoint {
        normal: up,
        feed: 5e-3,
        ..Default::default()
    };
    Input::Plan(InspectionPlan {
        plan_id: plan_id.to_owned(),
        part_pose: Pose {
            orientation: Quaternion {
                w: 1.0,
                ..Default::default()
            },
            ..Default::default()
        },
        stylus: Stylus {
            id: "s".to_owned(),
            ball_center: Point::default(),
            ball_radius: 3e-3,
        },
        features: vec![feature],
        points: vec![point; 3],
        ..Default::default()
    })
}

fn trigger(plan_id: &str, point_index: u32, z: f64) -> ProbeTrigger {
    ProbeTrigger {
        plan_id: plan_id.to_owned(),
        point_index,
        tripped: true,
        axis_names: vec!["Z".to_owned()],
        axis_positions: vec![z],
        ..ProbeTrigger::default()
    }
}

fn missed(point_index: u32) -> Input {
    Input::Trigger(ProbeTrigger {
        tripped: false,
        ..trigger("a", point_index, 0.0)
    })
}

/// Everything that the inputs make the node say, a line each.
fn check(inputs: Vec<Input>, expected: &[&str]) {
    let config = Config {
        chain: Chain::from_urdf(ROBOT).expect("a chain"),
    };
    let mut state = ProbeEventsNode::start(&config);
    let mut out = Outbox::default();
    let mut triggers = 0..;
    for mut input in inputs {
        if let Input::Trigger(trigger) = &mut input {
            trigger.sequence = triggers.next().unwrap_or_default();
        }
        ProbeEventsNode::step(&config, &mut state, Stamp(0), input, &mut out);
    }
    let said: Vec<String> = out.messages().iter().map(line).collect();
    assert_eq!(said, expected);
}

fn line(output: &Output) -> String {
    match output {
        Output::Event(one) => {
            let outcome = match one.outcome {
                ProbeEvent::OUTCOME_TOUCHED => "touched",
                ProbeEvent::OUTCOME_NO_CONTACT => "no contact",
                _ => "early",
            };
            format!(
                "{} point {} {outcome} at {:.4}",
                one.sequence, one.point_index, one.tip.z
            )
        }
        Output::Fault(one) => one.code.clone(),
    }
}

#[test]
fn touches_keep_the_numbers_of_their_triggers_over_all_plans() {
    check(
        vec![
            plan("a"),
            Input::Trigger(trigger("a", 2, 0.0031)),
            Input::Trigger(trigger("a", 0, 0.003)),
            plan("b"),
            Input::Trigger(trigger("b", 1, 0.0029)),
        ],
        &[
            "0 point 2 touched at 0.0031",
            "1 point 0 touched at 0.0030",
            "2 point 1 touched at 0.0029",
        ],
    );
}

#[test]
fn a_trigger_waits_for_its_plan() {
    check(vec![Input::Trigger(trigger("a", 0, 0.003))], &[]);
    check(vec![plan("b"), Input::Trigger(trigger("a", 0, 0.003))], &[]);
    check(
        vec![Input::Trigger(trigger("a", 0, 0.003)), plan("a")],
        &["0 point 0 touched at 0.0030"],
    );
}

/// A trigger that is dropped is a touch that is lost.
#[test]
fn more_triggers_than_can_wait_for_their_plan_are_a_fault() {
    let waiting = |count: usize| vec![Input::Trigger(trigger("a", 0, 0.003)); count];
    check(waiting(4096), &[]);
    check(waiting(4097), &["trigger_not_usable"]);
}

#[test]
fn one_miss_is_a_warning_two_in_a_row_are_a_dead_probe_and_a_touch_between_them_is_not() {
    check(
        vec![plan("a"), missed(0)],
        &["no_contact", "0 point 0 no contact at 0.0000"],
    );
    check(
        vec![plan("a"), missed(0), missed(1)],
        &[
            "no_contact",
            "0 point 0 no contact at 0.0000",
            "no_contact",
            "probe_dead",
            "1 point 1 no contact at 0.0000",
        ],
    );
    check(
        vec![
            plan("a"),
            missed(0),
            Input::Trigger(trigger("a", 1, 0.003)),
            missed(2),
        ],
        &[
            "no_contact",
            "0 point 0 no contact at 0.0000",
            "1 point 1 touched at 0.0030",
            "no_contact",
            "2 point 2 no contact at 0.0000",
        ],
    );
}

#[test]
fn a_probe_that_was_tripped_before_the_move_is_stuck_whatever_it_says_afterwards() {
    let stuck = ProbeTrigger {
        tripped_before: true,
        ..trigger("a", 1, 0.004)
    };
    check(
        vec![plan("a"), Input::Trigger(stuck)],
        &["probe_stuck", "0 point 1 early at 0.0040"],
    );
}

#[test]
fn a_trigger_with_unusable_axes_or_point_makes_no_event() {
    let mut inputs = vec![plan("a")];
    inputs.push(Input::Trigger(trigger("a", 3, 0.003)));
    inputs.push(Input::Trigger(trigger("a", 0, f64::NAN)));
    inputs.push(Input::Trigger(ProbeTrigger {
        axis_positions: Vec::new(),
        ..trigger("a", 0, 0.003)
    }));
    inputs.push(Input::Trigger(ProbeTrigger {
        axis_names: vec!["U".to_owned()],
        ..trigger("a", 0, 0.003)
    }));
    inputs.push(Input::Trigger(trigger("a", 0, 0.003)));
    let unusable = "trigger_not_usable";
    check(
        inputs,
        &[
            unusable,
            unusable,
            unusable,
            unusable,
            "4 point 0 touched at 0.0030",
        ],
    );
}

/// Instant and feed are those of the move that was made, though it ran at another feed and its end comes late.
#[test]
fn a_touch_tells_when_and_at_what_feed_it_was_made() {
    let config = Config {
        chain: Chain::from_urdf(ROBOT).expect("a chain"),
    };
    let mut state = ProbeEventsNode::start(&config);
    let mut out = Outbox::default();
    let made = ProbeTrigger {
        header: Stamp(7).header(""),
        feed: 2e-3,
        ..trigger("a", 0, 0.003)
    };
    for input in [plan("a"), Input::Trigger(made)] {
        ProbeEventsNode::step(&config, &mut state, Stamp(9), input, &mut out);
    }
    let [Output::Event(event)] = out.messages() else {
        panic!("one event");
    };
    let told = (&event.header, event.feed);
    assert_eq!(told, (&Stamp(7).header("part"), 2e-3));
}

/// Found by seed 13 of `fault_world`: a link delivered a trigger a second time, and there were two touches of one number.
#[test]
fn a_trigger_that_is_delivered_again_is_one_touch() {
    let config = Config {
        chain: Chain::from_urdf(ROBOT).expect("a chain"),
    };
    let mut state = ProbeEventsNode::start(&config);
    let mut out = Outbox::default();
    let of = |session: &str, sequence| {
        Input::Trigger(ProbeTrigger {
            session: session.to_owned(),
            sequence,
            ..trigger("a", 0, 0.003)
        })
    };
    let inputs = [
        plan("a"),
        of("s", 4),
        of("s", 5),
        of("s", 4),
        of("s", 5),
        of("t", 0),
    ];
    for input in inputs {
        ProbeEventsNode::step(&config, &mut state, Stamp(0), input, &mut out);
    }
    let said: Vec<String> = out.messages().iter().map(line).collect();
    let touched = |number: u64| format!("{number} point 0 touched at 0.0030");
    assert_eq!(said, [touched(4), touched(5), touched(0)]);
}
