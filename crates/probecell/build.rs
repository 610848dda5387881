//! Hands the revision of the source to a program that writes it into recordings: this one, and neighbours that name this script.

use std::process::Command;

fn main() {
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"]);
    println!(
        "cargo::rerun-if-changed={}",
        log.as_deref().unwrap_or("Cargo.toml")
    );
    let revision = git(&["rev-parse", "HEAD"]).unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rustc-env=PROBECELL_REVISION={revision}");
}

/// What git prints; nothing outside a repository.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.trim().is_empty()).then(|| text.trim().to_owned())
}
