//! What several test binaries share.

use std::path::PathBuf;

/// Path of reference data beside the repository; `None`, with a note, where it is not there.
pub(crate) fn shared(path: &str) -> Option<PathBuf> {
    let full = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")).join(path);
    if full.exists() {
        return Some(full);
    }
    eprintln!("skipped: {path} is not beside the repository");
    None
}
