//! A robot description that is not a machine is refused with a sentence that names what is wrong.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

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
        "does not hang on `foundation` but on `ram`",
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
    check(&nested, "has 100001 elements nested in one another, more than 100");
    check(&"<link>".repeat(100_000), "has 100001 elements nested in one another, more than 100");
    let chain = |count: usize| {
        let mut text = LINKS.to_owned();
        for index in 0..count {
            let parent = index.checked_sub(1).map_or("foundation".to_owned(), |one| format!("l{one}"));
            text += &format!(
                r#"<link name="l{index}"/><joint name="j{index}" type="fixed"><parent link="{parent}"/><child link="l{index}"/></joint>"#
            );
        }
        text + &PART.replace("foundation", &format!("l{}", count - 1)) + TOOL
    };
    check(&chain(10_000), "has 10003 links, more than 2000");
    check(&chain(200), "has 51 joints on the way to one link, more than 50");
    let text = format!("<robot name=\"r\">{}</robot>", chain(20));
    assert!(Chain::from_urdf(&text).is_ok());
    let comment = format!("<robot name=\"r\"><!--{}--></robot>", "x".repeat(17 << 20));
    let refused = Chain::from_urdf(&comment).unwrap_err().to_string();
    assert!(refused.contains("bytes, more than 16777216"), "{refused}");
}
