//! A robot description that is not a machine is refused with a sentence that names what is wrong.

use machine::Chain;

const PART: &str = r#"<joint name="part" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>"#;
const TOOL: &str = r#"<joint name="Z" type="prismatic"><parent link="foundation"/><child link="probe_mount"/>
  <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="0" velocity="1"/></joint>"#;
const LINKS: &str =
    r#"<link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>"#;

fn check(body: &str, expected: &str) {
    let text = format!("<robot name=\"r\">{body}</robot>");
    let error = Chain::from_urdf(&text).unwrap_err().to_string();
    assert!(
        error.contains(expected),
        "got: {error}\nexpected: {expected}"
    );
}

#[test]
fn the_smallest_machine_is_accepted() {
    let chain =
        Chain::from_urdf(&format!("<robot name=\"r\">{LINKS}{PART}{TOOL}</robot>")).unwrap();
    assert_eq!(chain.axis_names().collect::<Vec<_>>(), ["Z"]);
}

#[test]
fn text_that_is_no_urdf_is_refused() {
    assert!(
        Chain::from_urdf("not xml")
            .unwrap_err()
            .to_string()
            .contains("not a valid URDF")
    );
}

/// A hundred kilobytes that would become gigabytes, or minutes.
#[test]
fn what_a_parser_would_blow_up_is_refused_before() {
    let entity = "x".repeat(50_000);
    let uses = "&a;".repeat(50_000);
    let text = format!("<!DOCTYPE r [<!ENTITY a \"{entity}\">]><robot name=\"{uses}\"/>");
    let error = Chain::from_urdf(&text).unwrap_err().to_string();
    assert!(error.contains("it defines entities"), "{error}");
    let many: Vec<String> = (0..100_000).map(|one| format!("a{one}=\"1\"")).collect();
    let text = format!("<robot name=\"r\" {}/>", many.join(" "));
    let error = Chain::from_urdf(&text).unwrap_err().to_string();
    assert!(
        error.contains("100001 attributes of one element"),
        "{error}"
    );
}

