//! What each process of a cell may do once it has read its settings ([`confinement`]; `docs/process-rights.md`).

use std::{
    iter,
    path::{Path, PathBuf},
};

use anyhow::Context as _;
use cell::{Cell, keys::KeyFolder, secrets, strangers::SOCKET};
use confinement::{Confined, Rights, Sockets, confine, interpreter};
use controllers::driver::Role;
use host::bus::BusConfig;

use crate::{commands::external, operator::orders};

/// Of a process that joins the bus: its sockets and its certificates.
fn of_bus(bus: &BusConfig) -> anyhow::Result<Rights> {
    let rights = Rights::default().reads(bus.files());
    Ok(rights.with_sockets(bus.sockets()?))
}

/// A node: the bus, and no file of the user.
pub(crate) fn node(bus: &BusConfig) -> anyhow::Result<Confined> {
    Ok(confine(&of_bus(bus)?)?)
}

/// The driver of a machine: its controller as well.
pub(crate) fn driver(cell: &Cell, bus: &BusConfig) -> anyhow::Result<Confined> {
    let Role::Process(controller) = cell.driver_role() else {
        return node(bus);
    };
    let files = controller.files();
    let rights = networked(bus)?.reads(files.read).writes(files.write);
    Ok(confine(&rights)?)
}

fn networked(bus: &BusConfig) -> anyhow::Result<Rights> {
    let sockets = Sockets {
        tcp: true,
        udp: true,
        ports: None,
        ..bus.sockets()?
    };
    Ok(of_bus(bus)?.with_sockets(sockets))
}

/// The recorder: the bus, and the folders of recordings.
pub(crate) fn recorder(bus: &BusConfig, folders: [&Path; 2]) -> anyhow::Result<Confined> {
    make(folders)?;
    Ok(confine(&of_bus(bus)?.writes(folders))?)
}

fn make<'a>(folders: impl IntoIterator<Item = &'a Path>) -> anyhow::Result<()> {
    for folder in folders {
        let cannot = || format!("cannot make {}", folder.display());
        std::fs::create_dir_all(folder).with_context(cannot)?;
    }
    Ok(())
}

/// The path, or the folder that is there in which it will be made.
fn there(path: impl AsRef<Path>) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_default();
    let there = path.ancestors().find(|folder| folder.exists());
    there.unwrap_or(Path::new("/")).to_owned()
}

/// What reads a recording and nothing else.
pub(crate) fn reader(recording: &Path) -> anyhow::Result<Confined> {
    Ok(confine(&Rights::default().reads([there(recording)]))?)
}

/// A process that serves what it reads: folders, the bus, and of the cells' keys what it joins the bus by.
pub(crate) fn server(
    cells: &[Cell],
    buses: &[BusConfig],
    folders: &[PathBuf],
) -> anyhow::Result<Confined> {
    let mut rights = Rights::default()
        .with_sockets(Sockets::any())
        .reads(folders.iter().map(there))
        .reads(buses.iter().flat_map(BusConfig::files));
    for cell in cells {
        rights = rights.reads(cell.bus.zenoh.iter().flat_map(secrets::files));
        // Without a place for keys there are none.
        if let Ok(keys) = KeyFolder::of(cell) {
            rights = rights.reads(keys.files_of_bus());
        }
    }
    Ok(confine(&rights)?)
}

/// A router: the folders of its Unix sockets, and of what it keeps.
pub(crate) fn router(listen: &[String], kept: Option<&Path>) -> anyhow::Result<Confined> {
    make(kept)?;
    let rights = Rights::default()
        .reads(["/"])
        .writes(sockets(listen))
        .writes(kept);
    Ok(confine(&rights.with_sockets(Sockets::any()))?)
}

/// Folders of the Unix sockets among locators.
fn sockets(listen: &[String]) -> impl Iterator<Item = PathBuf> {
    let paths = listen.iter().filter_map(|one| one.strip_prefix(SOCKET));
    let paths = paths.filter_map(|one| Path::new(one.strip_prefix('/')?).parent());
    paths.map(Path::to_owned).filter(|one| one.exists())
}

/// POSIX shared memory (shm_overview(7)): what is laid over a process from outside (`LD_PRELOAD`) shares it with the processes
/// that the launcher starts, before these confine themselves.
const SHARED_MEMORY: &str = "/dev/shm";

/// The launcher: its router, and all that the processes may do that it starts, since these get no more rights than it has.
pub(crate) fn launcher(cell: &Cell, listen: &[String], recorded: bool) -> anyhow::Result<Confined> {
    let own = std::env::current_exe()?;
    let mut programs = Vec::new();
    for program in iter::once(own).chain(external::signals_reader(cell)?) {
        let unread = || format!("cannot read {}", program.display());
        programs.extend(interpreter(&program).with_context(unread)?);
        programs.push(program);
    }
    let orders = orders::folder(cell)?;
    make([orders.as_path()])?;
    let mut rights = Rights::default()
        .reads(["/"])
        .writes([KeyFolder::of(cell)?.path(), &orders])
        .writes(sockets(listen))
        .starts(programs);
    if Path::new(SHARED_MEMORY).exists() {
        rights = rights.writes([SHARED_MEMORY]);
    }
    if recorded {
        let recordings = cell.recorder.folder.as_path();
        make([recordings])?;
        rights = rights.writes([recordings]);
    }
    if let Role::Process(controller) = cell.driver_role() {
        rights = rights.writes(controller.files().write);
    }
    Ok(confine(&rights.with_sockets(Sockets::any()))?)
}
