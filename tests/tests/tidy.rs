//! What documents claim and nobody would notice to be false.

use std::{collections::BTreeSet, fs, path::Path};

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Folders of the workspace that hold a crate, by what the root manifest lists.
fn members() -> BTreeSet<String> {
    let mut members: BTreeSet<String> = ["msgs", "bags", "tests", "xtask"]
        .map(str::to_owned)
        .into_iter()
        .collect();
    for group in ["crates", "nodes"] {
        for entry in fs::read_dir(root().join(group)).expect("a folder of crates") {
            let path = entry.expect("an entry").path();
            if path.join("Cargo.toml").exists() {
                let name = path
                    .file_name()
                    .expect("a name")
                    .to_string_lossy()
                    .into_owned();
                members.insert(format!("{group}/{name}"));
            }
        }
    }
    members
}

#[test]
fn the_code_map_and_the_workspace_name_the_same_crates() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let map = text.split("## Code map").nth(1).expect("a code map");
    let map = map.split("\n## ").next().expect("its section");
    let rows: BTreeSet<String> = map
        .lines()
        .filter_map(|line| {
            line.strip_prefix("| `")?
                .split('`')
                .next()
                .map(str::to_owned)
        })
        .collect();
    let crates: BTreeSet<String> = rows
        .iter()
        .filter(|row| *row != "launch-scripts")
        .cloned()
        .collect();
    assert_eq!(crates, members());
    for row in &rows {
        assert!(
            root().join(row).is_dir(),
            "{row} is in the code map, but not in the tree"
        );
    }
}

#[test]
fn architecture_stays_within_three_hundred_lines() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    assert!(text.lines().count() <= 300);
}

#[test]
fn every_topic_has_a_producer_that_exists_and_says_it() {
    let cell = cell_tests::cell("turn_mill.toml", str::to_owned);
    let nodes = cell.nodes(false).expect("nodes");
    let outside = ["driver", "operator", "instrument", "recorder"];
    for topic in graph::topics::ALL {
        let speakers: Vec<&str> = nodes
            .iter()
            .filter(|node| {
                node.outputs()
                    .iter()
                    .any(|output| output.name == topic.name)
            })
            .map(|node| node.name())
            .collect();
        if outside.contains(&topic.producer) {
            assert!(
                speakers.iter().all(|speaker| *speaker == "simulator"),
                "{}: {speakers:?}",
                topic.name
            );
        } else {
            assert_eq!(speakers, [topic.producer], "{}", topic.name);
        }
    }
}

#[test]
fn cell_files_give_every_length_angle_and_time_its_unit() {
    let bare = [
        "length",
        "width",
        "height",
        "radius",
        "diameter",
        "distance",
        "angle",
        "feed",
        "duration",
        "tolerance",
    ];
    for entry in fs::read_dir(cell_tests::launch_scripts()).expect("launch-scripts") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let text = fs::read_to_string(&path).expect("a cell file");
        for line in text.lines() {
            let key = line.split('=').next().unwrap_or_default().trim();
            assert!(
                !bare.contains(&key),
                "{}: {key} has no unit",
                path.display()
            );
        }
    }
}
