//! Any text as the `metadata.yaml` of a folder that holds a recording.

use std::{fs, sync::LazyLock};

use bags::Bag;

use crate::mcap::{folder, read, recording};

/// The recording and its metadata.
static RECORDING: LazyLock<(Vec<u8>, Vec<u8>)> = LazyLock::new(|| recording(true));

/// Reads the folder.
pub fn target(data: &[u8]) {
    let folder = folder();
    fs::write(folder.path().join("run_0.mcap"), &RECORDING.0).expect("a file in it");
    fs::write(folder.path().join("metadata.yaml"), data).expect("its metadata");
    if let Ok(bag) = Bag::open(folder.path()) {
        read(&bag);
    }
}

/// As our recorder writes it, and with a file more.
pub fn seeds() -> Vec<Vec<u8>> {
    let whole = String::from_utf8_lossy(&RECORDING.1);
    let more = whole.replace("- run_0.mcap", "- run_1.mcap\n    - run_0.mcap");
    vec![RECORDING.1.clone(), more.into_bytes()]
}
