//! Ways between touches that keep clear of what the plan tells of the part.

use machine::{AxisLimits, Chain, Motion, Nominal};
use path_planning::MotionRules;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, ProbingMove, geometry_msgs,
};

/// Three linear axes; the stylus hangs 100 mm below the mount.
const MACHINE: &str = r#"<robot name="xyz"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<link name="a"/><link name="b"/>
<joint name="f" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
<limit lower="-0.3" upper="0.3" effort="0" velocity="0.1"/></joint>
<joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-0.3" upper="0.3" effort="0" velocity="0.1"/></joint>
<joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-0.3" upper="0.3" effort="0" velocity="0.1"/></joint></robot>"#;

/// Half the distance of the plane's touches from the middle, m.
const APART: f64 = 0.03;
/// Highest touch of the boss over the plane, m.
const TOP: f64 = 0.02;

/// A plane at height 0 touched left and right of its middle, where a boss of 10 mm radius may stand.
fn plan(boss: bool) -> InspectionPlan {
    let vector = |x: f64, y: f64, z: f64| geometry_msgs::Vector3 { x, y, z };
    let point = |feature: u32, at: [f64; 3], normal: [f64; 3]| InspectionPoint {
        feature,
        position: geometry_msgs::Point {
            x: at[0],
            y: at[1],
            z: at[2],
        },
        normal: vector(normal[0], normal[1], normal[2]),
        approach_distance: 3e-3,
        retract_distance: 3e-3,
        feed: 5e-3,
        ..InspectionPoint::default()
    };
    let mut plan = InspectionPlan::default();
    plan.part_pose.orientation.w = 1.0;
    plan.stylus.ball_center.z = -0.1;
    plan.stylus.ball_radius = 2e-3;
    for (kind, radius) in [
        (InspectionFeature::PLANE, 0.0),
        (InspectionFeature::CYLINDER, 0.01),
    ] {
        plan.features.push(InspectionFeature {
            kind,
            radius,
            axis: vector(0.0, 0.0, 1.0),
            ..InspectionFeature::default()
        });
    }
    for side in [-1.0, 1.0] {
        plan.points
            .push(point(0, [side * APART, 0.0, 0.0], [0.0, 0.0, 1.0]));
    }
    if boss {
        for height in [5e-3, TOP] {
            plan.points
                .push(point(1, [0.0, 0.01, height], [0.0, 1.0, 0.0]));
        }
    }
    plan
}

/// Heights of the ball over the plane on the way from one touch of the plane to the other (mm), with the boss known or not.
fn heights_between(boss: bool, clearance: Option<(usize, f64)>) -> Vec<f64> {
    let chain = Chain::from_urdf(MACHINE).expect("a chain");
    let plan = plan(boss);
    let rules = MotionRules {
        chain: &chain,
        clearance,
        attitudes: None,
        overtravel: 1e-3,
        kicks: 100,
    };
    // The boss comes first, so that the touches of the plane follow each other.
    let stages = [1, 1, 0, 0];
    let all: Vec<u32> = (0..plan.points.len() as u32).collect();
    let order = rules
        .order_of(&plan, &all, &stages[..all.len()], &[])
        .expect("a way");
    let part = Nominal::from_plan(&plan).expect("a usable plan");
    let last = order
        .moves
        .iter()
        .rposition(|one| one.kind == ProbingMove::APPROACH);
    let way = &order.moves[..=last.expect("an approach")];
    let from = way.iter().rposition(|one| one.kind == ProbingMove::RETRACT);
    way[from.expect("a retract")..]
        .iter()
        .map(|one| {
            chain
                .ball_in_part(&one.axis_positions, &part.part_pose, &part.ball)
                .z
                * 1e3
        })
        .collect()
}

#[test]
fn over_a_plain_face_the_probe_goes_straight() {
    for clearance in [None, Some((2, 0.25))] {
        let heights = heights_between(false, clearance);
        assert_eq!(heights.len(), 2, "{heights:?}");
        assert!(heights.iter().all(|height| (height - 5.0).abs() < 1e-6));
    }
}

#[test]
fn where_a_boss_stands_in_between_it_goes_over_it() {
    let heights = heights_between(true, None);
    let [_, out, over, _] = heights[..] else {
        panic!("{heights:?}");
    };
    // The ball's own 2 mm over the boss at least, but not as far as the machine goes.
    for height in [out, over] {
        assert!((TOP * 1e3 + 2.0..150.0).contains(&height), "{heights:?}");
    }
    let heights = heights_between(true, Some((2, 0.25)));
    let [_, out, over, _] = heights[..] else {
        panic!("{heights:?}");
    };
    assert!((out - 150.0).abs() < 1e-6 && (over - 150.0).abs() < 1e-6);
}

/// Six points in two rows; the axis across is fast but slow to start, so many short steps across cost more than few.
#[test]
fn orders_are_shortest_in_the_time_that_the_declared_motion_takes() {
    let mut plan = plan(false);
    plan.points.clear();
    for (x, y) in [
        (-1.0, 0.0),
        (0.0, 0.0),
        (1.0, 0.0),
        (-1.0, 1.0),
        (0.0, 1.0),
        (1.0, 1.0),
    ] {
        let mut point = self::plan(false).points[0].clone();
        (point.position.x, point.position.y) = (x * 0.02, y * 0.02);
        plan.points.push(point);
    }
    let plain = Chain::from_urdf(MACHINE).expect("a chain");
    let uniform = *plain.motion().axes().first().expect("axes");
    let slow_start = AxisLimits {
        acceleration: Some(0.5),
        jerk: Some(5.0),
        ..uniform
    };
    let declared = Motion::new(vec![uniform, slow_start, uniform], 0.05);
    let mut steps_across = Vec::new();
    for (motion, dwell) in [(plain.motion().clone(), 0.0), (declared, 0.05)] {
        let chain = plain.clone().with_motion(motion);
        let rules = MotionRules {
            chain: &chain,
            clearance: None,
            attitudes: None,
            overtravel: 1e-3,
            kicks: 100,
        };
        let order = rules.order(&plan, &[]).expect("an order");
        assert!(order.optimal);
        // What is promised is what its moves between touches take, by the motion model.
        let mut air = 0.0;
        let mut retract: Option<&Vec<f64>> = None;
        for step in &order.moves {
            match (step.kind, retract) {
                (ProbingMove::RETRACT, _) => retract = Some(&step.axis_positions),
                (ProbingMove::APPROACH, Some(from)) => {
                    air += chain.motion().time(from, &step.axis_positions);
                }
                _ => {}
            }
        }
        assert!((air - order.air_time).abs() < 1e-9, "{air} {order:?}");
        assert!(order.air_time >= 5.0 * (0.2 + dwell) - 1e-9);
        let rows: Vec<bool> = order.order.iter().map(|&point| point < 3).collect();
        steps_across.push(rows.windows(2).filter(|pair| pair[0] != pair[1]).count());
    }
    // At top speed alone every step of 20 mm is worth the same, and the lowest indices win; with a slow start the row is
    // changed once.
    assert_eq!(steps_across[1], 1, "{steps_across:?}");
}
