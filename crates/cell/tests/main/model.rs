//! The declared model of a cell file: what goes in comes out, nothing else changes, and what must not go in does not.

use std::path::Path;

use cell::{AdoptError, Cell, CellText, ModelSection, adopt, remove};
use diagnosis::{DeclaredError, Report, report::Machine};
use serde_json::{Value, json};

fn read(file: &str) -> Cell {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch-scripts"));
    Cell::read(&folder.join(file)).unwrap_or_else(|error| panic!("{error}"))
}

fn with(cell: &Cell, text: String) -> Cell {
    let text = CellText {
        cell: text,
        ..cell.text().clone()
    };
    Cell::from_text(text).unwrap_or_else(|error| panic!("{error}"))
}

fn effect(name: &str, parameters: &Value, equals: &[&str]) -> Value {
    json!({
        "effect": name, "probability": 0.999, "parameters": parameters, "rms_before": 1.2e-5, "rms_after": 1.1e-6,
        "ci95_after": [9e-7, 1.3e-6], "held_out": true, "indistinguishable_from": equals,
    })
}

fn parameter(name: &str, value: f64, unit: &str) -> Value {
    json!([{ "name": name, "value": value, "unit": unit, "ci95": [0.9 * value, 1.1 * value] }])
}

/// A report on the cell's machine.
fn report(cell: &Cell, effects: &Value) -> Report {
    let machine = Machine::of(
        &cell.text().robot_description,
        cell.chain()
            .unwrap_or_else(|error| panic!("{error}"))
            .name(),
    );
    let report = json!({
        "schema": "probecell/gap-report/1", "bag": "session_7", "measured": "2026-01-01T00:00:12Z",
        "machine": machine, "samples": 48, "verdict": "explained",
        "gap": { "rms": 1.2e-5, "noise_floor": 1e-6, "ratio": 12.0 }, "where": [], "effects": effects,
        "unexplained": { "rms": 0.0, "where": [] }, "rejected": [], "next_measurement": [], "warnings": [],
    });
    serde_json::from_value(report).unwrap_or_else(|error| panic!("{error}"))
}

fn scale(cell: &Cell, k: f64) -> Report {
    report(
        cell,
        &json!([effect("axis.Z.scale", &parameter("k", k, "m/m"), &[])]),
    )
}

fn refusal(cell: &Cell, report: &Report, picks: &[&str]) -> AdoptError {
    let picks: Vec<String> = picks.iter().map(|pick| (*pick).to_owned()).collect();
    match adopt(cell, report, &picks, false) {
        Ok(adopted) => panic!("adopted {:?}", adopted.effects),
        Err(error) => error,
    }
}

#[test]
fn a_cell_file_comes_back_to_the_byte_when_the_effect_is_removed() {
    for file in ["guideway.toml", "turn_mill.toml", "five_axis.toml"] {
        for end in [
            "",
            "\n# the end of the file\n",
            "\n\n[gap]\nat_end_of_plan = true   # as it is\n",
        ] {
            let original = read(file);
            let cell = with(&original, format!("{}{end}", original.text().cell));
            let adopted = adopt(&cell, &scale(&cell, 2.1e-5), &[], false)
                .unwrap_or_else(|error| panic!("{error}"));
            for line in cell.text().cell.lines() {
                assert!(adopted.text.contains(line), "{file}: {line} is lost");
            }
            let larger = with(&cell, adopted.text.clone());
            assert_eq!(larger.model.effects, adopted.effects);
            let parameter = &larger.model.effects[0].parameters[0];
            assert_eq!((parameter.value, parameter.unit.as_str()), (2.1e-5, "m/m"));
            assert_eq!(larger.model.effects[0].source.as_deref(), Some("session_7"));
            let alone = ModelSection::of_text(&adopted.text).expect("the section alone");
            assert_eq!(alone.effects, adopted.effects);
            let (text, removed) = remove(&larger, "axis.Z.scale").expect("it is declared");
            assert_eq!(
                (text.as_str(), removed),
                (cell.text().cell.as_str(), 1),
                "{file}"
            );
        }
    }
}

#[test]
fn several_effects_keep_their_order_and_one_of_them_leaves_alone() {
    let cell = read("guideway.toml");
    let found = report(
        &cell,
        &json!([
            effect("axis.Z.scale", &parameter("k", 1e-5, "m/m"), &[]),
            effect("probe.ball_radius", &parameter("dr", 3e-6, "m"), &[]),
            effect("process.slip", &parameter("step", 3e-6, "m"), &[]),
        ]),
    );
    let adopted = adopt(&cell, &found, &[], false).unwrap_or_else(|error| panic!("{error}"));
    let names: Vec<&str> = adopted
        .effects
        .iter()
        .map(|one| one.effect.as_str())
        .collect();
    assert_eq!(names, ["axis.Z.scale", "probe.ball_radius"]);
    assert!(matches!(
        adopted.left_out[..],
        [DeclaredError::NotOfTheModel { .. }]
    ));
    let larger = with(&cell, adopted.text);
    let (text, _) = remove(&larger, "axis.Z.scale").expect("it is declared");
    let smaller = with(&cell, text);
    assert_eq!(smaller.model.effects, adopted.effects[1..]);
    assert!(matches!(
        remove(&smaller, "axis.Z.scale"),
        Err(AdoptError::NotDeclared { .. })
    ));
}

