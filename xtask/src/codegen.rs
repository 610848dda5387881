//! Makes the Rust side of `msgs/` from its ROS interface files.
//!
//! `msgs/msg` and `msgs/srv` are the package's own interfaces, `msgs/standard/<package>/msg` the definitions of the
//! standard types that they use. All are parsed ([`interface`]), hashed after REP 2016 ([`hash`]) and written as
//! plain structs ([`rust`]) and enumerations ([`codes`]) to `msgs/src/generated.rs`. Nothing here reads an installed ROS.

use std::{fs, path::Path};

use anyhow::{Context, Result};

pub mod codes;
pub mod hash;
pub mod interface;
mod item;
pub mod package;
pub mod rust;

/// Name of the package whose folder is `msgs/`.
pub const OWN_PACKAGE: &str = "probecell_msgs";

/// The text of `generated.rs` for the interface files under `msgs`, formatted.
pub fn generate(msgs: &Path) -> Result<String> {
    rust::generate(&package::load(msgs)?)
}

/// Writes `src/generated.rs` under `msgs`.
pub fn write(msgs: &Path) -> Result<()> {
    let path = msgs.join("src/generated.rs");
    fs::write(&path, generate(msgs)?).with_context(|| format!("cannot write {}", path.display()))
}
