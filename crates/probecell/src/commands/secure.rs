//! `probecell secure`: users, passwords and a policy for the bus of a cell.

use std::{
    fs::{self, OpenOptions},
    io::Write as _,
    os::unix::fs::OpenOptionsExt as _,
    path::{Path, PathBuf},
};

use anyhow::Context;
use cell::{
    Cell,
    keys::{BusUsers, KeyFolder},
    policy,
};

use crate::{GOOD, output, ros_arguments::read_cell};

/// Secures the bus of a cell from its next start on, or takes that back.
pub(crate) fn run(file: &Path, out: Option<PathBuf>, off: bool) -> anyhow::Result<u8> {
    let cell = read_cell(file)?;
    let folder = KeyFolder::of(&cell)?;
    if off {
        let text = if folder.open_bus()? {
            "the cell is not secured any more from its next start on"
        } else {
            "the cell is not secured"
        };
        output::line(text);
        return Ok(GOOD);
    }
    let users = folder.secure(&cell)?;
    let out = out.unwrap_or_else(|| folder.path().join("bus"));
    fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
    let driver = cell.is_driver_external().then_some(policy::DRIVER);
    for user in [policy::ROS, policy::SCREEN].into_iter().chain(driver) {
        let path = out.join(format!("{user}.json5"));
        write(&path, &session_of(&cell, &users, user)?)?;
        output::line(&format!("ZENOH_SESSION_CONFIG_URI={}", path.display()));
    }
    output::line(&format!(
        "{} is secured from its next start on: each process puts on its own topics only; {} may read and call services, {} \
         may read; nobody else may join",
        cell.cell.name,
        policy::ROS,
        policy::SCREEN
    ));
    Ok(GOOD)
}

/// Configuration of a session of rmw_zenoh, JSON5.
fn session_of(cell: &Cell, users: &BusUsers, user: &str) -> anyhow::Result<String> {
    let mut session = serde_json::to_value(users.session(user, None))?;
    session["connect"] = serde_json::json!({ "endpoints": [cell.bus.router_endpoint] });
    session["scouting"] = serde_json::json!({ "multicast": { "enabled": false } });
    // Caches of transient-local publishers ask for it.
    session["timestamping"] = serde_json::json!({ "enabled": true });
    Ok(serde_json::to_string_pretty(&session)?)
}

/// A file that only its owner can read.
fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true).mode(0o600);
    let mut file = options
        .open(path)
        .with_context(|| format!("cannot write {}", path.display()))?;
    file.write_all(text.as_bytes())
        .with_context(|| format!("cannot write {}", path.display()))
}
