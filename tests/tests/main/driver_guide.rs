//! The driver guide, docs/driver-guide.md and docs/driver/, says of every message what the interface package says: fields, types, hashes.

use std::fs;

use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, GateHeartbeat, InspectionPlan,
    MeasurementOrder, Message, MessageType, ProbeTrigger,
};

use crate::support::root;

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

/// Type and name of each field of a message, in order.
type Fields = Vec<(String, String)>;

/// Pages that list fields.
const PAGES: [&str; 2] = ["docs/driver/messages.md", "docs/driver/order-and-plan.md"];

fn read(file: &str) -> String {
    fs::read_to_string(root().join(file)).expect(file)
}

/// Type and name of each field of an interface file.
fn fields(text: &str) -> Fields {
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

fn of_package(name: &str) -> Fields {
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

/// Type and name of each field, of each message that the guide explains.
fn explained() -> Vec<(String, Fields)> {
    let mut found = Vec::new();
    for page in PAGES {
        for section in read(page).split("\n## ").skip(1) {
            if !section.contains("| field | type | meaning |") {
                continue;
            }
            let name = section.split_whitespace().next().expect("a heading");
            let rows = section.lines().filter(|line| line.starts_with("| `"));
            let rows = rows.map(|line| {
                let cells: Vec<&str> = line.split('|').map(str::trim).collect();
                assert!(!cells[3].is_empty(), "{line}");
                let plain = |cell: &str| cell.trim_matches('`').to_owned();
                (plain(cells[2]), plain(cells[1]))
            });
            found.push((format!("probecell_msgs/{name}"), rows.collect()));
        }
    }
    found
}

/// Type and name of each field, of each type of ROS 2 that the guide repeats.
fn standard_types() -> Vec<(String, Fields)> {
    let page = read("docs/driver/order-and-plan.md");
    let table = between(&page, "## Standard types", "## Definitions");
    let rows = table.lines().filter(|line| line.starts_with("| `"));
    rows.map(|line| {
        let mut quoted = line.split('`').skip(1).step_by(2);
        let name = quoted.next().expect("a type").to_owned();
        let text: Vec<&str> = quoted.collect();
        (name, fields(&text.join("\n")))
    })
    .collect()
}

#[test]
fn the_guide_explains_every_field() {
    let explained = explained();
    assert_eq!(explained.len(), 12);
    for (name, rows) in explained.into_iter().chain(standard_types()) {
        assert_eq!(rows, of_package(&name), "{name}");
    }
}

#[test]
fn what_a_message_of_the_guide_uses_stands_there() {
    let all: Vec<_> = explained().into_iter().chain(standard_types()).collect();
    for (name, rows) in &all {
        for (kind, _) in rows {
            let kind = kind.split(['[', '<']).next().expect("a type");
            if !kind.chars().any(char::is_uppercase) {
                continue;
            }
            let own = name.split('/').next().expect("a package");
            let whole = if kind.contains('/') {
                kind.to_owned()
            } else {
                format!("{own}/{kind}")
            };
            assert!(
                all.iter().any(|(other, _)| *other == whole),
                "{whole}, of {name}, is not in the guide"
            );
        }
    }
}

#[test]
fn the_hashes_of_the_guide_are_those_of_the_package() {
    let page = read("docs/driver/messages.md");
    let table = between(&page, "## Type hashes", "\n## ");
    for message in TOPICS {
        let short = message.name.rsplit('/').next().expect("a name");
        let row = format!("| `{short}` | `{}` |", message.type_hash);
        assert!(table.contains(&row), "{row}");
    }
}

#[test]
fn the_guide_holds_the_wire_format_that_the_template_uses() {
    let page = read("docs/driver/zenoh.md");
    let code = between(&page, "## The wire format in Python", "\n```\n");
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
