//! Arms in motion: the written description has what was found on top of what it declared, and every other byte of the given one.
//! `tests/interop/arms/corrected.py` reads it by Pinocchio and MuJoCo.

use diagnosis::Report;
use machine::{Inertial, inertial::declared_friction};
use nalgebra::{Matrix3, Vector3};
use serde_json::json;

use crate::known::{effect, file, parameter, report, written};

const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <link name="upper"><!-- kept --><inertial><mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
  <link name="flange" />
  <joint name="J1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <dynamics damping="0.5"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="J2" type="revolute"><parent link="upper"/><child link="flange"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>
"#;

/// A report of the efforts of an arm whose tool hangs on `flange`.
fn of_efforts(effects: &[serde_json::Value]) -> Report {
    let mut report = report(effects);
    "effort".clone_into(&mut report.channel);
    "N m".clone_into(&mut report.gap.unit);
    report.mount = Some("flange".to_owned());
    report
}

fn arm(effects: &[serde_json::Value], members: &[&str]) -> Result<String, String> {
    of(&of_efforts(effects), ARM, members)
}

fn of(report: &Report, urdf: &str, members: &[&str]) -> Result<String, String> {
    let urdf = file("arm.urdf", urdf);
    let members: Vec<String> = members.iter().map(|&one| one.to_owned()).collect();
    written(report, "urdf", |ask| {
        ask.urdf = Some(&urdf);
        ask.members = &members;
    })
}

fn load(mass: f64) -> serde_json::Value {
    let place = |name: &str, value: f64| parameter(name, value, "m");
    effect(
        "drive.payload",
        &[
            parameter("mass", mass, "kg"),
            place("x", 0.01),
            place("y", 0.0),
            place("z", 0.05),
        ],
    )
}

#[test]
fn masses_and_friction_are_added_to_what_is_declared() {
    let found = [
        effect(
            "drive.viscous_friction",
            &[parameter("J1.coefficient", 0.25, "N m per (rad/s)")],
        ),
        effect(
            "drive.coulomb_friction",
            &[
                parameter("J2.coefficient", 1.5, "N m"),
                parameter("J2.by_load", 0.1, "1"),
            ],
        ),
        load(1.5),
        effect(
            "drive.link_inertia",
            &[
                parameter("upper.mass", 0.4, "kg"),
                parameter("upper.mz", 0.24, "kg m"),
            ],
        ),
    ];
    let text = arm(&found, &[]).expect("written");
    assert_eq!(
        declared_friction(&text, "J1").expect("a robot"),
        Some([0.75, 0.0])
    );
    assert_eq!(
        declared_friction(&text, "J2").expect("a robot"),
        Some([0.0, 1.5])
    );
    let link = |name: &str| {
        Inertial::of_link(&text, name)
            .expect("a robot")
            .expect("a link")
    };
    let flange = link("flange");
    assert!(
        (flange.mass - 1.5).abs() < 1e-12
            && (flange.centre - Vector3::new(0.01, 0.0, 0.05)).norm() < 1e-12
    );
    let upper = link("upper");
    assert!((upper.mass - 2.4).abs() < 1e-12 && (upper.centre.z - 0.1).abs() < 1e-12);
    for needle in [
        "<!-- kept -->",
        "upper mass, kg: 2 to 2.4",
        "J1 damping: 0.5 to 0.75",
        "J2.by_load of drive.coulomb_friction has no place",
        "gap 0.000 N m to 0.000 N m on samples",
    ] {
        assert!(text.contains(needle), "{needle} in {text}");
    }
}

#[test]
fn a_body_that_cannot_exist_becomes_the_nearest_and_the_file_says_so() {
    let found = [effect(
        "drive.link_inertia",
        &[
            parameter("upper.mass", -3.0, "kg"),
            parameter("upper.izz", 5.0, "kg m²"),
        ],
    )];
    let text = arm(&found, &[]).expect("written");
    let upper = Inertial::of_link(&text, "upper")
        .expect("a robot")
        .expect("a link");
    let moments: Matrix3<f64> = upper.inertia;
    let mut moments = moments.symmetric_eigenvalues();
    moments.as_mut_slice().sort_by(f64::total_cmp);
    assert!(upper.mass > 0.0 && moments[0] > 0.0 && moments[0] + moments[1] >= moments[2]);
    assert!(
        text.contains("upper: no body has the inertia that was found"),
        "{text}"
    );
}

#[test]
fn what_is_not_sure_is_written_by_choice_only() {
    let mut vague = load(1.5);
    vague["parameters"][0]["ci95"] = json!([-0.5, 3.5]);
    let refused = arm(std::slice::from_ref(&vague), &[]).expect_err("refused");
    assert!(refused.contains("wider than the effect"), "{refused}");
    let text = arm(&[vague], &["drive.payload"]).expect("written");
    assert!(text.contains("a person chose to write it"), "{text}");
    // A constant of a drive has no place in a description.
    let other = [effect(
        "drive.friction_offset",
        &[parameter("J1.offset", 0.3, "N m")],
    )];
    let refused = arm(&other, &[]).expect_err("refused");
    assert!(
        refused.contains("urdf holds none of the causes"),
        "{refused}"
    );
}

#[test]
fn what_the_description_lacks_is_named() {
    let found = [effect(
        "drive.link_inertia",
        &[parameter("lower.mass", 0.4, "kg")],
    )];
    let refused = arm(&found, &[]).expect_err("refused");
    assert!(
        refused.contains("arm.urdf: it has no link lower, of which the report speaks"),
        "{refused}"
    );
}

#[test]
fn a_description_that_is_not_that_of_the_report_is_refused() {
    let found = [effect(
        "drive.link_inertia",
        &[parameter("upper.mx", 0.1, "kg m")],
    )];
    let report = of_efforts(&found);
    let weightless = ARM.replacen("<mass value=\"2\"/>", "<mass value=\"0\"/>", 1);
    let refused = of(&report, &weightless, &[]).expect_err("refused");
    assert!(
        refused.contains("arm.urdf: its link upper has no mass"),
        "{refused}"
    );
    let written = of(&report, ARM, &[]).expect("written");
    let refused = of(&report, &written, &[]).expect_err("refused");
    assert!(
        refused.contains("it holds this report already"),
        "{refused}"
    );
    // The numbers of a load are of the axes of one link.
    let mut nowhere = of_efforts(&[load(1.5)]);
    nowhere.mount = None;
    let refused = of(&nowhere, ARM, &[]).expect_err("refused");
    assert!(
        refused.contains("does not say which link carries the load"),
        "{refused}"
    );
}
