//! Drives: real machines whose causes are known, and a plant that shares no code with the library.

use crate::drive_plant::{Content, drive_session};
use bags::Bag;
use diagnosis::report::{Effect, Report};
use diagnosis::{Options, Session, Verdict, diagnose_together_with_residuals};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::sensor_msgs::JointState;

fn bags(names: &[&str]) -> Option<Vec<Session>> {
    let read = |name: &&str| {
        let path = shared_data::path(&format!("data/bags/{name}"))?;
        let bag = Bag::open(&path).expect("the bag opens");
        let read = bags::Session::read(&bag).expect("the bag holds a session");
        Some(Session {
            name: (*name).to_owned(),
            robot_description: read.robot_description,
            joint_states: read.joint_states.into_iter().map(|s| s.message).collect(),
            joint_commands: read.joint_commands.into_iter().map(|s| s.message).collect(),
            ..Session::default()
        })
    };
    names.iter().map(read).collect()
}

fn named(report: &Report) -> Vec<&str> {
    report
        .effects
        .iter()
        .map(|effect| effect.effect.as_str())
        .collect()
}

/// Withheld rms of an axis over the sessions that judge.
fn after(effect: &Effect, axis: &str) -> Vec<f64> {
    let of = effect
        .sessions
        .iter()
        .filter(|s| s.axis.as_deref() == Some(axis));
    of.map(|session| session.rms_after).collect()
}

#[test]
fn an_arm_with_late_links_is_explained_by_delay_as_well_as_by_an_expert() {
    let (Some(fit), Some(withheld)) = (
        bags(&["kuka_a.mcap"]),
        bags(&["kuka_b.mcap", "kuka_c.mcap"]),
    ) else {
        return;
    };
    let report = diagnose_together_with_residuals(&fit, &withheld, &Options::default())
        .expect("it can be diagnosed")
        .0;
    assert_eq!(named(&report), ["drive.delay"]);
    assert_eq!(report.gap.unit, "rad");
    let delay = &report.effects[0];
    assert!(
        delay
            .indistinguishable_from
            .contains(&"axis.A1.lag".to_owned())
    );
    assert!(
        (delay.parameters[0].value - 3.07e-3).abs() < 1e-4,
        "{:?}",
        delay.parameters
    );
    // Within 3 % of the withheld rms of a least-squares expert, µrad, rounded: bags B and C of each axis.
    for (axis, expert) in [
        ("A1", [52.0, 40.0]),
        ("A2", [97.0, 76.0]),
        ("A3", [152.0, 63.0]),
    ] {
        for (ours, theirs) in after(delay, axis).into_iter().zip(expert) {
            assert!(
                ours * 1e6 < 1.03 * theirs + 0.5,
                "{axis}: {ours} against {theirs} µrad"
            );
        }
    }
}

#[test]
fn a_mill_is_explained_by_coulomb_and_not_by_viscous_friction() {
    let fit = bags(&["umich_01.mcap", "umich_11.mcap"]);
    let withheld = bags(&["umich_02.mcap", "umich_10.mcap", "umich_12.mcap"]);
    let (Some(fit), Some(withheld)) = (fit, withheld) else {
        return;
    };
    let report = diagnose_together_with_residuals(&fit, &withheld, &Options::default())
        .expect("it can be diagnosed")
        .0;
    assert_eq!(named(&report), ["drive.coulomb_friction"]);
    // An expert's 2.54 A and 2.85 A, over both axes.
    let expert = (0.5 * (2.54_f64.powi(2) + 2.85_f64.powi(2))).sqrt();
    assert!(
        report.effects[0].rms_after < expert,
        "{}",
        report.effects[0].rms_after
    );
}

#[test]
fn drives_that_behave_have_no_gap_and_single_causes_are_named() {
    let mut right = 0;
    for seed in 0..12 {
        let (session, _) = drive_session(seed, Content::Clean);
        let report = diagnose_together_with_residuals(&[session], &[], &Options::default())
            .expect("it can be diagnosed")
            .0;
        assert_eq!(named(&report), [""; 0], "seed {seed}");
        let (session, truth) = drive_session(seed, Content::Effort(1));
        let report = diagnose_together_with_residuals(&[session], &[], &Options::default())
            .expect("it can be diagnosed")
            .0;
        let stands = |effect: &Effect| {
            let hidden = &truth.effects[0];
            effect.effect == *hidden || effect.indistinguishable_from.contains(hidden)
        };
        right += usize::from(report.effects.len() == 1 && stands(&report.effects[0]));
    }
    assert_eq!(right, 10, "single causes named alone, of 12");
}

/// A slide of 95 kg that moves to and fro, sampled at 1 kHz with positions only, 20 N Coulomb, 200 N s/m viscous, −3 N.
fn slide() -> Session {
    let mut session = Session {
        name: "slide".to_owned(),
        robot_description: "<robot name=\"slide\"><link name=\"foundation\"/><link name=\"workpiece\"/>\
            <link name=\"probe_mount\"><inertial><mass value=\"95\"/>\
            <inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\
            <joint name=\"part\" type=\"fixed\"><parent link=\"foundation\"/><child link=\"workpiece\"/></joint>\
            <joint name=\"X\" type=\"prismatic\"><parent link=\"foundation\"/><child link=\"probe_mount\"/>\
            <axis xyz=\"1 0 0\"/><limit lower=\"-1\" upper=\"1\" effort=\"0\" velocity=\"1\"/></joint></robot>"
            .to_owned(),
        ..Session::default()
    };
    for sample in 0..24_800_u32 {
        let t = f64::from(sample) * 1e-3;
        // Two incommensurate waves: every speed at every place.
        let (w1, w2) = (1.3, 3.7);
        let q = 0.08 * (w1 * t).sin() + 0.02 * (w2 * t).sin();
        let v = 0.08 * w1 * (w1 * t).cos() + 0.02 * w2 * (w2 * t).cos();
        let a = -0.08 * w1 * w1 * (w1 * t).sin() - 0.02 * w2 * w2 * (w2 * t).sin();
        let noise = 2.0 * ((f64::from(sample) * 12.9898).sin() * 43_758.547).fract();
        let mut state = JointState::default();
        let stamp = t + 10.0;
        state.header.stamp = Time {
            sec: stamp as i32,
            nanosec: (stamp.fract() * 1e9) as u32,
        };
        state.name = vec!["X".to_owned()];
        state.position = vec![(q / 2e-6).round() * 2e-6];
        state.effort = vec![95.0 * a + 20.0 * (v / 1e-3).tanh() + 200.0 * v - 3.0 + noise];
        session.joint_states.push(state);
    }
    session
}

#[test]
fn a_fast_record_without_speeds_gives_friction_of_three_kinds() {
    let report = diagnose_together_with_residuals(&[slide()], &[], &Options::default())
        .expect("it can be diagnosed")
        .0;
    let mut found = named(&report);
    found.sort_unstable();
    let expected = [
        "drive.coulomb_friction",
        "drive.friction_offset",
        "drive.viscous_friction",
    ];
    assert_eq!(found, expected);
    assert_eq!(report.verdict, Verdict::Explained);
    assert_eq!(report.gap.unit, "N");
    for (effect, size) in expected.into_iter().zip([20.0, -3.0, 200.0]) {
        let own = report
            .effects
            .iter()
            .find(|e| e.effect == effect)
            .expect("it is named");
        let value = own.parameters[0].value;
        assert!(
            (value - size).abs() < 0.05 * f64::abs(size),
            "{effect}: {value}"
        );
    }
}
