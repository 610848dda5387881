//! An arm with the joints of `launch-scripts/robot_arm.urdf`, as a maker would ship it: without the links of a cell. Arms that
//! makers do ship are in `tests/interop/arms/new_robot.py`.

use cell::{
    Cell,
    new_robot::{NewRobotError, Wanted, new_robot},
};

const TWO_PARALLEL: [&str; 6] = [
    "0 0 0.18 0 0 0;0 0 1",
    "0 0 0 0 0 0;0 1 0",
    "0 0 0.61 0 0 0;0 1 0",
    "0 0 0.57 0 0 0;0 0 1",
    "0 0 0 0 0 0;0 1 0",
    "0 0 0.12 0 0 0;0 0 1",
];

/// A chain of joints that turn, by the place and attitude of each and its axis.
fn arm(joints: &[&str], limit: &str) -> String {
    let links: Vec<String> = (0..=joints.len())
        .map(|number| format!("<link name=\"l{number}\"/>"))
        .collect();
    let joints: Vec<String> = (joints.iter().enumerate())
        .map(|(number, joint)| {
            let (origin, axis) = joint.split_once(';').expect("an axis");
            let (at, turned) = origin.split_at(origin.match_indices(' ').nth(2).expect("six numbers").0);
            format!(
                "<joint name=\"j{}\" type=\"revolute\"><parent link=\"l{number}\"/><child link=\"l{}\"/>\
                 <origin xyz=\"{at}\" rpy=\"{turned}\"/><axis xyz=\"{axis}\"/>{limit}</joint>",
                number + 1,
                number + 1
            )
        })
        .collect();
    format!(
        "<robot name=\"arm\">{}{}</robot>",
        links.concat(),
        joints.concat()
    )
}

const LIMIT: &str = r#"<limit lower="-2.9" upper="2.9" velocity="2" effort="50"/>"#;

fn wanted() -> Wanted {
    Wanted {
        name: "mine".to_owned(),
        description: "mine.urdf".to_owned(),
        stylus: 0.1,
        ball_radius: 0.002,
        ..Wanted::default()
    }
}

fn refused(description: &str, wanted: &Wanted) -> String {
    match new_robot(description, wanted, &mut |_| {}) {
        Err(error) => error.to_string(),
        Ok(made) => panic!("a cell: {:?}", made.assumed),
    }
}

#[test]
fn a_cell_is_found_that_can_be_planned() {
    let made = new_robot(&arm(&TWO_PARALLEL, LIMIT), &wanted(), &mut |_| {}).expect("a cell");
    assert!(
        made.assumed.iter().any(|one| one == "probe_mount is at l6"),
        "{:?}",
        made.assumed
    );
    assert!(
        made.text.cell.contains("EB0j2"),
        "the zero of the second joint is planted"
    );
    // Third number of each line with a key, mm.
    let heights = |key: &str| -> Vec<f64> {
        let lines = made.text.cell.lines().filter(|line| line.starts_with(key));
        let height = |line: &str| {
            line.split([',', ']'])
                .nth(2)
                .and_then(|one| one.trim().parse().ok())
        };
        lines
            .map(|line| height(line).expect("three lengths"))
            .collect()
    };
    let part = heights("position_mm")[0];
    let balls = heights("origin_mm");
    assert_eq!(balls.len(), 15);
    assert!(
        balls.iter().all(|ball| part + ball > 29.9),
        "below the base: {part} {balls:?}"
    );
    let cell = Cell::from_text(made.text).expect("a cell");
    let planned = cell
        .measuring_order(0.0, &|_| true, &mut |_| {})
        .expect("an order");
    assert_eq!(planned.order.order.len(), 75);
}

#[test]
fn what_an_arm_lacks_is_named() {
    let five = refused(&arm(&TWO_PARALLEL[..5], LIMIT), &wanted());
    assert!(
        five.contains("between its root and l5 the arm has 5 joints that move (j1, "),
        "{five}"
    );
    let still = arm(
        &TWO_PARALLEL,
        r#"<limit lower="-1" upper="1" velocity="0" effort="1"/>"#,
    );
    let still = refused(&still, &wanted());
    assert!(
        still.contains("j1") && still.contains("velocity 0"),
        "{still}"
    );
    let mut short = TWO_PARALLEL;
    short[5] = "0 0 0 0 0 0;0 0 1";
    let short = refused(&arm(&short, LIMIT), &wanted());
    assert!(short.contains("--stem 0,0,1"), "{short}");
    let sliding = arm(&TWO_PARALLEL, LIMIT).replacen("revolute", "prismatic", 1);
    let sliding = refused(&sliding, &wanted());
    assert!(sliding.starts_with("joint j1 slides"), "{sliding}");
    let mut named = wanted();
    named.name = "my-robot".to_owned();
    let named = refused(&arm(&TWO_PARALLEL, LIMIT), &named);
    assert!(
        named.starts_with("--out: \"my-robot\" names the cell"),
        "{named}"
    );
    let mut outside = wanted();
    outside.held = vec![("j2".to_owned(), 3.0)];
    let outside = refused(&arm(&TWO_PARALLEL, LIMIT), &outside);
    assert!(outside.starts_with("--hold j2=171.887"), "{outside}");
    let mut held = wanted();
    held.held = vec![("j9".to_owned(), 0.0)];
    let held = refused(&arm(&TWO_PARALLEL, LIMIT), &held);
    assert!(held.starts_with("--hold j9: not a joint"), "{held}");
}

#[test]
fn an_arm_that_cannot_reach_the_balls_is_refused() {
    let tiny = arm(
        &TWO_PARALLEL,
        r#"<limit lower="-0.1" upper="0.1" velocity="2" effort="1"/>"#,
    );
    let error = new_robot(&tiny, &wanted(), &mut |_| {}).expect_err("no place");
    assert!(
        matches!(error, NewRobotError::Place { reached: 0, .. }),
        "{error}"
    );
}
