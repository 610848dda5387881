//! ADS of Beckhoff controllers, with the names of their symbols. The controller needs a route to this host.

use crate::{Controller, Endpoint, Protocol};

/// The protocol.
pub(crate) const PROTOCOL: Protocol = Protocol {
    scheme: "ads",
    example: "ads://10.0.0.9/10.0.0.9.1.1:851",
    controller,
};

/// TCP port of the routers of Beckhoff.
const PORT: u16 = 48898;

/// A runtime of a controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Runtime {
    /// Where its router is.
    pub host: Endpoint,
    /// AmsNetId of the controller.
    pub net_id: [u8; 6],
    /// AMS port of the runtime.
    pub port: u16,
}

/// Host, and `AmsNetId:port`, the former of six numbers.
fn controller(rest: &str) -> Option<Controller> {
    let (host, runtime) = rest.split_once('/')?;
    let (net_id, port) = runtime.split_once(':')?;
    let numbers: Option<Vec<u8>> = net_id.split('.').map(|one| one.parse().ok()).collect();
    Some(Controller::Ads(Runtime {
        host: Endpoint::of(host, PORT)?,
        net_id: numbers?.try_into().ok()?,
        port: port.parse().ok()?,
    }))
}

/// The symbol says its type itself, when it is read.
pub(crate) fn check(address: &str) -> Result<(), String> {
    let is_name = |one: char| one.is_alphanumeric() || "_.[]^,".contains(one);
    if address.is_empty() || !address.chars().all(is_name) {
        return Err(format!(
            "{address:?} is no name of a symbol, such as \"MAIN.clamped\""
        ));
    }
    Ok(())
}
