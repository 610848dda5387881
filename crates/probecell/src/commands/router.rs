//! `probecell router`: a Zenoh router, so that a cell can span machines.

use std::{sync::mpsc::channel, time::Duration};

use host::bus::{Router, RouterConfig};

use crate::{GOOD, output, signals};

/// Routes until SIGINT or SIGTERM.
pub(crate) fn run(listen: &[String], connect: &[String]) -> anyhow::Result<u8> {
    let router = Router::start(&RouterConfig {
        listen: listen.to_vec(),
        connect: connect.to_vec(),
        ..RouterConfig::default()
    })?;
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
