//! The Zenoh router of a cell, inside this process.
//!
//! It is started by the launcher, on loopback, so that a cell needs no other program installed or started; the
//! same router with wider listening addresses makes a cell span machines. It routes and, given a [`Storage`](super::Storage),
//! answers with what that keeps: no plugins, no administration space, no multicast.

use std::net::{TcpListener, ToSocketAddrs};

use serde_json::json;
use zenoh::Wait;

use super::BusError;
use super::config::{BusConfig, RouterConfig, spoken};

/// A running router; dropping it stops it.
pub struct Router {
    pub(super) session: zenoh::Session,
}

impl Router {
    /// Starts a router.
    ///
    /// # Errors
    /// [`BusError::PortTaken`] when an address is in use, stating whether a Zenoh router answers there;
    /// [`BusError::Config`] for settings that Zenoh refuses; [`BusError::Transport`] for anything else.
    pub fn start(config: &RouterConfig) -> Result<Self, BusError> {
        let settings = config.to_zenoh()?;
        spoken(&settings)?;
        match zenoh::open(settings).wait() {
            Ok(session) => Ok(Self { session }),
            Err(reason) => Err(config
                .listen
                .iter()
                .find(|endpoint| is_taken(endpoint))
                .map_or_else(
                    || BusError::transport("start the router", &reason),
                    |endpoint| BusError::PortTaken {
                        endpoint: endpoint.clone(),
                        answers: answers(endpoint),
                    },
                )),
        }
    }

    /// Zenoh identifier, in hexadecimal.
    pub fn id(&self) -> String {
        self.session.zid().to_string()
    }

    /// Stops routing and closes all links.
    ///
    /// # Errors
    /// What the transport says.
    pub fn close(self) -> Result<(), BusError> {
        self.session
            .close()
            .wait()
            .map_err(|reason| BusError::transport("close the router", &reason))
    }
}

/// The TCP address of a locator is in use.
fn is_taken(endpoint: &str) -> bool {
    let address = endpoint
        .split_once('/')
        .map_or(endpoint, |(_, address)| address);
    let address = address.split(['?', '#']).next().unwrap_or(address);
    address.to_socket_addrs().is_ok_and(|addresses| {
        addresses.into_iter().any(|address| {
            TcpListener::bind(address)
                .is_err_and(|error| error.kind() == std::io::ErrorKind::AddrInUse)
        })
    })
}

/// A Zenoh router answers at this locator.
fn answers(endpoint: &str) -> bool {
    let config = BusConfig {
        endpoints: vec![endpoint.to_owned()],
        listen: Vec::new(),
        zenoh: json!({ "mode": "client" }),
        connect_timeout: std::time::Duration::from_secs(1),
        ..BusConfig::default()
    };
    config
        .to_zenoh()
        .ok()
        .and_then(|settings| zenoh::open(settings).wait().ok())
        .is_some_and(|session| session.info().routers_zid().wait().next().is_some())
}
