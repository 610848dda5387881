//! Each promise of `docs/guarantees.md` names what shows it, and that exists.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use crate::support::root;

/// Every file with tests in it: Rust, Python, and the steps of CI.
static SOURCES: LazyLock<Vec<(PathBuf, String)>> = LazyLock::new(|| {
    let mut sources = Vec::new();
    for folder in ["bags", "crates", "dev", "nodes", "tests", "xtask", "fuzz"] {
        collect(&root().join(folder), &mut sources);
    }
    let ci = root().join(".ci/run");
    let text = fs::read_to_string(&ci).expect(".ci/run");
    sources.push((ci, text));
    sources
});

fn collect(folder: &Path, sources: &mut Vec<(PathBuf, String)>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            if path.file_name().is_none_or(|name| name != "target") {
                collect(&path, sources);
            }
        } else if path
            .extension()
            .is_some_and(|kind| kind == "rs" || kind == "py")
        {
            let text = fs::read_to_string(&path).unwrap_or_default();
            sources.push((path, text));
        }
    }
}

/// `a/{b,c}.rs` stands for two paths.
fn expanded(path: &str) -> Vec<String> {
    let parts = path.split_once('{').and_then(|(before, rest)| {
        let (names, after) = rest.split_once('}')?;
        Some((before, names, after))
    });
    parts.map_or_else(
        || vec![path.to_owned()],
        |(before, names, after)| {
            let one = |name: &str| format!("{before}{name}{after}");
            names.split(',').map(one).collect()
        },
    )
}

/// A path of the repository (perhaps with a word for a program after it), from its root or from one of its folders.
fn is_path(name: &str) -> bool {
    let path = name.split(' ').next().unwrap_or_default();
    let looks = path.contains('/') || path.contains('.');
    let exists = |path: &String| {
        ["", "crates", "tests/cli", "dev"]
            .iter()
            .any(|folder| root().join(folder).join(path).exists())
    };
    looks && expanded(path).iter().all(exists)
}

/// A test in Rust, a function of a Python script or a step of CI; scripts are told in words.
fn is_function(name: &str) -> bool {
    let name = name.replace(' ', "_").to_lowercase();
    SOURCES.iter().any(|(path, text)| {
        let found = |head: &str, tail: &str| text.contains(&format!("{head}{name}{tail}"));
        match path.extension().and_then(|kind| kind.to_str()) {
            Some("rs") => found("#[test]\nfn ", "()") || found("#[test]\n    fn ", "()"),
            Some("py") => found("def ", "(") || found("\"", "\""),
            _ => found("\n", "() {"),
        }
    })
}

/// Promise and test of each row of the document.
fn rows(text: &str) -> Vec<(String, String)> {
    let cells = |line: &str| -> Vec<String> {
        line.trim_matches('|')
            .split(" |")
            .map(|cell| cell.trim_matches(['|', ' ']).to_owned())
            .collect()
    };
    let rows = text.lines().filter(|line| line.starts_with('|')).map(cells);
    rows.filter(|cells| cells[0] != "promise" && !cells[0].starts_with("---"))
        .map(|cells| {
            assert!(cells.len() >= 3, "no row of three cells: {cells:?}");
            (cells[0].clone(), cells[cells.len() - 1].clone())
        })
        .collect()
}

#[test]
fn each_promise_names_tests_that_exist() {
    let text = fs::read_to_string(root().join("docs/guarantees.md")).expect("the document");
    let rows = rows(&text);
    assert!(rows.len() > 40, "{} promises", rows.len());
    let mut missing = Vec::new();
    for (promise, test) in &rows {
        let named: Vec<&str> = test.split('`').skip(1).step_by(2).collect();
        if named.is_empty() && !test.starts_with("the same") {
            missing.push(format!("{promise}: no test"));
        }
        for name in named {
            if !is_path(name) && !is_function(name) {
                missing.push(format!("{promise}: {name}"));
            }
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

/// What does not exist is found to be missing.
#[test]
fn a_test_that_does_not_exist_is_not_found() {
    assert!(is_function("each_promise_names_tests_that_exist"));
    assert!(is_path("tests/tests/main/{tidy,guarantees}.rs") && is_path("crates/signatures"));
    for name in [
        "no_test_has_this_name_",
        "tests/tests/main/nothing.rs",
        "tests/tests/main/{tidy,nothing}.rs",
    ] {
        assert!(!is_function(name) && !is_path(name), "{name}");
    }
}

/// The figures of the document are those of the tests.
#[test]
fn the_document_says_how_many_seeds_are_run() {
    let text = fs::read_to_string(root().join("docs/guarantees.md")).expect("the document");
    let seeds =
        fs::read_to_string(root().join("dev/fault_world/tests/main/seeds.rs")).expect("seeds");
    let after = seeds.split_once("const SEEDS: u64 = ").expect("how many").1;
    let count = after.split(';').next().unwrap_or_default();
    assert!(text.contains(&format!("{count} seeds")), "{count} seeds");
}
