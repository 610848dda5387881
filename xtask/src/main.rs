//! Tasks of the workspace, run as `cargo run --release -p xtask -- TASK`.

mod deb;

use std::{
    io::{Write as _, stdout},
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

use anyhow::{Result, bail};
use xtask::{
    allowed::Allowed, code::Code, codegen, imports, licences, sbom, unused, workspace_root,
};

const USAGE: &str = "\
usage: cargo run --release -p xtask -- TASK

  codegen            Writes msgs/src/generated.rs from the message files.
  bags [NAME...]     Makes the sample recordings of bags/samples again from their recipes: all, or those named.
  imports [CRATE...] Prints the imports between crates, and between folders and files of each CRATE, with the imported
                     names. Then prints the circles among files; exit status 1 if there is one that is not in
                     xtask/allowed.toml. The edge from a module to the modules that it declares is taken out.
  unused             Prints public items of src that nothing but tests, examples and benches reaches, by following
                     paths from main of every program; exit status 1 if there is one that is not in
                     xtask/allowed.toml. Types are not inferred. It misses, so says nothing of: a function of a type
                     when some reached code uses any member of the same name; trait implementations of a type in use;
                     fields and variants; code behind conditions that never hold; items of generated.rs.
  licences [FOLDER...] Checks licences and sources of all dependencies against deny.toml, as cargo-deny does, which is not
                     needed; exit status 1 if one does not fit. Of this workspace, or of those in the folders.
  sbom               Prints the bill of materials of the program on Linux, x86-64: CycloneDX 1.5.
  deb [--binary FILE] [--version VERSION] [--out DIR]
                     Makes the Debian package of a program, that of `.ci/run dist` unless FILE is another, in target/deb or
                     DIR, and prints its path.
";

/// Packages that exist for development only: neither searched from nor reported.
const DEVELOPMENT: [&str; 3] = ["tests", "dev", "xtask"];

fn main() -> Result<ExitCode> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["codegen"] => {
            codegen::write(&workspace_root()?.join("msgs"))?;
            Ok(ExitCode::SUCCESS)
        }
        ["bags", ..] => make_bags(&arguments[1..]),
        ["imports", ..] => print_imports(&arguments[1..]),
        ["unused"] => print_unused(),
        ["licences", ref folders @ ..] => print_licences(folders),
        ["sbom"] => print_bill(),
        ["deb", ..] => deb::run(&arguments[1..]),
        _ => bail!("{USAGE}"),
    }
}

/// What `cargo metadata` tells of the workspace, as JSON.
fn metadata(more: &[&str]) -> Result<Vec<u8>> {
    metadata_of(&workspace_root()?, more)
}

/// The same of the workspace in a folder.
fn metadata_of(folder: &Path, more: &[&str]) -> Result<Vec<u8>> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let told = Command::new(cargo)
        .args(["metadata", "--locked", "--format-version", "1"])
        .args(more)
        .current_dir(folder)
        .output()?;
    if !told.status.success() {
        bail!("cargo metadata: {}", String::from_utf8_lossy(&told.stderr));
    }
    Ok(told.stdout)
}

fn print_bill() -> Result<ExitCode> {
    let told = metadata(&["--filter-platform", "x86_64-unknown-linux-gnu"])?;
    let lock = std::fs::read_to_string(workspace_root()?.join("Cargo.lock"))?;
    let bill = sbom::bill(&serde_json::from_slice(&told)?, &lock, "probecell")?;
    writeln!(stdout(), "{bill:#}")?;
    Ok(ExitCode::SUCCESS)
}

fn print_licences(folders: &[&str]) -> Result<ExitCode> {
    let root = workspace_root()?;
    let policy = licences::Policy::read(&std::fs::read_to_string(root.join("deny.toml"))?)?;
    let folders = if folders.is_empty() { &[""] } else { folders };
    let mut refused = Vec::new();
    for folder in folders {
        let told = metadata_of(&root.join(folder), &[])?;
        refused.extend(policy.refused(&serde_json::from_slice(&told)?));
    }
    let mut out = stdout().lock();
    for sentence in &refused {
        writeln!(out, "{sentence}")?;
    }
    Ok(if refused.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Runs the example of the test crate that makes the samples: this crate imports none of ours.
fn make_bags(names: &[String]) -> Result<ExitCode> {
    let root = workspace_root()?;
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    // Of the whole workspace: a selection by -p has other features, and compiles Zenoh anew.
    let status = Command::new(cargo)
        .args([
            "build",
            "--release",
            "--workspace",
            "--example",
            "sample_bags",
        ])
        .current_dir(&root)
        .status()?;
    if !status.success() {
        return Ok(ExitCode::FAILURE);
    }
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
    let status = Command::new(target.join("release/examples/sample_bags"))
        .args(names)
        .current_dir(&root)
        .status()?;
    Ok(if status.success() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn print_imports(crates: &[String]) -> Result<ExitCode> {
    let root = workspace_root()?;
    let (code, allowed) = (Code::read(&root)?, Allowed::read(&root)?);
    if let Some(unknown) = crates
        .iter()
        .find(|name| !code.packages.iter().any(|package| package.name == **name))
    {
        bail!("there is no crate {unknown} in the workspace");
    }
    let edges = imports::edges(&code);
    let mut out = stdout().lock();
    write!(out, "{}", imports::report(&code, &edges, crates))?;
    let mut status = ExitCode::SUCCESS;
    let circles = imports::circles(&edges.keys().cloned().collect());
    writeln!(
        out,
        "{} circles of files (the edge from a module to those that it declares taken out)",
        circles.len()
    )?;
    for circle in circles {
        let reason = allowed.circle(&circle);
        let verdict = reason.map_or("not allowed".to_owned(), |reason| {
            format!("allowed: {reason}")
        });
        writeln!(out, "  circle of {} files, {verdict}", circle.len())?;
        write!(out, "{}", imports::describe(&circle, &edges))?;
        if reason.is_none() {
            status = ExitCode::FAILURE;
        }
    }
    Ok(status)
}

fn print_unused() -> Result<ExitCode> {
    let root = workspace_root()?;
    let (code, allowed) = (Code::read(&root)?, Allowed::read(&root)?);
    let (mut unused, lines) = unused::find(&code, &DEVELOPMENT);
    let mut out = stdout().lock();
    unused.retain(|item| match allowed.unused(&item.path) {
        Some(reason) => writeln!(out, "{}: {} stays: {reason}", item.at, item.path).is_err(),
        None => true,
    });
    write!(out, "{}", unused::report(&unused, lines))?;
    Ok(if unused.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
