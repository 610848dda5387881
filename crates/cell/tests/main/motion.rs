//! What a report of the channel `time` writes into `[motion]`, and what the cell then promises.
#![allow(clippy::unwrap_used, reason = "a test stops at what should not happen")]

use std::path::Path;

use cell::{AdoptError, Cell, CellText, adopt_motion, motion_of_text};
use diagnosis::Report;
use diagnosis::report::Machine;

fn cell() -> Cell {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch-scripts"));
    Cell::read(&folder.join("linuxcnc_box.toml")).unwrap()
}

fn estimate(name: &str, value: f64, unit: &str, half: f64) -> serde_json::Value {
    serde_json::json!({ "name": name, "value": value, "unit": unit, "ci95": [value - half, value + half] })
}

/// A report that names these effects, as JSON of `probecell diagnose --channel time --json`.
fn report(cell: &Cell, effects: &serde_json::Value) -> Report {
    let chain = cell.chain().unwrap();
    let machine = Machine::of(&cell.text().robot_description, chain.name());
    serde_json::from_value(serde_json::json!({
        "schema": "probecell/gap-report/1", "bag": "before", "samples": 40, "verdict": "explained", "channel": "time",
        "machine": machine, "gap": { "unit": "s", "rms": 0.2, "noise_floor": 0.002, "ratio": 100.0 }, "where": [],
        "effects": effects, "unexplained": { "rms": 0.0, "where": [] }, "rejected": [], "next_measurement": [],
        "warnings": []
    }))
    .unwrap()
}

fn effect(name: &str, group: &[&str], parameters: &[serde_json::Value]) -> serde_json::Value {
    let others: Vec<&str> = group
        .iter()
        .copied()
        .filter(|other| *other != name)
        .collect();
    let alternatives: Vec<serde_json::Value> = (others.iter())
        .map(|other| serde_json::json!({ "effect": other, "parameters": [estimate("latency", 0.02, "s", 0.001)] }))
        .collect();
    serde_json::json!({
        "effect": name, "probability": 1.0, "parameters": parameters, "rms_before": 0.2, "rms_after": 0.01,
        "ci95_after": [0.009, 0.011], "held_out": true, "indistinguishable_from": others, "group": group,
        "alternatives": alternatives
    })
}

#[test]
fn limits_are_declared_in_the_units_of_their_keys() {
    let cell = cell();
    let found = serde_json::json!([
        effect(
            "motion.X.acceleration",
            &["motion.X.acceleration"],
            &[
                estimate("acceleration", 0.801_234, "m/s²", 0.0123),
                estimate("declared", 1.5, "m/s²", 0.0)
            ]
        ),
        effect(
            "motion.dwell",
            &["motion.dwell"],
            &[estimate("dwell", 0.1234, "s", 0.0051)]
        ),
        effect(
            "motion.override",
            &["motion.override"],
            &[
                estimate("speed", 0.8, "1", 0.01),
                estimate("declared", 1.0, "1", 0.0)
            ]
        ),
    ]);
    let adopted = adopt_motion(&cell, &report(&cell, &found), &[]).unwrap();
    let after = Cell::from_text(CellText {
        cell: adopted.text.clone(),
        ..cell.text().clone()
    })
    .unwrap();
    let (before, motion) = (cell.chain().unwrap(), after.chain().unwrap());
    let motion = motion.motion();
    let x = before.axis_index("X").unwrap();
    // 801.234 ± 12.3 mm/s² has its second digit of uncertainty in the ones.
    assert!((motion.axes()[x].acceleration.unwrap() - 0.801).abs() < 1e-12);
    assert_eq!(
        motion.axes()[x].velocity,
        before.motion().axes()[x].velocity
    );
    assert!((motion.program.touch_dwell - 0.1234).abs() < 1e-12);
    assert!((motion.program.rapid_override - 0.8).abs() < 1e-12);
    assert!((motion.program.feed_override - 0.8).abs() < 1e-12);
    assert!(
        adopted
            .text
            .starts_with(cell.text().cell.lines().next().unwrap()),
        "layout stays"
    );
    assert_eq!(
        motion_of_text(&adopted.text).unwrap().axes["X"].acceleration_mm_per_s2,
        Some(801.0)
    );
    // The same move now takes longer, so that another order may be the shortest.
    let here = vec![0.0; motion.axes().len()];
    let mut there = here.clone();
    there[x] = 0.1;
    assert!(motion.time(&here, &there) > before.motion().time(&here, &there));
}

#[test]
fn of_a_group_one_is_picked() {
    let cell = cell();
    let group = ["motion.dwell", "motion.latency"];
    let found = serde_json::json!([effect(
        "motion.dwell",
        &group,
        &[estimate("dwell", 0.1, "s", 0.01)]
    )]);
    let report = report(&cell, &found);
    let refused = adopt_motion(&cell, &report, &[]).unwrap_err();
    assert!(
        matches!(refused, AdoptError::Indistinguishable { .. }),
        "{refused}"
    );
    let adopted = adopt_motion(&cell, &report, &["motion.latency".to_owned()]).unwrap();
    assert_eq!(adopted.written, [("latency_s".to_owned(), 0.02)]);
    let refused = adopt_motion(&cell, &report, &["motion.blending".to_owned()]).unwrap_err();
    assert!(
        matches!(refused, AdoptError::NoSuchPick { .. }),
        "{refused}"
    );
}
