//! What documents claim and nobody would notice to be false.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use crate::support::root;

/// Folders of the workspace that hold a crate, by what the root manifest lists.
fn members() -> BTreeSet<String> {
    let mut members: BTreeSet<String> = ["msgs", "bags", "tests", "xtask"]
        .map(str::to_owned)
        .into_iter()
        .collect();
    for group in ["crates", "dev", "neighbours", "nodes"] {
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
        .filter(|row| !["launch-scripts", "templates"].contains(&row.as_str()))
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

/// Files under `folder` that a person writes: no build products, no history.
fn written_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if path.is_dir() {
            if name != "target" && name != ".git" {
                written_files(&path, files);
            }
        } else if ["rs", "md", "toml", "py", "sh"]
            .iter()
            .any(|extension| path.extension().is_some_and(|found| found == *extension))
        {
            files.push(path);
        }
    }
}

/// Sections that a citation names, given the text behind the document's name: `A.4`, `D.3 and D.4`, `B to E`.
fn cited_sections(text: &str) -> Vec<String> {
    let end = text
        .find(['`', ')', ']', ';', ':', '|'])
        .unwrap_or(text.len());
    text[..end]
        .split([' ', ',', '–'])
        .map(|word| word.trim_end_matches('.'))
        .filter(|word| {
            let (letter, number) = word.split_once('.').unwrap_or((word, "0"));
            letter.len() == 1
                && letter.chars().all(|letter| letter.is_ascii_uppercase())
                && number.chars().all(|digit| digit.is_ascii_digit())
        })
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_citation_of_the_source_systems_names_a_section_that_exists() {
    let document = pages("docs/source_systems");
    let headings: BTreeSet<&str> = document
        .lines()
        .filter_map(|line| line.strip_prefix("# ").or(line.strip_prefix("## ")))
        .filter_map(|heading| heading.split(' ').next())
        .map(|number| number.trim_end_matches('.'))
        .collect();
    let mut files = Vec::new();
    written_files(root(), &mut files);
    files.retain(|path| !path.ends_with("tests/tests/main/tidy.rs"));
    let mut citations = 0;
    for path in files {
        let text = fs::read_to_string(&path).expect("a text file");
        for (number, line) in text.lines().enumerate() {
            let at = format!("{}:{}", path.display(), number + 1);
            for (start, mark) in line.match_indices("docs/source_systems.md, ") {
                let sections = cited_sections(&line[start + mark.len()..]);
                assert!(!sections.is_empty(), "{at}: a citation without a section");
                for section in &sections {
                    assert!(
                        headings.contains(section.as_str()),
                        "{at}: no section {section}"
                    );
                }
                citations += sections.len();
            }
        }
    }
    assert!(citations > 60, "{citations} citations are left");
}

#[test]
fn a_citation_names_one_section_or_several() {
    for (text, expected) in [
        ("A.4`): and so on", vec!["A.4"]),
        ("D.3 and D.4`, and", vec!["D.3", "D.4"]),
        ("B to E`, whole", vec!["B", "E"]),
        ("C.3, C.4`)", vec!["C.3", "C.4"]),
        ("B.1–B.4`.", vec!["B.1", "B.4"]),
        ("D. The controller", vec!["D"]),
    ] {
        assert_eq!(cited_sections(text), expected, "{text}");
    }
}

#[test]
fn every_topic_has_a_producer_that_exists_and_says_it() {
    let cell = cell_tests::cell("turn_mill.toml", str::to_owned);
    let nodes = cell.nodes(false).expect("nodes");
    let outside = ["driver", "signals", "operator", "instrument", "recorder"];
    for topic in graph::topics::ALL {
        let producers: Vec<&str> = nodes
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
                producers.iter().all(|producer| *producer == "simulator"),
                "{}: {producers:?}",
                topic.name
            );
        } else {
            assert_eq!(producers, [topic.producer], "{}", topic.name);
        }
    }
}