#[test]
fn one_of_several_that_look_alike_is_picked_by_a_person_and_recorded_so() {
    let cell = read("guideway.toml");
    let mut one = effect(
        "probe.ball_radius",
        &parameter("dr", 3e-6, "m"),
        &["probe.trigger_latency", "axis.X.lag"],
    );
    one["alternatives"] =
        json!([{ "effect": "probe.trigger_latency", "parameters": parameter("tau", -1e-4, "s") }]);
    let found = report(&cell, &json!([one]));
    assert!(matches!(
        refusal(&cell, &found, &[]),
        AdoptError::Indistinguishable { .. }
    ));
    // The report knows no parameters of the last of them.
    for pick in ["axis.X.lag", "axis.Z.scale"] {
        assert!(
            matches!(
                refusal(&cell, &found, &[pick]),
                AdoptError::NoSuchPick { .. }
            ),
            "{pick}"
        );
    }
    let both = ["probe.ball_radius", "probe.trigger_latency"];
    assert!(matches!(
        refusal(&cell, &found, &both),
        AdoptError::TwoPicks(..)
    ));
    for pick in both {
        let adopted = adopt(&cell, &found, &[pick.to_owned()], false)
            .unwrap_or_else(|error| panic!("{error}"));
        let declared = &with(&cell, adopted.text).model.effects[0];
        assert_eq!(declared.effect, pick);
        assert_eq!(
            declared.chosen_from,
            ["probe.ball_radius", "probe.trigger_latency", "axis.X.lag"]
        );
    }
}

#[test]
fn what_does_not_belong_to_the_model_stays_out() {
    let cell = read("guideway.toml");
    let good = scale(&cell, 2.1e-5);
    for (verdict, says) in [
        ("unexplained", "does not explain its gap"),
        ("no_gap", "has no gap"),
    ] {
        let mut value = serde_json::to_value(&good).expect("JSON");
        value["verdict"] = json!(verdict);
        let found: Report = serde_json::from_value(value).expect("a report");
        let told = refusal(&cell, &found, &[]).to_string();
        assert!(told.contains(says), "{told}");
    }
    let elsewhere = read("five_axis.toml");
    assert!(matches!(
        refusal(&elsewhere, &good, &[]),
        AdoptError::OtherMachine { .. }
    ));
    let mut nameless = good.clone();
    nameless.machine = None;
    assert!(matches!(
        refusal(&cell, &nameless, &[]),
        AdoptError::NoMachine(_)
    ));
    for (name, parameters, says) in [
        ("axis.Q.scale", parameter("k", 1e-5, "m/m"), "did you mean"),
        (
            "probe.elasticity",
            parameter("k", 1e-5, "m/m"),
            "did you mean",
        ),
        ("axis.Z.scale", parameter("k", 1e-5, "m"), "not in `m/m`"),
        ("axis.Z.scale", parameter("kk", 1e-5, "m/m"), "expected (k)"),
        (
            "axis.Z.cyclic",
            parameter("a", 1e-5, "m"),
            "expected (a, phase, period)",
        ),
        (
            "data.outliers",
            parameter("index", 3.0, "1"),
            "cannot be declared",
        ),
        (
            "drive.inertia",
            parameter("X.m", 3.0, "kg"),
            "cannot be declared",
        ),
    ] {
        let told = refusal(
            &cell,
            &report(&cell, &json!([effect(name, &parameters, &[])])),
            &[],
        )
        .to_string();
        assert!(told.contains(says), "{name}: {told}");
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let mut found = good.clone();
        found.effects[0].parameters[0].value = bad;
        let told = refusal(&cell, &found, &[]).to_string();
        assert!(told.contains("not finite"), "{told}");
    }
}

#[test]
fn an_effect_is_declared_once_unless_it_is_to_be_combined() {
    let cell = read("guideway.toml");
    let adopted =
        adopt(&cell, &scale(&cell, 2.1e-5), &[], false).unwrap_or_else(|error| panic!("{error}"));
    let larger = with(&cell, adopted.text);
    let again = scale(&larger, 1e-6);
    assert!(matches!(
        refusal(&larger, &again, &[]),
        AdoptError::Already(_)
    ));
    // A report that knew nothing of the declared effect found all of it, not a rest.
    assert!(matches!(
        adopt(&larger, &again, &[], true),
        Err(AdoptError::OtherModel { .. })
    ));
    let mut value = serde_json::to_value(&again).expect("JSON");
    value["declared"] =
        json!([{ "effect": "axis.Z.scale", "parameters": parameter("k", 2.1e-5, "m/m") }]);
    let rest: Report = serde_json::from_value(value).expect("a report");
    let combined = adopt(&larger, &rest, &[], true).unwrap_or_else(|error| panic!("{error}"));
    let (text, removed) =
        remove(&with(&cell, combined.text), "axis.Z.scale").expect("it is declared");
    assert_eq!((text.as_str(), removed), (cell.text().cell.as_str(), 2));
}

#[test]
fn a_cell_file_with_an_impossible_effect_is_refused_with_the_reason() {
    let cell = read("guideway.toml");
    for (table, says) in [
        (
            "effect = \"axis.Z.scales\"\nparameters = []",
            "did you mean `axis.Z.scale`",
        ),
        ("effect = \"axis.Z.scale\"\nparameters = []", "expected (k)"),
        (
            "effect = \"axis.Z.scale\"\nparameters = [{ name = \"k\", value = nan, unit = \"m/m\" }]",
            "not a finite number",
        ),
        ("effect = \"axis.Z.scale\"\nfactor = 2", "unknown key"),
    ] {
        let text = format!("{}\n[[model.effects]]\n{table}\n", cell.text().cell);
        let told = Cell::from_text(CellText {
            cell: text,
            ..cell.text().clone()
        });
        let told = told
            .err()
            .map(|error| error.to_string())
            .unwrap_or_default();
        assert!(told.contains(says), "{table}: {told}");
    }
}
