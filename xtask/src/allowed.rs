//! The list of circles and unused items that stay, each with its reason: `xtask/allowed.toml`.

use std::{collections::BTreeSet, fs, path::Path};

use anyhow::{Context, Result};
use serde::Deserialize;

/// What is allowed, and why.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Allowed {
    /// Circles of imports.
    #[serde(default)]
    circle: Vec<Circle>,
    /// Items that no program reaches.
    #[serde(default)]
    unused: Vec<Unused>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Circle {
    files: BTreeSet<String>,
    reason: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Unused {
    /// Full path; one that ends in `::` stands for everything that begins with it.
    item: String,
    reason: String,
}

impl Allowed {
    /// Reads the list of the workspace in `root`; empty if there is none.
    ///
    /// # Errors
    /// If the file cannot be parsed.
    pub fn read(root: &Path) -> Result<Self> {
        let path = root.join("xtask/allowed.toml");
        if !path.exists() {
            return Ok(Self::default());
        }
        toml::from_str(&fs::read_to_string(&path)?).with_context(|| path.display().to_string())
    }

    /// Why a circle of exactly these files stays.
    pub fn circle(&self, files: &[std::path::PathBuf]) -> Option<&str> {
        let files: BTreeSet<String> = files
            .iter()
            .map(|file| file.display().to_string())
            .collect();
        self.circle
            .iter()
            .find(|circle| circle.files == files)
            .map(|circle| circle.reason.as_str())
    }

    /// Why an unused item stays.
    pub fn unused(&self, path: &str) -> Option<&str> {
        self.unused
            .iter()
            .find(|unused| {
                unused.item == path || unused.item.ends_with("::") && path.starts_with(&unused.item)
            })
            .map(|unused| unused.reason.as_str())
    }
}
