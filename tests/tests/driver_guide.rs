//! docs/driver-guide.md says of every message of a driver what the interface package says: fields, types, hashes.

use std::{fs, path::Path};

use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, GateHeartbeat, InspectionPlan,
    MeasurementOrder, Message, MessageType, ProbeTrigger,
};

/// Messages of the topics.
const TOPICS: [&MessageType; 7] = [
    ControllerStatus::TYPE,
    ProbeTrigger::TYPE,
    ControllerReply::TYPE,
    ControllerCommand::TYPE,
    GateHeartbeat::TYPE,
    MeasurementOrder::TYPE,
    InspectionPlan::TYPE,
];

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn read(file: &str) -> String {
    fs::read_to_string(root().join(file)).expect(file)
}

/// Type and name of each field of an interface file.
fn fields(text: &str) -> Vec<(String, String)> {
    let lines = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or("").trim());
    lines
        .filter(|line| !line.is_empty() && !line.contains('='))
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            Some((words.next()?.to_owned(), words.next()?.to_owned()))
        })
        .collect()
}

fn of_package(name: &str) -> Vec<(String, String)> {
    let (package, short) = name.split_once('/').expect("package and type");
    fields(&match package {
        "probecell_msgs" => read(&format!("msgs/msg/{short}.msg")),
        _ => read(&format!("msgs/standard/{package}/msg/{short}.msg")),
    })
}

/// Text between two marks.
fn between<'a>(text: &'a str, begin: &str, end: &str) -> &'a str {
    let after = text.split_once(begin).expect(begin).1;
    after.split_once(end).expect(end).0
}

#[test]
fn the_definitions_of_the_guide_are_those_of_the_package() {
    let guide = read("docs/driver-guide.md");
    let text = between(
        &guide,
        "```text\nMSG: probecell_msgs/ControllerStatus",
        "```",
    );
    let text = format!("probecell_msgs/ControllerStatus{text}");
    let mut seen = Vec::new();
    for definition in text.split("MSG: ") {
        let (name, body) = definition.split_once('\n').expect("a name");
        assert_eq!(fields(body), of_package(name), "{name}");
        seen.push(name.to_owned());
    }
    // What a definition uses stands there, too.
    for name in &seen {
        for (kind, _) in of_package(name) {
            let kind = kind.split(['[', '<']).next().expect("a type").to_owned();
            if !kind.chars().any(char::is_uppercase) {
                continue;
            }
            let own = name.split('/').next().expect("a package");
            let whole = if kind.contains('/') {
                kind
            } else {
                format!("{own}/{kind}")
            };
            assert!(
                seen.contains(&whole),
                "{whole}, of {name}, is not in the guide"
            );
        }
    }
}

#[test]
fn the_hashes_of_the_guide_are_those_of_the_package() {
    let guide = read("docs/driver-guide.md");
    let table = between(&guide, "## Definitions", "```text");
    for message in TOPICS {
        let short = message.name.rsplit('/').next().expect("a name");
        let row = format!("| `{short}` | `{}` |", message.type_hash);
        assert!(table.contains(&row), "{row}");
    }
}

#[test]
fn the_guide_explains_every_field() {
    let guide = read("docs/driver-guide.md");
    let tables = between(&guide, "## Fields", "## Zenoh");
    let mut explained = 0;
    for section in tables.split("\n### ").skip(1) {
        let name = section.split_whitespace().next().expect("a heading");
        let rows: Vec<(String, String)> = section
            .lines()
            .filter(|line| line.starts_with("| `"))
            .map(|line| {
                let cells: Vec<&str> = line.split('|').map(str::trim).collect();
                assert!(!cells[3].is_empty(), "{line}");
                let plain = |cell: &str| cell.trim_matches('`').to_owned();
                (plain(cells[2]), plain(cells[1]))
            })
            .collect();
        assert_eq!(
            rows,
            of_package(&format!("probecell_msgs/{name}")),
            "{name}"
        );
        explained += 1;
    }
    assert_eq!(explained, 12);
}

#[test]
fn the_guide_holds_the_wire_format_that_the_template_uses() {
    let guide = read("docs/driver-guide.md");
    let code = between(&guide, "## The wire format in Python", "\n```\n");
    let code = code.split_once("```python\n").expect("a block").1;
    assert_eq!(format!("{code}\n"), read("templates/rmw_zenoh.py"));
}

#[test]
fn templates_are_short() {
    let rust = "crates/host/examples/driver_template";
    for file in [
        "templates/driver.py".to_owned(),
        "templates/rmw_zenoh.py".to_owned(),
        format!("{rust}/main.rs"),
        format!("{rust}/machine.rs"),
        format!("{rust}/messages.rs"),
    ] {
        let lines = read(&file).lines().count();
        assert!(lines <= 150, "{file} has {lines} lines");
    }
}
