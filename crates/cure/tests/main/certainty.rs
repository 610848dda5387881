//! What is not certain, or not the machine's, is refused by name; what is chosen says so.

use serde_json::json;

use crate::known::{constant, effect, file, parameter, report, written};

const INI: &str = "[TRAJ]\nCOORDINATES = X Y Z\nLINEAR_UNITS = inch\n[JOINT_0]\nSCALE = 1000\nMIN_LIMIT = -10\nMAX_LIMIT = 10\n";

fn ini(effects: &[serde_json::Value], members: &[&str], only: &[&str]) -> Result<String, String> {
    let current = file("mill.ini", INI);
    let owned = |names: &[&str]| {
        names
            .iter()
            .map(|&name| name.to_owned())
            .collect::<Vec<_>>()
    };
    let (members, only) = (owned(members), owned(only));
    written(&report(effects), "linuxcnc-ini", |ask| {
        ask.current = Some(&current);
        ask.members = &members;
        ask.only = &only;
    })
}

#[test]
fn what_is_not_certain_is_refused() {
    let scale = effect("axis.X.scale", &[parameter("k", 1e-4, "m/m")]);
    assert!(ini(std::slice::from_ref(&scale), &[], &[]).is_ok());
    let mut doubtful = scale.clone();
    doubtful["probability"] = json!(0.94);
    assert!(
        ini(&[doubtful.clone()], &[], &[])
            .expect_err("refused")
            .contains("its probability is 0.940")
    );
    let mut vague = scale.clone();
    vague["parameters"][0]["ci95"] = json!([4e-5, 1.6e-4]);
    assert!(
        ini(&[vague.clone()], &[], &[])
            .expect_err("refused")
            .contains("wider than the effect")
    );
    let backlash = effect("axis.X.backlash", &[parameter("b", 1e-5, "m")]);
    // Of two causes one that is refused refuses the file, unless it is left out by name.
    assert!(
        ini(&[vague.clone(), backlash.clone()], &[], &[])
            .expect_err("refused")
            .starts_with("axis.X.scale is not written")
    );
    let only = ini(&[vague, backlash], &[], &["axis.X.backlash"]).expect("written");
    assert!(
        only.contains("BACKLASH = 0.000394") && only.contains("not in this file: axis.X.scale"),
        "{only}"
    );
    assert!(
        ini(&[scale], &[], &["axis.Y.scale"])
            .expect_err("refused")
            .contains("not among the causes")
    );
}

#[test]
fn a_group_of_equals_waits_for_a_person() {
    let mut scale = effect("axis.X.scale", &[parameter("k", 1e-4, "m/m")]);
    scale["group"] = json!(["axis.X.scale", "axis.Y.scale", "fixture.shift"]);
    scale["alternatives"] =
        json!([{"effect": "axis.Y.scale", "parameters": [parameter("k", -2e-4, "m/m")]}]);
    let refused = ini(std::slice::from_ref(&scale), &[], &[]).expect_err("refused");
    assert!(
        refused.contains("cannot tell it from axis.Y.scale, fixture.shift"),
        "{refused}"
    );
    let chosen = ini(std::slice::from_ref(&scale), &["axis.X.scale"], &[]).expect("written");
    assert!(
        chosen.contains("chosen by a person from axis.X.scale, axis.Y.scale, fixture.shift"),
        "{chosen}"
    );
    assert!(chosen.contains("SCALE = 999.90001"), "{chosen}");
    // Its equal has parameters of its own, and here a joint that the INI does not have.
    let other = ini(std::slice::from_ref(&scale), &["axis.Y.scale"], &[]).expect_err("refused");
    assert!(other.contains("[JOINT_1] has none of SCALE"), "{other}");
    let part = ini(std::slice::from_ref(&scale), &["fixture.shift"], &[]).expect_err("refused");
    assert!(part.contains("holds none of the causes"), "{part}");
    assert!(
        ini(&[scale], &["axis.Z.scale"], &[])
            .expect_err("refused")
            .contains("in no group")
    );
}

