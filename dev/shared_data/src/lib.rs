//! Data that some tests need and a clone does not hold: the folder `../shared` beside the repository.
//!
//! A test that exhausts a space (states, seeds, kills) takes a [`share`] of it, and the whole where `PROBECELL_TESTS=whole`.
//!
//! A test asks [`path`] for what it needs. What is not there is noted in `target/skipped.txt`, a line for each test and
//! thing, so that a run which skipped something says so at its end:
//!
//! ```text
//! rm -f target/skipped.txt; cargo test --release --workspace; cat target/skipped.txt
//! ```
//!
//! ```
//! let bags = shared_data::path("trials/dev"); // None, and a line in target/skipped.txt, where it is not there
//! assert!(bags.is_none_or(|folder| folder.is_dir()));
//! ```

use std::{
    fs::{self, OpenOptions},
    io::Write as _,
    panic::Location,
    path::{Path, PathBuf},
    process::Command,
};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// `whole` where the environment says `PROBECELL_TESTS=whole`, as the step `whole` of `.ci/run` does; else `quick`.
pub fn share<T>(quick: T, whole: T) -> T {
    let is_whole = std::env::var_os("PROBECELL_TESTS").is_some_and(|value| value == "whole");
    if is_whole { whole } else { quick }
}

/// `../shared/PATH`; `None`, noted in `target/skipped.txt`, where it is not there.
#[track_caller]
pub fn path(path: &str) -> Option<PathBuf> {
    let full = Path::new(ROOT).join("../shared").join(path);
    if full.exists() {
        return Some(full);
    }
    note_missing(&format!("../shared/{path} is not there"));
    None
}

/// Recordings in `../shared/FOLDER`, sorted; none, noted in `target/skipped.txt`, where it is not there.
#[track_caller]
pub fn bags(folder: &str) -> Vec<PathBuf> {
    let Some(folder) = path(folder) else {
        return Vec::new();
    };
    let entries = fs::read_dir(&folder).into_iter().flatten().flatten();
    let mut bags: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "mcap")
        })
        .collect();
    bags.sort();
    assert!(!bags.is_empty(), "{} holds no recording", folder.display());
    bags
}

/// Notes in `target/skipped.txt` that the running test lacks something and so checks less.
#[track_caller]
pub fn note_missing(what: &str) {
    let thread = std::thread::current();
    let line = note(thread.name().unwrap_or("main"), Location::caller(), what);
    append(&Path::new(ROOT).join("target"), &line)
        .unwrap_or_else(|error| panic!("target/skipped.txt cannot be written: {error}"));
}

/// A Python that imports these modules (`numpy, mcap`): that of `target/venv`, where `.ci/run` installs what tests need, else
/// `python3`; none, noted in `target/skipped.txt`, where they are not installed.
#[track_caller]
pub fn python(modules: &str) -> Option<PathBuf> {
    let own = Path::new(ROOT).join("target/venv/bin/python");
    let python = if own.exists() {
        own
    } else {
        PathBuf::from("python3")
    };
    let imports = Command::new(&python)
        .args(["-c", &format!("import {modules}")])
        .output();
    if imports.is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    note_missing(&format!("python3 with {modules} is not installed"));
    None
}

/// One line: file, test, and what is missing.
fn note(test: &str, caller: &Location<'_>, what: &str) -> String {
    format!("skipped: {}: {test}: {what}\n", caller.file())
}

/// Appends in one write, so that lines of tests that run at the same time do not mix.
fn append(folder: &Path, line: &str) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    let file = folder.join("skipped.txt");
    let mut file = OpenOptions::new().create(true).append(true).open(file)?;
    file.write_all(line.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_names_file_test_and_what_is_missing() {
        assert_eq!(
            note("a_test", Location::caller(), "../shared/x is not there"),
            "skipped: dev/shared_data/src/lib.rs: a_test: ../shared/x is not there\n"
        );
    }

    #[test]
    fn notes_are_added_to_those_that_are_there() {
        let folder = std::env::temp_dir().join(format!("shared_data_{}", std::process::id()));
        append(&folder, "one\n").unwrap();
        append(&folder, "two\n").unwrap();
        let notes = fs::read_to_string(folder.join("skipped.txt")).unwrap();
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(notes, "one\ntwo\n");
    }
}
