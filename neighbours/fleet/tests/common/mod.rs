//! What the tests share.

use std::path::{Path, PathBuf};

/// Folder of the sample recordings.
pub(crate) fn samples() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let roots = own.ancestors().map(|folder| folder.join("bags/samples"));
    roots
        .into_iter()
        .find(|folder| folder.is_dir())
        .expect("the samples of the project")
}
