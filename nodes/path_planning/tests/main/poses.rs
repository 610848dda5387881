//! Points that may be touched at several poses: against every order at every choice of poses, timed by the formula here.

use machine::Chain;
use path_planning::{Config, OrderRequest, Planned, PlanningError, RawConfig, Task, part::RawPart};
use probecell_msgs::{InspectionPlan, ProbingMove};

/// A table that turns the part about Z, and a probe on three axes whose ball's centre is the mount's origin.
const ROBOT: &str = r#"<robot name="xyzc"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<link name="a"/><link name="b"/>
<joint name="C" type="revolute"><parent link="foundation"/><child link="workpiece"/><axis xyz="0 0 1"/>
<limit lower="-7" upper="7" effort="0" velocity="2"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
<limit lower="-0.15" upper="0.15" effort="0" velocity="0.1"/></joint>
<joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-0.15" upper="0.15" effort="0" velocity="0.1"/></joint>
<joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-0.15" upper="0.15" effort="0" velocity="0.1"/></joint></robot>"#;
/// Top speeds of a linear axis (m/s) and of the table (rad/s).
const SPEEDS: (f64, f64) = (0.1, 2.0);
/// m: where Z is clear, the radii of ball and spheres, the distances of approach and retract.
const CLEAR: f64 = 0.12;
const BALL: f64 = 2e-3;
const SPHERE: f64 = 5e-3;
const APPROACH: f64 = 1e-3;
const RETRACT: f64 = 2e-3;

fn checked(text: &str, robot: &str, settings: &RawConfig) -> Result<Config, String> {
    let part: RawPart = toml::from_str(text).map_err(|error| error.to_string())?;
    let chain = Chain::from_urdf(robot).expect("a chain");
    let checked = settings.check(chain, &part, Vec::new());
    checked.map_err(|error| error.to_string())
}

/// One touch on top of each of some spheres, at (x, y, z) in mm; the first pose of each, and those that all share.
fn spheres(at: &[[f64; 3]], first: &[f64], others: &[f64], datum: &[usize]) -> Config {
    let others: Vec<String> = others.iter().map(|turn| format!("[{turn:.1}]")).collect();
    let mut text = format!(
        r#"
        id = "spheres"
        rotary_axes = ["C"]
        rotary_alternatives_deg = [{}]
        approach_mm = 1.0
        retract_mm = 2.0
        feed_mm_per_min = 300.0
        stylus = {{ id = "s", ball_center_mm = [0.0, 0.0, 0.0], ball_radius_mm = 2.0 }}
        "#,
        others.join(", ")
    );
    for (index, [x, y, z]) in at.iter().enumerate() {
        let top = [x + 3.0, y - 2.0, z + 8.0];
        let feature = format!(
            r#"
            [[features]]
            id = "S{index}"
            kind = "sphere"
            origin_mm = [{x:.3}, {y:.3}, {z:.3}]
            radius_mm = 5.0
            tolerance_um = [-10.0, 10.0]
            touch_points_mm = [{top:?}]
            rotary_deg = [{:.1}]
            datum = {}
            "#,
            first[index],
            datum.contains(&index)
        );
        text.push_str(&feature);
    }
    let settings = RawConfig {
        clearance_axis: "Z".to_owned(),
        clearance_mm: CLEAR * 1e3,
        kicks: 3_000,
        ..RawConfig::default()
    };
    checked(&text, ROBOT, &settings).unwrap_or_else(|error| panic!("{error}"))
}

fn planned(config: &Config) -> Result<Planned, PlanningError> {
    let plan = config.part.plan(0.0);
    let all: Vec<u32> = (0..plan.points.len() as u32).collect();
    let rules = config.rules();
    let request = OrderRequest {
        plan: &plan,
        points: &all,
        stages: config.part.stages(),
        poses: config.part.poses(),
        seeds: &[],
        here: None,
    };
    rules.plan(&request, &mut |_| {})
}

/// Where the ball is at a distance (m) of the contact on top of a sphere (mm), the part turned (rad).
fn ball([x, y, z]: [f64; 3], distance: f64, turn: f64) -> [f64; 3] {
    let normal = [3.0, -2.0, 8.0].map(|part: f64| part / 77.0_f64.sqrt());
    let out = SPHERE + BALL + distance;
    let at = [x * 1e-3 + normal[0] * out, y * 1e-3 + normal[1] * out];
    let (sine, cosine) = turn.sin_cos();
    [
        cosine * at[0] - sine * at[1],
        sine * at[0] + cosine * at[1],
        z * 1e-3 + normal[2] * out,
    ]
}

