//! The machines of the hall: cells of `launch-scripts`, built in.

use std::{
    fs,
    net::{Ipv4Addr, TcpListener},
    path::{Path, PathBuf},
};

use anyhow::Context;
use toml_edit::DocumentMut;

use crate::default_cell;

/// A machine of the hall.
pub(super) struct Machine {
    /// Name of its cell.
    pub(super) name: &'static str,
    /// What it is.
    pub(super) is: &'static str,
    /// Cell file.
    pub(super) file: &'static str,
    /// Cell file and robot description: name, content.
    files: [(&'static str, &'static str); 2],
}

/// The machines.
pub(super) static MACHINES: [Machine; 3] = [
    Machine {
        name: "turn_mill",
        is: "turn-mill",
        file: "turn_mill.toml",
        files: default_cell::FILES,
    },
    Machine {
        name: "ball_check",
        is: "five-axis mill",
        file: "ball_check.toml",
        files: [
            (
                "ball_check.toml",
                include_str!("../../../../launch-scripts/ball_check.toml"),
            ),
            (
                "wcbxfzyst.urdf",
                include_str!("../../../../launch-scripts/wcbxfzyst.urdf"),
            ),
        ],
    },
    Machine {
        name: "robot_check",
        is: "robot",
        file: "robot_check.toml",
        files: [
            (
                "robot_check.toml",
                include_str!("../../../../launch-scripts/robot_check.toml"),
            ),
            (
                "robot_arm.urdf",
                include_str!("../../../../launch-scripts/robot_arm.urdf"),
            ),
        ],
    },
];

/// Writes the cell files into a new folder: the one asked for, or one of its name with a number.
pub(super) fn write(wanted: &Path) -> anyhow::Result<PathBuf> {
    let numbered = (2..).map(|number| PathBuf::from(format!("{}-{number}", wanted.display())));
    let mut names = std::iter::once(wanted.to_owned()).chain(numbered);
    let folder = names.find(|name| !name.exists());
    let folder = folder.context("no name is left for the folder of the demo")?;
    let cannot = |path: &Path| format!("cannot write {}", path.display());
    fs::create_dir_all(&folder).with_context(|| cannot(&folder))?;
    for machine in &MACHINES {
        for (name, text) in machine.files {
            let path = folder.join(name);
            let text = if name == machine.file {
                in_hall(text)?
            } else {
                text.to_owned()
            };
            fs::write(&path, text).with_context(|| cannot(&path))?;
        }
    }
    Ok(folder)
}

/// A cell file in the hall. Its router has a port of its own, apart from cells that run on this computer.
fn in_hall(text: &str) -> anyhow::Result<String> {
    let port = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?;
    let mut text: DocumentMut = text.parse()?;
    text["bus"]["router_endpoint"] = toml_edit::value(format!("tcp/{port}"));
    Ok(text.to_string())
}

/// The next part scatters as another part does.
pub(super) fn scatter_anew(file: &Path) -> anyhow::Result<()> {
    let mut text: DocumentMut = fs::read_to_string(file)?.parse()?;
    let seed = &mut text["simulator"]["seed"];
    let next = seed.as_integer().context("simulator.seed")? + 1;
    *seed = toml_edit::value(next);
    fs::write(file, text.to_string())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cell_of_the_hall_can_be_read_and_has_nothing_adopted() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = write(&folder.path().join("demo")).expect("written");
        let second = write(&folder.path().join("demo")).expect("written beside it");
        assert!(second.ends_with("demo-2"));
        for machine in &MACHINES {
            let cell = cell::Cell::read(&first.join(machine.file)).expect("a cell");
            assert_eq!(cell.cell.name, machine.name);
            assert!(cell.model.effects.is_empty(), "{}", machine.name);
            assert_ne!(cell.bus.router_endpoint, host::bus::ROUTER_ENDPOINT);
            scatter_anew(&first.join(machine.file)).expect("another seed");
            cell::Cell::read(&first.join(machine.file)).expect("still a cell");
        }
    }
}
