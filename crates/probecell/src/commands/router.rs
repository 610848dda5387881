//! `probecell router`: a Zenoh router, so that a cell can span machines.

use std::{
    collections::BTreeSet,
    path::PathBuf,
    sync::{Arc, mpsc::channel},
    time::Duration,
};

use anyhow::Context;
use cell::{Cell, strangers};
use host::bus::{Router, RouterConfig, Storage};

use super::dashboard::buses;
use crate::{
    GOOD, cell_bus::bind_strangers, confined, output, own_socket::OwnSocket,
    ros_arguments::read_cell, signals,
};

/// How often what is kept is written to disk.
const WRITTEN: Duration = Duration::from_secs(10);

/// What the router keeps for dashboards that start later.
pub(crate) struct Keep {
    /// On disk, in this folder.
    pub(crate) folder: Option<PathBuf>,
    /// Other routers that are followed.
    pub(crate) follow: Vec<String>,
    /// Cell files by whose settings cells are followed.
    pub(crate) cells: Vec<PathBuf>,
    /// ROS domain.
    pub(crate) domain: u32,
}

/// What strangers may do at the router.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Strangers {
    /// Read only; writing is reserved to processes of the user who started the router, on the same host.
    Read,
    /// Read and write.
    Write,
}

/// Routes until SIGINT or SIGTERM.
pub(crate) fn run(
    listen: &[String],
    connect: &[String],
    to: Strangers,
    keep: Option<&Keep>,
) -> anyhow::Result<u8> {
    let mut config = RouterConfig {
        listen: listen.to_vec(),
        connect: connect.to_vec(),
        ..RouterConfig::default()
    };
    if to == Strangers::Read {
        bind_strangers(&mut config.zenoh, &strangers::read_only())?;
        for endpoint in listen {
            let socket = OwnSocket::of(endpoint).context(
                "the private socket of the router cannot be created: neither HOME nor XDG_STATE_HOME is set",
            )?;
            socket.prepare()?;
            // Before the network: see own_locator.
            config.listen.insert(0, socket.locator());
        }
    }
    let followed = match keep {
        Some(keep) => {
            let mut endpoints = vec![config.listen[0].clone()];
            endpoints.extend(keep.follow.iter().cloned());
            let mut followed = buses(&[], endpoints, keep.domain)?;
            let cells = keep.cells.iter().map(|file| read_cell(file));
            let cells: Vec<Cell> = cells.collect::<Result<_, _>>()?;
            if !cells.is_empty() {
                followed.extend(buses(&cells, Vec::new(), keep.domain)?);
            }
            followed
        }
        None => Vec::new(),
    };
    let folder = keep.and_then(|keep| keep.folder.as_deref());
    confined::router(&config.listen, folder)?;
    let router = Router::start(&config)?;
    let storage = match keep {
        Some(keep) => {
            let storage = Storage::open(keep.domain, ::dashboard::kept(), keep.folder.clone());
            let storage =
                Arc::new(storage.context("cannot read the folder of the retained state")?);
            router.serve(&storage)?;
            ::dashboard::keep(followed, &storage)?;
            Some(storage)
        }
        None => None,
    };
    if to == Strangers::Read {
        for endpoint in listen {
            if let Some(socket) = OwnSocket::of(endpoint) {
                socket.write_opened(endpoint, &BTreeSet::new())?;
            }
        }
    } else {
        output::warning("any program that reaches this router commands the cells on it");
    }
    let (sender, receiver) = channel();
    signals::on_end(move || sender.send(()).unwrap_or_default())?;
    output::line(&format!(
        "router {} listens on {}",
        router.id(),
        listen.join(", ")
    ));
    let mut fails = false;
    while receiver.recv_timeout(WRITTEN) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
        let written = storage.as_deref().map_or(Ok(()), Storage::write);
        if let Err(error) = &written
            && !fails
        {
            output::warning(&format!("cannot write the retained state to disk: {error}"));
        }
        fails = written.is_err();
    }
    if let Some(storage) = &storage {
        storage
            .write()
            .context("cannot write the retained state to disk")?;
    }
    router.close()?;
    Ok(GOOD)
}