#[test]
fn what_belongs_to_the_part_or_drifts_is_not_written_into_a_machine() {
    let cases = [
        (
            "fixture.shift",
            vec![parameter("x", 1e-5, "m")],
            "the part, its clamping or the process",
        ),
        (
            "process.tool_wear",
            vec![parameter("rate", 1e-5, "m/m"), constant("tool", 2.0, "1")],
            "the part, its clamping or the process",
        ),
        (
            "thermal.drift",
            vec![parameter("rate_x", 1e-9, "m/s")],
            "not frozen into a table",
        ),
        ("unknown", vec![], "outside the vocabulary"),
    ];
    for (name, parameters, why) in cases {
        let effects = [effect(name, &parameters)];
        let lines = cure::lines(&report(&effects), &[]).expect("a list");
        assert!(
            lines[0]
                .refused
                .as_deref()
                .is_some_and(|text| text.contains(why)),
            "{:?}",
            lines[0]
        );
        assert!(
            ini(&effects, &[], &[name])
                .expect_err("refused")
                .contains(why),
            "{name}"
        );
    }
}

#[test]
fn the_list_fits_a_terminal_and_tells_what_stays() {
    let mut vague = effect("axis.Y.scale", &[parameter("k", 1e-4, "m/m")]);
    vague["probability"] = json!(0.5);
    let mut scale = effect("axis.X.scale", &[parameter("k", 1e-4, "m/m")]);
    scale["rms_after"] = json!(2.4e-5);
    let report = report(&[scale, vague]);
    let lines = cure::lines(&report, &[]).expect("a list");
    assert!(lines[0].formats.contains(&"linuxcnc-ini") && lines[0].refused.is_none());
    let text = cure::table(&report, &lines);
    assert!(
        text.lines().all(|line| line.chars().count() <= 100),
        "{text}"
    );
    // 40² − (40² − 24²) µm²
    assert!(
        text.ends_with(
            "of a gap of 40.0 µm, 24.0 µm stay when all that can be written is; the noise is 1.0 µm"
        ),
        "{text}"
    );
}

#[test]
fn a_report_on_another_channel_is_refused() {
    let mut report = report(&[effect("motion.dwell", &[parameter("dwell", 1.0, "s")])]);
    "time".clone_into(&mut report.channel);
    assert!(
        cure::lines(&report, &[])
            .expect_err("refused")
            .to_string()
            .contains("on the channel time")
    );
}

/// What the cell's model declares is not in the report, though it is in the machine.
#[test]
fn what_is_declared_is_said_to_stay() {
    let scale = effect("axis.X.scale", &[parameter("k", 1e-4, "m/m")]);
    let mut report = report(&[scale]);
    let declared = json!([{"effect": "axis.Y.scale", "parameters": [parameter("k", 1e-4, "m/m")]}]);
    report.declared = serde_json::from_value(declared).expect("declared");
    let current = file("mill.ini", INI);
    let text = written(&report, "linuxcnc-ini", |ask| {
        ask.current = Some(&current);
    });
    let text = text.expect("written");
    assert!(
        text.contains("# not in this file: axis.Y.scale: declared in the model of the cell"),
        "{text}"
    );
}

/// The ends of a table are no part of its size, whatever rounding has left of their interval; nor is what rounding has left of a number.
#[test]
fn a_table_is_as_certain_as_its_errors() {
    let table = |half: f64| {
        let mut all = vec![
            json!({"name": "e1", "value": 1e-5, "unit": "m", "ci95": [1e-5 - half, 1e-5 + half]}),
        ];
        all.push(json!({"name": "from", "value": -0.2, "unit": "m", "ci95": [-0.200_000_000_000_000_1, -0.2]}));
        all.extend([
            constant("to", 0.2, "m"),
            constant("targets", 0.999_999_999_999_999, "1"),
        ]);
        report(&[effect("axis.X.positioning", &all)])
    };
    let of = |report: &diagnosis::Report| written(report, "iso230-csv", |_| ());
    assert!(
        of(&table(6e-6))
            .expect_err("refused")
            .contains("wider than the effect")
    );
    let text = of(&table(4e-6)).expect("written");
    assert!(
        text.contains("\nX,0.000000,10.000,10.000,10.000,0.000,4.000\n"),
        "{text}"
    );
}