/// The words in backquotes of a cell of a table.
fn quoted(cell: &str) -> BTreeSet<String> {
    let words = cell.split('`').skip(1).step_by(2);
    words.map(str::to_owned).collect()
}

/// The first table of a crate page: topics subscribed to, topics published, and the faults by their topic.
fn page_of(node: &str) -> (BTreeSet<String>, BTreeSet<String>, BTreeSet<String>) {
    let path = root().join("nodes").join(node).join("src/lib.rs");
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{node}: {error}"));
    let rows = text.lines().filter_map(|line| line.strip_prefix("//! | "));
    let (mut subscribed, mut published, mut codes) =
        (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    for row in rows {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        subscribed.extend(quoted(cells[0]));
        let right = cells.get(1).copied().unwrap_or_default();
        let (topics, faults) =
            right
                .split_once("/faults`:")
                .map_or((right, ""), |(name, codes)| {
                    published.insert(format!("{}/faults", name.trim_start_matches('`')));
                    ("", codes)
                });
        published.extend(quoted(topics));
        codes.extend(quoted(faults));
    }
    (subscribed, published, codes)
}

#[test]
fn the_page_of_every_node_lists_its_topics_and_its_faults() {
    let cell = cell_tests::cell("turn_mill.toml", str::to_owned);
    for node in cell.nodes(false).expect("nodes") {
        let names = |topics: &[graph::Topic]| -> BTreeSet<String> {
            topics.iter().map(|topic| topic.name.to_owned()).collect()
        };
        let codes = node.fault_codes().into_iter().map(str::to_owned).collect();
        let (subscribed, published, faults) = page_of(node.name());
        assert_eq!(
            subscribed,
            names(node.inputs()),
            "{} subscribes to",
            node.name()
        );
        assert_eq!(
            published,
            names(node.outputs()),
            "{} publishes",
            node.name()
        );
        assert_eq!(faults, codes, "faults of {}", node.name());
    }
}

/// Keys of a table whose value holds a number, tables in tables included.
fn numeric_keys(table: &toml::Table, into: &mut Vec<String>) {
    fn holds_number(value: &toml::Value) -> bool {
        match value {
            toml::Value::Integer(_) | toml::Value::Float(_) => true,
            toml::Value::Array(values) => values.iter().any(holds_number),
            _ => false,
        }
    }
    fn tables<'a>(value: &'a toml::Value, found: &mut Vec<&'a toml::Table>) {
        match value {
            toml::Value::Table(table) => found.push(table),
            toml::Value::Array(values) => values.iter().for_each(|value| tables(value, found)),
            _ => {}
        }
    }
    for (key, value) in table {
        if holds_number(value) {
            into.push(key.clone());
        }
        let mut nested = Vec::new();
        tables(value, &mut nested);
        for table in nested {
            numeric_keys(table, into);
        }
    }
}

#[test]
fn cell_files_give_every_number_its_unit() {
    let units = [
        "_mm", "_um", "_deg", "_urad", "_s", "_rpm", "_min", "_s2", "_s3", "_c", "_n", "_per_m",
        "_per_nm",
    ];
    // Counts, numbers that identify, directions, ratios.
    let without_dimension = [
        "axis",
        "clamping_axis",
        "coverage_factor",
        "facing",
        "joint",
        "max_corrections",
        "number",
        "postures",
        "seed",
        "spring_back",
        "stem_directions",
        "stem_turns",
        "teeth",
        "tool_axis",
        "tool_direction",
        "tool_number",
        "touches",
    ];
    let mut seen = BTreeSet::new();
    for entry in fs::read_dir(cell_tests::launch_scripts()).expect("launch-scripts") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let text = fs::read_to_string(&path).expect("a cell file");
        let mut keys = Vec::new();
        numeric_keys(&text.parse().expect("TOML"), &mut keys);
        for key in keys {
            assert!(
                units.iter().any(|unit| key.ends_with(unit))
                    || without_dimension.contains(&key.as_str()),
                "{}: {key} has no unit",
                path.display()
            );
            seen.insert(key);
        }
    }
    for key in without_dimension {
        assert!(seen.contains(key), "no cell file has the key {key}");
    }
}

