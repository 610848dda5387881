//! Licences and sources of all dependencies against `deny.toml`: the part of cargo-deny that needs nothing but Cargo.
//!
//! Licences are SPDX expressions: `OR` is a choice, `AND` binds more tightly, `WITH` belongs to its licence; the `/` of
//! older manifests is an `OR`.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result};
use serde::Deserialize;

/// What a dependency may be.
#[derive(Debug)]
pub struct Policy {
    allowed: BTreeSet<String>,
    /// By crate.
    exceptions: BTreeMap<String, BTreeSet<String>>,
    registries: BTreeSet<String>,
}

#[derive(Deserialize)]
struct File {
    licenses: Licences,
    sources: Sources,
}

#[derive(Deserialize)]
struct Licences {
    allow: BTreeSet<String>,
    exceptions: Vec<Exception>,
}

#[derive(Deserialize)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    allow: BTreeSet<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
struct Sources {
    allow_registry: BTreeSet<String>,
}

/// What `cargo metadata` tells.
#[derive(Deserialize)]
pub struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
    source: Option<String>,
}

impl Policy {
    /// From the text of `deny.toml`.
    ///
    /// # Errors
    /// It is not one.
    pub fn read(text: &str) -> Result<Self> {
        let file: File = toml::from_str(text).context("deny.toml")?;
        let exceptions = file.licenses.exceptions.into_iter();
        Ok(Self {
            allowed: file.licenses.allow,
            exceptions: exceptions.map(|one| (one.name, one.allow)).collect(),
            registries: file.sources.allow_registry,
        })
    }

    /// A sentence for each package that does not fit.
    pub fn refused(&self, metadata: &Metadata) -> Vec<String> {
        let mut refused = Vec::new();
        for package in &metadata.packages {
            let name = format!("{} {}", package.name, package.version);
            let own = self.exceptions.get(&package.name);
            let fits = |licence: &str| {
                self.allowed.contains(licence) || own.is_some_and(|own| own.contains(licence))
            };
            match &package.license {
                Some(expression) if satisfied(expression, &fits) => {}
                Some(expression) => {
                    refused.push(format!("{name}: the licence {expression:?} is not allowed"));
                }
                None => refused.push(format!("{name} has no licence")),
            }
            // Ours have no source.
            if let Some(source) = &package.source {
                let registry = source.strip_prefix("registry+").unwrap_or(source);
                if !self.registries.contains(registry) {
                    refused.push(format!("{name} comes from {source}, which is not allowed"));
                }
            }
        }
        refused
    }
}

/// True if an SPDX expression can be satisfied by licences that fit; false for one that cannot be read.
fn satisfied(expression: &str, fits: &impl Fn(&str) -> bool) -> bool {
    let spaced = expression
        .replace('(', " ( ")
        .replace(')', " ) ")
        .replace('/', " OR ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = words.as_slice();
    any(&mut rest, fits) == Some(true) && rest.is_empty()
}

fn any(rest: &mut &[&str], fits: &impl Fn(&str) -> bool) -> Option<bool> {
    let mut value = all(rest, fits)?;
    while let [word, tail @ ..] = rest
        && word.eq_ignore_ascii_case("OR")
    {
        *rest = tail;
        value |= all(rest, fits)?;
    }
    Some(value)
}

fn all(rest: &mut &[&str], fits: &impl Fn(&str) -> bool) -> Option<bool> {
    let mut value = one(rest, fits)?;
    while let [word, tail @ ..] = rest
        && word.eq_ignore_ascii_case("AND")
    {
        *rest = tail;
        value &= one(rest, fits)?;
    }
    Some(value)
}

fn one(rest: &mut &[&str], fits: &impl Fn(&str) -> bool) -> Option<bool> {
    match rest {
        ["(", tail @ ..] => {
            *rest = tail;
            let value = any(rest, fits)?;
            *rest = rest.strip_prefix(&[")"])?;
            Some(value)
        }
        [licence, with, exception, tail @ ..] if with.eq_ignore_ascii_case("WITH") => {
            *rest = tail;
            Some(fits(&format!("{licence} WITH {exception}")))
        }
        [licence, tail @ ..] => {
            *rest = tail;
            Some(fits(licence))
        }
        [] => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expression_is_satisfied_as_spdx_says() {
        let fits =
            |licence: &str| ["MIT", "ISC", "Apache-2.0 WITH LLVM-exception"].contains(&licence);
        for (expression, expected) in [
            ("MIT", true),
            ("GPL-3.0-only", false),
            ("MIT OR GPL-3.0-only", true),
            ("MIT/Apache-2.0", true),
            ("MIT AND GPL-3.0-only", false),
            ("GPL-3.0-only OR MIT AND ISC", true),
            ("(GPL-3.0-only OR MIT) AND MPL-2.0", false),
            ("(GPL-3.0-only OR MIT) AND ISC", true),
            ("Apache-2.0 WITH LLVM-exception", true),
            ("Apache-2.0", false),
            ("(MIT", false),
            ("MIT ISC", false),
            ("", false),
        ] {
            assert_eq!(satisfied(expression, &fits), expected, "{expression}");
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let policy = Policy::read(
            "[licenses]\nallow = [\"MIT\"]\nexceptions = [{ crate = \"odd\", allow = [\"MPL-2.0\"] }]\n\
             [sources]\nallow-registry = [\"https://index\"]\n",
        )
        .expect("a policy");
        let metadata = serde_json::json!({ "packages": [
            { "name": "good", "version": "1.0.0", "license": "MIT", "source": "registry+https://index" },
            { "name": "ours", "version": "1.0.0", "license": "MIT", "source": null },
            { "name": "odd", "version": "1.0.0", "license": "MPL-2.0", "source": "registry+https://index" },
            { "name": "other", "version": "2.0.0", "license": "MPL-2.0", "source": "git+https://somewhere" },
            { "name": "none", "version": "3.0.0", "license": null, "source": null },
        ]});
        let refused = policy.refused(&serde_json::from_value(metadata).expect("metadata"));
        assert_eq!(
            refused,
            [
                "other 2.0.0: the licence \"MPL-2.0\" is not allowed",
                "other 2.0.0 comes from git+https://somewhere, which is not allowed",
                "none 3.0.0 has no licence",
            ]
        );
    }
}