/// Seconds from one touch to another: up, across and turned, down.
fn seconds(from: ([f64; 3], f64), to: ([f64; 3], f64)) -> f64 {
    let (a, b) = (ball(from.0, RETRACT, from.1), ball(to.0, APPROACH, to.1));
    let across = (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) / SPEEDS.0;
    let turn = (from.1 - to.1).abs() / SPEEDS.1;
    (CLEAR - a[2]) / SPEEDS.0 + across.max(turn) + (CLEAR - b[2]) / SPEEDS.0
}

fn total(at: &[[f64; 3]], walk: &[(usize, f64)]) -> f64 {
    let one =
        |pair: &[(usize, f64)]| seconds((at[pair[0].0], pair[0].1), (at[pair[1].0], pair[1].1));
    walk.windows(2).map(one).sum()
}

/// The least of all orders at all poses.
fn least(
    at: &[[f64; 3]],
    poses: &[Vec<f64>],
    datum: &[usize],
    walk: &mut Vec<(usize, f64)>,
) -> f64 {
    if walk.len() == at.len() {
        return total(at, walk);
    }
    let mut best = f64::INFINITY;
    let datum_left = datum
        .iter()
        .any(|one| walk.iter().all(|(done, _)| done != one));
    for next in 0..at.len() {
        if walk.iter().any(|(done, _)| *done == next) || datum_left && !datum.contains(&next) {
            continue;
        }
        for &pose in &poses[next] {
            walk.push((next, pose));
            best = best.min(least(at, poses, datum, walk));
            walk.pop();
        }
    }
    best
}

/// Numbers that look like chance.
fn scattered(count: usize, salt: usize) -> Vec<[f64; 3]> {
    let part = |at: usize, by: usize| ((at * by + salt * 7919) % 101) as f64 / 101.0;
    (0..count)
        .map(|at| {
            [
                140.0 * part(at, 37) - 70.0,
                140.0 * part(at, 53) - 70.0,
                20.0 * part(at, 71),
            ]
        })
        .collect()
}

/// The walk of an answer: what it says is what it does.
fn walk(planned: &Planned, at: &[[f64; 3]], poses: &[Vec<f64>]) -> Vec<(usize, f64)> {
    let order = &planned.order;
    let walk: Vec<(usize, f64)> = (order.order.iter())
        .map(|&point| {
            (
                point as usize,
                planned.plan.points[point as usize].rotary_positions[0],
            )
        })
        .collect();
    for (point, pose) in &walk {
        assert!(poses[*point].contains(pose), "{point} at {pose}");
    }
    let own = total(at, &walk);
    // The inverse ends within 0.1 µm: 1 µs of an axis, in four legs of each way.
    assert!(
        (own - order.air_time).abs() < 4e-6 * walk.len() as f64,
        "{own} {}",
        order.air_time
    );
    let c = order
        .axis_names
        .iter()
        .position(|name| name == "C")
        .expect("C");
    for one in order
        .moves
        .iter()
        .filter(|one| one.kind != probecell_msgs::ProbingMove::CLEARANCE)
    {
        let pose = planned.plan.points[one.point_index as usize].rotary_positions[0];
        assert!((one.axis_positions[c] - pose).abs() < 1e-9, "{one:?}");
    }
    walk
}

#[test]
fn order_and_poses_are_those_of_the_least_of_all() {
    let mut shorter = 0;
    for salt in 0..6 {
        let at = scattered(5, salt);
        let first: Vec<f64> = (0..5)
            .map(|point| 90.0 * ((point + salt) % 4) as f64 - 90.0)
            .collect();
        let datum: &[usize] = if salt % 2 == 0 { &[] } else { &[1, 4] };
        let config = spheres(&at, &first, &[0.0, 120.0, -60.0], datum);
        let poses: Vec<Vec<f64>> = config.part.poses().iter().map(|of| of.concat()).collect();
        let planned = planned(&config).expect("a plan");
        assert!(planned.order.optimal);
        let walk = walk(&planned, &at, &poses);
        let best = least(&at, &poses, datum, &mut Vec::new());
        let own = total(&at, &walk);
        assert!(own <= best + 4e-5, "{salt}: {own} against {best}");
        // What it is measured by: the first poses, datum features first, as listed.
        let mut listed: Vec<usize> = (0..5).collect();
        listed.sort_by_key(|point| !datum.contains(point));
        let given: Vec<(usize, f64)> = listed
            .iter()
            .map(|&point| (point, poses[point][0]))
            .collect();
        assert!((total(&at, &given) - planned.order.given_air_time).abs() < 2e-5);
        let firsts: Vec<Vec<f64>> = poses.iter().map(|of| vec![of[0]]).collect();
        let alone = least(&at, &firsts, datum, &mut Vec::new());
        assert!(best <= alone + 1e-9);
        shorter += u32::from(best < 0.98 * alone);
    }
    assert!(
        shorter >= 4,
        "poses shorten {shorter} of 6 plans by 2 % and more"
    );
}

