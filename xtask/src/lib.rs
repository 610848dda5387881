//! The workspace's own tools, as functions that its tests can call too.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

pub mod allowed;
pub mod code;
pub mod codegen;
pub mod imports;
pub mod licences;
pub mod sbom;
pub mod unused;

/// Why writing into a `String` is not handled.
const WRITTEN: &str = "a String takes what is written";

/// The folder of the root manifest.
pub fn workspace_root() -> Result<PathBuf> {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    Ok(manifest
        .parent()
        .context("the xtask folder has no parent")?
        .to_owned())
}