#[test]
fn missing_links_are_named() {
    check(
        r#"<link name="foundation"/><link name="probe_mount"/>"#,
        "no link `workpiece`",
    );
    check(
        r#"<link name="foundation"/><link name="workpiece"/>"#,
        "no link `probe_mount`",
    );
    check(
        r#"<link name="probe_mount"/><link name="workpiece"/>"#,
        "no link `foundation`",
    );
    let stray = TOOL.replace(r#"child link="probe_mount""#, r#"child link="nose""#);
    check(
        &format!("{LINKS}{PART}{stray}"),
        "joint `Z` names link `nose`",
    );
}

#[test]
fn a_branch_that_begins_elsewhere_is_refused() {
    let adrift = TOOL.replace(r#"parent link="foundation""#, r#"parent link="ram""#);
    check(
        &format!(r#"{LINKS}<link name="ram"/>{PART}{adrift}"#),
        "is `ram`, not `foundation`",
    );
}

#[test]
fn loops_are_refused() {
    check(
        &format!("{LINKS}{PART}{TOOL}{}", TOOL.replace("\"Z\"", "\"W\"")),
        "more than one joint",
    );
    let ring = r#"<joint name="a" type="fixed"><parent link="probe_mount"/><child link="ram"/></joint>
      <joint name="b" type="fixed"><parent link="ram"/><child link="probe_mount"/></joint>"#;
    check(&format!(r#"{LINKS}<link name="ram"/>{PART}{ring}"#), "loop");
}

#[test]
fn unusable_joints_are_named() {
    check(
        &format!("{LINKS}{PART}{}", TOOL.replace("prismatic", "floating")),
        "joint `Z` has type floating",
    );
    check(
        &format!("{LINKS}{PART}{}", TOOL.replace("0 0 1", "0 0 0")),
        "joint `Z` has an unusable axis",
    );
    check(
        &format!("{LINKS}{PART}{}", TOOL.replace("0 0 1", "0 0 NaN")),
        "joint `Z` has an unusable axis",
    );
    // Its length overflows, so that normalising it leaves no direction.
    check(
        &format!("{LINKS}{PART}{}", TOOL.replace("0 0 1", "0 0 1e308")),
        "joint `Z` has an unusable axis",
    );
    let shifted = TOOL.replace("<axis", r#"<origin xyz="inf 0 0"/><axis"#);
    check(
        &format!("{LINKS}{PART}{shifted}"),
        "joint `Z` has an unusable origin",
    );
    let coupled = TOOL.replace("<axis", r#"<mimic joint="part"/><axis"#);
    check(&format!("{LINKS}{PART}{coupled}"), "mimics");
    check(
        &format!("{LINKS}{PART}{}", TOOL.replace("\"Z\"", "\"part\"")),
        "two joints named `part`",
    );
}

/// Each of these would follow its nesting by recursion, or the chain link by link, for minutes.
#[test]
fn what_is_larger_than_any_machine_is_refused_before_it_is_followed() {
    let nested = format!("{}{}", "<link>".repeat(100_000), "</link>".repeat(100_000));
    check(
        &nested,
        "has 100001 elements nested in one another, more than 100",
    );
    check(
        &"<link>".repeat(100_000),
        "has 100001 elements nested in one another, more than 100",
    );
    let chain = |count: usize| {
        let mut text = LINKS.to_owned();
        for index in 0..count {
            let parent = index
                .checked_sub(1)
                .map_or("foundation".to_owned(), |one| format!("l{one}"));
            let link = format!(
                r#"<link name="l{index}"/><joint name="j{index}" type="fixed"><parent link="{parent}"/><child link="l{index}"/></joint>"#
            );
            text += &link;
        }
        text + &PART.replace("foundation", &format!("l{}", count - 1)) + TOOL
    };
    check(&chain(10_000), "has 10003 links, more than 2000");
    check(
        &chain(200),
        "has 51 joints on the way to one link, more than 50",
    );
    let text = format!("<robot name=\"r\">{}</robot>", chain(20));
    assert!(Chain::from_urdf(&text).is_ok());
    let comment = format!("<robot name=\"r\"><!--{}--></robot>", "x".repeat(17 << 20));
    let refused = Chain::from_urdf(&comment).unwrap_err().to_string();
    assert!(refused.contains("bytes, more than 16777216"), "{refused}");
}

#[test]
fn what_the_format_requires_is_named_where_it_is_lacking() {
    for (wrong, expected) in [
        (
            TOOL.replace(" type=\"prismatic\"", ""),
            "joint `Z` has no attribute `type` in its `joint`",
        ),
        (
            TOOL.replace("<parent link=\"foundation\"/>", ""),
            "joint `Z` has no `parent`",
        ),
        (
            TOOL.replace("velocity=\"1\"", ""),
            "joint `Z` has no attribute `velocity` in its `limit`",
        ),
        (
            TOOL.replace("lower=\"-1\"", "lower=\"low\""),
            "joint `Z` has lower=\"low\" in its `limit`, expected 1 numbers",
        ),
        (
            TOOL.replace("0 0 1", "0 0"),
            "joint `Z` has xyz=\"0 0\" in its `axis`, expected 3 numbers",
        ),
    ] {
        check(&format!("{LINKS}{PART}{wrong}"), expected);
    }
    let heavy = LINKS.replace(
        "<link name=\"probe_mount\"/>",
        "<link name=\"probe_mount\"><inertial><mass value=\"1\"/></inertial></link>",
    );
    check(
        &format!("{heavy}{PART}{TOOL}"),
        "link `probe_mount` has no `inertia` in its `inertial`",
    );
    let other = Chain::from_urdf("<robots/>").unwrap_err().to_string();
    assert!(
        other.contains("its root is `robots`, not `robot`"),
        "{other}"
    );
}

/// A frame turned by a quarter about Z, as angles and as a quaternion.
#[test]
fn a_turn_may_be_written_as_angles_or_as_a_quaternion() {
    let turned = |origin: &str| {
        let tool = TOOL.replace("<axis", &format!("<origin xyz=\"1 2 3\" {origin}/><axis"));
        let text = format!("<robot name=\"r\" version=\"1.2\">{LINKS}{PART}{tool}</robot>");
        let chain = Chain::from_urdf(&text).unwrap();
        chain.axis(0).origin.to_homogeneous()
    };
    let half = 0.5_f64.sqrt();
    let by_angles = turned("rpy=\"0 0 1.5707963267948966\"");
    let by_quaternion = turned(&format!("quat_xyzw=\"0 0 {half} {half}\""));
    assert!((by_angles - by_quaternion).abs().max() < 1e-12);
    assert!((by_angles[(1, 0)] - 1.0).abs() < 1e-12 && (by_angles[(2, 3)] - 3.0).abs() < 1e-12);
}

#[test]
fn a_xacro_is_named_with_what_expands_it() {
    let text = r#"<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><xacro:include filename="arm.xacro"/></robot>"#;
    let told = Chain::from_urdf(text).unwrap_err().to_string();
    assert!(told.contains("`xacro FILE -o robot.urdf`"), "{told}");
    // What xacro has expanded may still name its namespace.
    let text = format!(
        "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" name=\"r\">{LINKS}{PART}{TOOL}</robot>"
    );
    assert!(Chain::from_urdf(&text).is_ok());
}

#[test]
fn limits_that_no_axis_can_have_are_named() {
    let turning = TOOL.replace("prismatic", "revolute");
    let continuous = ", or make it `continuous` if it turns without limits";
    for (wrong, expected) in [
        (
            TOOL.replace("lower=\"-1\" upper=\"1\"", "lower=\"0.5\" upper=\"-0.5\""),
            "joint `Z` has its lower limit 0.5 above its upper limit -0.5: are they exchanged?",
        ),
        (
            TOOL.replace("lower=\"-1\" upper=\"1\"", ""),
            "joint `Z` has a travel from 0 to 0 (a limit that is left out is 0): state both limits",
        ),
        (
            turning.replace("lower=\"-1\" upper=\"1\"", "lower=\"0\" upper=\"0\""),
            &format!("state both limits{continuous}"),
        ),
        (
            turning.replace(
                "<limit lower=\"-1\" upper=\"1\" effort=\"0\" velocity=\"1\"/>",
                "",
            ),
            &format!("joint `Z` is revolute and has no `limit`: state it{continuous}"),
        ),
        (
            TOOL.replace("upper=\"1\"", "upper=\"inf\""),
            "joint `Z` has limits from -1 to inf, expected numbers",
        ),
        (
            TOOL.replace("velocity=\"1\"", "velocity=\"-3\""),
            "joint `Z` has velocity -3 in its `limit`, expected a speed above 0",
        ),
        (
            TOOL.replace("velocity=\"1\"", "velocity=\"nan\""),
            "joint `Z` has velocity NaN in its `limit`, expected a speed above 0",
        ),
        (
            turning
                .replace("revolute", "continuous")
                .replace("velocity=\"1\"", "velocity=\"0\""),
            "joint `Z` has velocity 0 in its `limit`, expected a speed above 0",
        ),
    ] {
        check(&format!("{LINKS}{PART}{wrong}"), expected);
    }
    let free = turning.replace("revolute", "continuous").replace(
        "<limit lower=\"-1\" upper=\"1\" effort=\"0\" velocity=\"1\"/>",
        "",
    );
    let chain =
        Chain::from_urdf(&format!("<robot name=\"r\">{LINKS}{PART}{free}</robot>")).unwrap();
    assert_eq!(chain.axis(0).limits, None);
}