/// More points than are solved exactly.
#[test]
fn a_larger_part_is_searched_and_never_longer_than_the_order_given() {
    let at = scattered(30, 3);
    let first: Vec<f64> = (0..30)
        .map(|point| 90.0 * f64::from(point % 4) - 90.0)
        .collect();
    let config = spheres(&at, &first, &[0.0, 120.0, -60.0], &[2, 17]);
    let poses: Vec<Vec<f64>> = config.part.poses().iter().map(|of| of.concat()).collect();
    let found = planned(&config).expect("a plan");
    let walk = walk(&found, &at, &poses);
    let mut points: Vec<usize> = walk.iter().map(|(point, _)| *point).collect();
    assert_eq!(
        {
            let mut datum = points[..2].to_vec();
            datum.sort_unstable();
            datum
        },
        [2, 17]
    );
    points.sort_unstable();
    assert_eq!(points, (0..30).collect::<Vec<_>>());
    assert!(found.order.air_time < 0.8 * found.order.given_air_time);
    // With the first poses alone it takes longer.
    let alone = planned(&spheres(&at, &first, &[], &[2, 17])).expect("a plan");
    assert!(
        found.order.air_time < 0.95 * alone.order.air_time,
        "{} {}",
        found.order.air_time,
        alone.order.air_time
    );
    assert_eq!(found, planned(&config).expect("a plan"));
}

#[test]
fn poses_out_of_reach_are_left_out_and_a_point_without_any_is_named() {
    let at = [[30.0, 0.0, 0.0], [-30.0, 0.0, 0.0], [0.0, 40.0, 0.0]];
    // 500° is more than the table turns.
    let config = spheres(&at, &[500.0, 0.0, 0.0], &[90.0, 600.0], &[]);
    let found = planned(&config).expect("a plan");
    assert!((found.plan.points[0].rotary_positions[0] - 90.0_f64.to_radians()).abs() < 1e-12);
    let error = |config: &Config| planned(config).expect_err("no pose").to_string();
    let none = error(&spheres(&at, &[0.0, 500.0, 0.0], &[600.0], &[]));
    assert!(
        none.starts_with(
            "point 1 cannot be touched at any of its 2 rotary positions; at the first: "
        ),
        "{none}"
    );
    let only = error(&spheres(&at, &[0.0, 0.0, 500.0], &[], &[]));
    assert!(only.starts_with("point 2 cannot be touched: "), "{only}");
}

/// A point may be touched a little off facing, so that neighbours need no turn between them.
#[test]
fn points_around_a_shaft_are_touched_from_where_their_neighbours_are() {
    let shaft = |offsets: &str| {
        let text = format!(
            r#"
            id = "shaft"
            indexing_axis = "C"
            facing = [1.0, 0.0, 0.0]
            {offsets}
            approach_mm = 1.0
            retract_mm = 1.0
            feed_mm_per_min = 300.0
            stylus = {{ id = "s", ball_center_mm = [0.0, 0.0, 0.0], ball_radius_mm = 2.0 }}
            [[features]]
            id = "D"
            kind = "cylinder"
            axis = [0.0, 0.0, 1.0]
            radius_mm = 10.0
            tolerance_um = [-10.0, 10.0]
            touch_angles_deg = [0.0, 40.0]
            touch_heights_mm = [0.0, 10.0]
            "#
        );
        let settings = RawConfig {
            clearance_axis: "X".to_owned(),
            clearance_mm: 30.0,
            ..RawConfig::default()
        };
        checked(&text, ROBOT, &settings)
    };
    let facing = planned(&shaft("").expect("a part")).expect("a plan");
    let off =
        planned(&shaft("indexing_offsets_deg = [-20.0, 20.0]").expect("a part")).expect("a plan");
    assert!(
        off.order.air_time < facing.order.air_time - 0.2,
        "{} {}",
        off.order.air_time,
        facing.order.air_time
    );
    let turns = |planned: &Planned| -> Vec<i64> {
        let points = planned.plan.points.iter();
        points
            .map(|point| (point.rotary_positions[0].to_degrees()).round() as i64)
            .collect()
    };
    // The part's direction across its axis is -Y: that point faces +X at 90°.
    let faced = turns(&facing);
    assert_eq!((faced[0] - faced[1]).abs(), 40);
    let off = turns(&off);
    assert!(off.iter().all(|turn| *turn == off[0]), "{off:?}");
    let refused = shaft("rotary_alternatives_deg = [[0.0]]").expect_err("no such axes");
    assert_eq!(
        refused,
        "part: number 0 of rotary_alternatives_deg has 1 positions for the 0 axes of part.rotary_axes"
    );
}