/// Keys of the tables that a source file reads and refuses others in: fields of what it marks with `deny_unknown_fields`.
fn strict_keys(source: &str) -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    let (mut strict, mut inside, mut renamed) = (false, false, None);
    for line in source.lines() {
        let text = line.trim();
        if text.starts_with("//") {
            continue;
        }
        if text.starts_with("#[") {
            strict |= text.starts_with("#[serde(") && text.contains("deny_unknown_fields");
            let name = text.split("rename = \"").nth(1);
            renamed = name
                .and_then(|name| name.split('"').next())
                .map(str::to_owned)
                .or(renamed);
            continue;
        }
        let item = text.strip_prefix("pub ").unwrap_or(text);
        if item.starts_with("struct ") || item.starts_with("enum ") {
            // An empty one ends on its line.
            inside = std::mem::take(&mut strict) && !item.ends_with("{}");
        } else if line == "}" {
            inside = false;
        } else if inside && let Some((name, _)) = item.split_once(": ") {
            keys.insert(renamed.take().unwrap_or_else(|| name.to_owned()));
        }
        renamed = None;
    }
    keys
}

#[test]
fn the_keys_of_a_table_are_the_fields_of_what_it_is_read_into() {
    let source = "#[serde(deny_unknown_fields, default)]\npub struct A {\n    /// Doc: b.\n    #[serde(rename = \"type\")]\n    \
                  pub data_type: u8,\n    #[serde(default = \"one\")]\n    pub scale: f64,\n}\npub struct B {\n    pub other: u8,\n}\n";
    let keys: Vec<String> = strict_keys(source).into_iter().collect();
    assert_eq!(keys, ["scale", "type"]);
}

/// A page of the documentation, and the pages in the folder of its name.
fn pages(name: &str) -> String {
    let mut text = fs::read_to_string(root().join(format!("{name}.md"))).expect("the page");
    for entry in fs::read_dir(root().join(name)).expect("its folder") {
        let path = entry.expect("an entry").path();
        text += &fs::read_to_string(path).expect("a page");
    }
    text
}

#[test]
fn the_page_of_the_cell_file_lists_every_key_and_no_other() {
    let mut files = Vec::new();
    for folder in [
        "nodes",
        "crates/cell/src",
        "crates/controllers/src",
        "crates/effects/src",
        "crates/machine/src",
    ] {
        written_files(&root().join(folder), &mut files);
    }
    // The sections themselves, and the file of the operators.
    let others = [
        "crates/cell/src/lib.rs",
        "crates/cell/src/keys/operators.rs",
    ];
    files.retain(|path| {
        path.extension().is_some_and(|extension| extension == "rs")
            && path.components().any(|part| part.as_os_str() == "src")
            && !others.iter().any(|other| path.ends_with(other))
    });
    let mut read = BTreeSet::new();
    for path in files {
        read.extend(strict_keys(
            &fs::read_to_string(&path).expect("a source file"),
        ));
    }
    let page = pages("docs/cell-file");
    let rows = page.lines().filter(|line| line.starts_with("| `"));
    let listed: BTreeSet<String> = rows
        .filter_map(|row| row.split('|').nth(1))
        .flat_map(quoted)
        .collect();
    assert_eq!(listed, read);

    let mut sections: BTreeSet<String> = cell::NODES.iter().map(|&name| name.to_owned()).collect();
    for entry in fs::read_dir(cell_tests::launch_scripts()).expect("launch-scripts") {
        let path = entry.expect("an entry").path();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let text = fs::read_to_string(&path).expect("a cell file");
            let table: toml::Table = text.parse().expect("TOML");
            sections.extend(table.keys().cloned());
        }
    }
    for section in sections {
        let headings = [format!("## `[{section}]`"), format!("## `[[{section}]]`")];
        assert!(
            page.lines()
                .any(|line| headings.iter().any(|one| one == line)),
            "no section {section}"
        );
    }
}
