//! `probecell router`: a Zenoh router, so that a cell can span machines.

use std::{collections::BTreeSet, sync::mpsc::channel, time::Duration};

use anyhow::Context;
use cell::strangers;
use host::bus::{Router, RouterConfig};

use crate::{GOOD, confined, output, own_socket::OwnSocket, signals};

/// What strangers may do at the router.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Strangers {
    /// Read: only processes of the user who started the router, on the same host, write.
    Read,
    /// Write, too.
    Write,
}

/// Routes until SIGINT or SIGTERM.
pub(crate) fn run(listen: &[String], connect: &[String], to: Strangers) -> anyhow::Result<u8> {
    let mut config = RouterConfig {
        listen: listen.to_vec(),
        connect: connect.to_vec(),
        ..RouterConfig::default()
    };
    if to == Strangers::Read {
        config.zenoh["access_control"] = serde_json::to_value(strangers::read_only())?;
        for endpoint in listen {
            let socket = OwnSocket::of(endpoint).context(
                "the private socket of the router has no place: neither HOME nor XDG_STATE_HOME is set",
            )?;
            socket.prepare()?;
            // Before the network: see own_locator.
            config.listen.insert(0, socket.locator());
        }
    }
    confined::router(&config.listen)?;
    let router = Router::start(&config)?;
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
    while receiver.recv_timeout(Duration::from_secs(3600))
        == Err(std::sync::mpsc::RecvTimeoutError::Timeout)
    {}
    router.close()?;
    Ok(GOOD)
}