#[test]
fn lists_that_cannot_be_used_are_told_with_their_place() {
    let part = |of_part: &str, of_feature: &str| {
        let touched = if of_feature.contains("touch_points_mm") {
            ""
        } else {
            "touch_points_mm = [[0.0, 0.0, 1.0]]"
        };
        let text = format!(
            r#"
            id = "ball"
            rotary_axes = ["C"]
            {of_part}
            approach_mm = 1.0
            retract_mm = 1.0
            feed_mm_per_min = 300.0
            stylus = {{ id = "s", ball_center_mm = [0.0, 0.0, 0.0], ball_radius_mm = 2.0 }}
            [[features]]
            id = "B"
            kind = "sphere"
            radius_mm = 10.0
            tolerance_um = [-10.0, 10.0]
            {touched}
            {of_feature}
            "#
        );
        checked(&text, ROBOT, &RawConfig::default()).map(|config| config.part.poses()[0].len())
    };
    assert_eq!(part("", ""), Ok(1));
    assert_eq!(
        part("rotary_alternatives_deg = [[90.0], [180.0]]", ""),
        Ok(3)
    );
    // A feature's own list takes the place of the part's; the same pose twice is one.
    assert_eq!(
        part(
            "rotary_alternatives_deg = [[90.0], [180.0]]",
            "rotary_alternatives_deg = [[45.0]]"
        ),
        Ok(2)
    );
    assert_eq!(
        part("", "rotary_alternatives_deg = [[0.0], [45.0], [45.0]]"),
        Ok(2)
    );
    let many = vec!["[1.0]"; 33].join(", ");
    for (of_part, of_feature, expected) in [
        (
            "",
            "rotary_alternatives_deg = [[0.0], [0.0, 90.0]]".to_owned(),
            "feature \"B\": number 1 of rotary_alternatives_deg has 2 positions for the 1 axes of part.rotary_axes",
        ),
        (
            "rotary_alternatives_deg = [[]]",
            String::new(),
            "part: number 0 of rotary_alternatives_deg has 0 positions for the 1 axes of part.rotary_axes",
        ),
        (
            "",
            "rotary_alternatives_deg = [[nan]]".to_owned(),
            "part.rotary_alternatives_deg = NaN is not within 10 turns of 0, ±3600°",
        ),
        (
            "",
            "rotary_deg = [1000000]".to_owned(),
            "part.rotary_deg = 1000000 is not within 10 turns of 0, ±3600°",
        ),
        (
            "",
            format!(
                "touch_points_mm = [{}]",
                vec!["[0.0, 0.0, 1.0]"; 100_000].join(", ")
            ),
            "part.features have 100000 touches together, more than 3000 in one order",
        ),
        (
            "",
            format!("rotary_alternatives_deg = [{many}]"),
            "feature \"B\" has 33 poses besides the first, more than 32",
        ),
        (
            "indexing_offsets_deg = [15.0]",
            String::new(),
            "part.indexing_offsets_deg is given, but no part.indexing_axis",
        ),
    ] {
        assert_eq!(part(of_part, &of_feature), Err(expected.to_owned()));
    }
}

/// Two touches of one face: while the table turns, what stands beside the face may come into a straight way.
#[test]
fn between_two_poses_the_way_leads_over_the_clear_position() {
    let text = r#"
        id = "face"
        rotary_axes = ["C"]
        approach_mm = 1.0
        retract_mm = 2.0
        feed_mm_per_min = 300.0
        stylus = { id = "s", ball_center_mm = [0.0, 0.0, 0.0], ball_radius_mm = 2.0 }
        [[features]]
        id = "top"
        kind = "plane"
        axis = [0.0, 0.0, 1.0]
        tolerance_um = [-10.0, 10.0]
        touch_points_mm = [[20.0, 0.0, 0.0], [-20.0, 0.0, 0.0]]
        "#;
    let settings = RawConfig {
        clearance_axis: "Z".to_owned(),
        clearance_mm: CLEAR * 1e3,
        ..RawConfig::default()
    };
    let config = checked(text, ROBOT, &settings).expect("a part");
    // Before the first touch, between both, and after the last.
    for (turn, clear) in [(0.0, 2), (1.0, 4)] {
        let mut plan = config.part.plan(0.0);
        plan.points[1].rotary_positions = vec![turn];
        let order = config.rules().order(&plan, &[]).expect("in reach");
        let moves = order.moves.iter();
        let over = moves.filter(|one| one.kind == ProbingMove::CLEARANCE);
        assert_eq!(over.count(), clear, "{turn} rad");
    }
}

