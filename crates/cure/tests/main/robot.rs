//! Calibrated robot descriptions: read again, they are the nominal machine with the errors that the contract puts behind its origins;
//! every other byte stays. `tests/interop/arms/calibrated.py` reads them by Pinocchio.

use machine::Side;
use machine::{Chain, ChainErrors, LinkError};
use rand::Rng;
use serde_json::Value;

use crate::known::{effect, file, parameter, proves, random, report, written};

/// Joints with and without origin, with half of one, and with a comment inside.
const ARM: &str = r#"<?xml version="1.0"?>
<!-- An arm. -->
<robot name="arm"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
  <link name="a"/>
  <link name="b"/>
  <joint name="fixed" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
  <joint type="revolute" name="j1">
    <!-- the first --><parent link="foundation"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="j2" type="revolute"><origin xyz="0.1 0 0.4" /><parent link="a"/><child link="b"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="j3" type="revolute"><parent link="b"/><child link="probe_mount"/><origin
      rpy="1.57 0.1 -0.2"   xyz='0 0.02 0.3'/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>
"#;

fn effects(errors: &[(&str, f64)]) -> Vec<Value> {
    let of = |&(name, value): &(&str, f64)| {
        let unit = if name.starts_with("EX") || name.starts_with("EZ") {
            "m"
        } else {
            "rad"
        };
        effect(&format!("link.{name}"), &[parameter("e", value, unit)])
    };
    errors.iter().map(of).collect()
}

fn urdf(errors: &[(&str, f64)]) -> Result<String, String> {
    let arm = file("arm.urdf", ARM);
    let report = report(&effects(errors));
    written(&report, "urdf", |ask| ask.urdf = Some(&arm))
}

#[test]
fn the_written_machine_is_the_nominal_one_with_its_errors() {
    let nominal = Chain::from_urdf(ARM).expect("a machine");
    for seed in 0..100 {
        let mut random = random(seed);
        let mut size = || random.random_range(-2e-3..2e-3);
        let errors = [
            ("EX0j1", size()),
            ("EC0j1", size()),
            ("EA0j2", size()),
            ("EB0j2", size()),
            ("EZ0j3", size()),
            ("EC0j3", size()),
        ];
        let turned = errors.map(|(name, value)| (name, -value));
        let links =
            errors.map(|(name, value)| LinkError::named(&nominal, name, value).expect("an error"));
        let known = ChainErrors::of_links(&nominal, &links);
        let chain = |text: String| Chain::from_urdf(&text).expect("a machine");
        let (cured, wrong) = (
            chain(urdf(&errors).expect("written")),
            chain(urdf(&turned).expect("written")),
        );
        let mut gaps = [0.0; 3];
        for _ in 0..10 {
            let positions: Vec<f64> = (0..3).map(|_| random.random_range(-3.0..3.0)).collect();
            let truth = nominal.end_pose_with(Side::Tool, &positions, &known);
            for (gap, model) in gaps.iter_mut().zip([&nominal, &cured, &wrong]) {
                let pose = model.end_pose(Side::Tool, &positions);
                *gap += (pose.translation.vector - truth.translation.vector).norm_squared();
            }
        }
        proves("urdf", gaps[0].sqrt(), gaps[1].sqrt(), gaps[2].sqrt());
    }
}

#[test]
fn every_other_byte_stays() {
    let text = urdf(&[("EX0j1", 1e-3), ("EX0j2", 1e-3), ("EX0j3", 1e-3)]).expect("written");
    let begin = text.find("<!-- probecell cure").expect("the head");
    let end = begin + text[begin..].find("-->\n").expect("its end") + 4;
    let head = &text[begin..end];
    assert!(
        head.contains("sha256 d1e5")
            && head.contains("j2 x: 0.1 to 0.101")
            && head.contains("undo: use arm.urdf"),
        "{head}"
    );
    let rest = text.replace(head, "");
    let expected = ARM
        .replace(
            "<joint type=\"revolute\" name=\"j1\">",
            "<joint type=\"revolute\" name=\"j1\"><origin xyz=\"0.001 0 0\" rpy=\"0 0 0\"/>",
        )
        .replace(
            "<origin xyz=\"0.1 0 0.4\" />",
            "<origin rpy=\"0 0 0\" xyz=\"0.101 0 0.4\" />",
        );
    let (known, new) = (expected.split("<origin\n"), rest.split("<origin\n"));
    let pairs: Vec<(&str, &str)> = known.zip(new).collect();
    assert_eq!(pairs[0].0, pairs[0].1);
    let tail = |text: &str| text[text.find("/>").expect("its end")..].to_owned();
    assert_eq!(tail(pairs[1].0), tail(pairs[1].1));
}

#[test]
fn what_has_no_place_is_named() {
    assert!(
        urdf(&[("EX0j9", 1e-3)])
            .expect_err("refused")
            .contains("arm.urdf: it has no joint j9, in which link.EX0j9 was found")
    );
    let report = report(&effects(&[("EX0j1", 1e-3)]));
    let arm = file("arm.urdf", ARM);
    let of = |format| written(&report, format, |ask| ask.urdf = Some(&arm));
    assert!(
        of("ur-kinematics")
            .expect_err("refused")
            .contains("no arm of Universal Robots")
    );
    assert!(
        written(&report, "urdf", |_| ())
            .expect_err("refused")
            .contains("urdf needs --urdf FILE")
    );
    let offsets = of("robot-calibration").expect("written");
    assert!(
        offsets.contains("\nj1_x: 0.001\n") && offsets.contains("\nj1_c: 0\n"),
        "{offsets}"
    );
}
