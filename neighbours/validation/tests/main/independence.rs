//! The plant of the blind tests takes nothing of the effects that it is to hide (docs/adr/0009).

use std::fs;
use std::path::Path;

/// What it may know of `effects`: the messages of a session, and where its touches lie.
const ALLOWED: [&str; 3] = [
    "effects::session::",
    "effects::observation::Row",
    "effects::observe",
];
/// Modules that judge what was found, and so know the diagnosis.
const JUDGES: [&str; 3] = ["card", "card.rs", "refine.rs"];

#[test]
fn the_plant_imports_nothing_of_the_library_of_effects() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src/blind"));
    let mut files: Vec<_> = fs::read_dir(folder)
        .expect("the plant")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| !JUDGES.iter().any(|judge| path.ends_with(judge)))
        .collect();
    files.push(folder.with_extension("rs"));
    assert!(files.len() >= 6, "{files:?}");
    for path in files {
        let text = fs::read_to_string(&path).expect("a source file");
        for line in text.lines().map(str::trim) {
            if line.starts_with("//") {
                continue;
            }
            for foreign in ["inference::", "diagnosis::", "experiment::"] {
                assert!(!line.contains(foreign), "{}: {line}", path.display());
            }
            let known = ALLOWED.iter().any(|allowed| line.contains(allowed));
            assert!(
                known || !line.contains("effects::"),
                "{}: {line}",
                path.display()
            );
        }
    }
}
