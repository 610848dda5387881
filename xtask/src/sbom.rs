//! A bill of materials of the program: every package that its build takes, with version, licence, checksum and what it needs.
//!
//! CycloneDX 1.5 in JSON (<https://cyclonedx.org/docs/1.5/json/>), from `cargo metadata` and `Cargo.lock`. It holds neither a
//! time nor a serial number, so that one revision has one bill.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result};
use serde::Deserialize;
use serde_json::{Value, json};

/// What `cargo metadata` tells, resolved for one platform.
#[derive(Deserialize)]
pub struct Metadata {
    packages: Vec<Package>,
    resolve: Resolve,
}

#[derive(Deserialize)]
struct Package {
    id: String,
    name: String,
    version: String,
    license: Option<String>,
    source: Option<String>,
    description: Option<String>,
}

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    pkg: String,
    dep_kinds: Vec<Kind>,
}

#[derive(Deserialize)]
struct Kind {
    /// None: of the program itself; `build`, `dev`.
    kind: Option<String>,
}

#[derive(Deserialize)]
struct Lock {
    package: Vec<Locked>,
}

#[derive(Deserialize)]
struct Locked {
    name: String,
    version: String,
    checksum: Option<String>,
}

/// The bill of package `root`, whose build takes its normal and build dependencies; `lock` is the text of `Cargo.lock`.
///
/// # Errors
/// `lock` cannot be read, or there is no such package.
pub fn bill(metadata: &Metadata, lock: &str, root: &str) -> Result<Value> {
    let lock: Lock = toml::from_str(lock).context("Cargo.lock")?;
    let checksums: BTreeMap<(&str, &str), &str> = (lock.package.iter())
        .filter_map(|one| {
            Some((
                (one.name.as_str(), one.version.as_str()),
                one.checksum.as_deref()?,
            ))
        })
        .collect();
    let packages = metadata.packages.iter();
    let packages: BTreeMap<&str, &Package> = packages
        .map(|package| (package.id.as_str(), package))
        .collect();
    let needs: BTreeMap<&str, BTreeSet<&str>> = (metadata.resolve.nodes.iter())
        .map(|node| {
            let built = |one: &&Dependency| {
                let mut kinds = one.dep_kinds.iter();
                kinds.any(|kind| kind.kind.as_deref() != Some("dev"))
            };
            let needed = node.deps.iter().filter(built);
            (
                node.id.as_str(),
                needed.map(|one| one.pkg.as_str()).collect(),
            )
        })
        .collect();
    let root = (metadata.packages.iter())
        .find(|package| package.name == root && package.source.is_none())
        .with_context(|| format!("there is no package {root} in the workspace"))?;
    let mut taken = BTreeSet::new();
    let mut left = vec![root.id.as_str()];
    while let Some(id) = left.pop() {
        if taken.insert(id) {
            left.extend(needs.get(id).into_iter().flatten());
        }
    }
    // Sorted by what people read, not by Cargo's identifiers, which hold paths.
    let mut all: Vec<&Package> = taken
        .iter()
        .filter_map(|id| packages.get(id).copied())
        .collect();
    all.sort_by_key(|package| (&package.name, &package.version));
    let components = all.iter().filter(|package| package.id != root.id);
    let dependencies = all.iter().map(|package| {
        let needed = needs.get(package.id.as_str()).into_iter().flatten();
        let needed = needed.filter_map(|id| packages.get(id));
        let needed: BTreeSet<String> = needed.map(|package| reference(package)).collect();
        json!({"ref": reference(package), "dependsOn": needed})
    });
    let components = components.map(|one| component(one, "library", &checksums));
    let mut components: Vec<Value> = components.collect();
    if all.iter().any(|package| package.name == "dashboard") {
        components.push(three());
    }
    Ok(json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": component(root, "application", &checksums)},
        "components": components,
        "dependencies": dependencies.collect::<Vec<_>>(),
    }))
}

/// The library that the dashboard hands to browsers, byte for byte as its makers publish it.
fn three() -> Value {
    json!({
        "type": "library",
        "bom-ref": "pkg:npm/three@0.180.0",
        "name": "three",
        "version": "0.180.0",
        "purl": "pkg:npm/three@0.180.0",
        "description": "JavaScript 3D library (crates/dashboard/assets/vendor)",
        "licenses": [{"expression": "MIT"}],
    })
}

/// A package URL (<https://github.com/package-url/purl-spec>).
fn reference(package: &Package) -> String {
    format!("pkg:cargo/{}@{}", package.name, package.version)
}

fn component(package: &Package, kind: &str, checksums: &BTreeMap<(&str, &str), &str>) -> Value {
    let mut component = json!({
        "type": kind,
        "bom-ref": reference(package),
        "name": package.name,
        "version": package.version,
        "purl": reference(package),
    });
    if let Some(description) = &package.description {
        component["description"] = description.trim().into();
    }
    if let Some(licence) = &package.license {
        // Older manifests separate choices by a slash.
        let licence = licence.replace(" / ", "/").replace('/', " OR ");
        component["licenses"] = json!([{"expression": licence}]);
    }
    let known = checksums.get(&(package.name.as_str(), package.version.as_str()));
    if let Some(checksum) = known.filter(|_| package.source.is_some()) {
        component["hashes"] = json!([{"alg": "SHA-256", "content": checksum}]);
    }
    component
}