/// With a stem, a face cannot be touched through the part, however near that pose is.
#[test]
fn a_pose_at_which_the_stem_would_go_through_the_part_is_left_out() {
    let urdf = include_str!("../../../../launch-scripts/wcbxfzyst.urdf");
    let face = |id: &str, side: f64, touches: &str| {
        format!(
            r#"
            [[features]]
            id = "{id}"
            kind = "plane"
            origin_mm = [{}, 0.0, 0.0]
            axis = [{side}, 0.0, 0.0]
            tolerance_um = [-10.0, 10.0]
            touch_points_mm = [{touches}]
            rotary_deg = [{}, 0.0, 0.0]
            "#,
            30.0 * side,
            -90.0 * side
        )
    };
    let touches = "[0.0, -20.0, 20.0], [0.0, 20.0, 20.0], [0.0, 0.0, 40.0]";
    let text = format!(
        r#"
        id = "block"
        rotary_axes = ["B", "C", "S"]
        rotary_alternatives_deg = [[-90.0, 0.0, 0.0], [90.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        approach_mm = 2.0
        retract_mm = 2.0
        feed_mm_per_min = 300.0
        stylus = {{ id = "s", ball_center_mm = [0.0, 0.0, -100.0], ball_radius_mm = 2.0 }}
        {}
        {}
        [[features]]
        id = "top"
        kind = "plane"
        origin_mm = [0.0, 0.0, 50.0]
        axis = [0.0, 0.0, 1.0]
        tolerance_um = [-10.0, 10.0]
        touch_points_mm = [[20.0, 20.0, 50.0], [-20.0, 20.0, 50.0], [0.0, -20.0, 50.0]]
        "#,
        face("right", 1.0, touches),
        face("left", -1.0, touches)
    );
    // Where an axis goes clear there are ways to every pose, and without the upright one those through the part are nearest.
    let over = RawConfig {
        clearance_axis: "Z".to_owned(),
        clearance_mm: 300.0,
        ..RawConfig::default()
    };
    let tilted = text.replace(", [0.0, 0.0, 0.0]]", "]");
    for (text, settings) in [(text, RawConfig::default()), (tilted, over)] {
        let config = checked(&text, urdf, &settings).expect("a part");
        let found = planned(&config).expect("a plan");
        let order = &found.order;
        assert!(
            order.air_time <= order.given_air_time,
            "{} {}",
            order.air_time,
            order.given_air_time
        );
        for point in &found.plan.points {
            let tilt = point.rotary_positions[0].to_degrees().round() as i64;
            let through = [90, -90, i64::MAX][point.feature as usize];
            assert_ne!(tilt, through, "feature {}", point.feature);
        }
    }
}

/// The same limits where a plan comes from a recording or from the bus, past the cell file.
#[test]
fn a_plan_that_winds_an_axis_up_or_has_too_many_touches_is_refused_at_once() {
    let config = spheres(&[[0.0, 0.0, 0.0]], &[0.0], &[], &[]);
    let refused = |edit: fn(&mut InspectionPlan)| {
        let mut plan = config.part.plan(0.0);
        edit(&mut plan);
        let points: Vec<u32> = (0..plan.points.len() as u32).collect();
        let request = OrderRequest {
            plan: &plan,
            points: &points,
            stages: &[],
            poses: &[],
            seeds: &[],
            here: None,
        };
        let refused = Task::new(&config.rules(), &request).expect_err("beyond the limits");
        refused.to_string()
    };
    assert_eq!(
        refused(|plan| plan.points[0].rotary_positions[0] = 1e6_f64.to_radians()),
        "point 0: rotary axis \"C\" would turn to 1000000°, more than 10 turns"
    );
    assert_eq!(
        refused(|plan| plan.points = vec![plan.points[0].clone(); 100_000]),
        "the plan has 100000 touches, more than 3000 in one order"
    );
}
