//! The router of a cell.

use std::{
    collections::BTreeSet,
    time::{Duration, Instant},
};

use anyhow::bail;
use cell::{Cell, Strangers, TransportName, policy::RECORDER, strangers};
use confinement::Confined;
use host::bus::{Bus, BusConfig, Router, RouterConfig};

use crate::{
    cell_bus::{bus_config, has_own_socket, own_socket, router_config},
    confined, output,
    own_socket::OwnSocket,
};

/// Between two looks whether a router answers.
const PERIOD: Duration = Duration::from_millis(200);
/// How long a router is given to pass an announcement on.
const PASSED_ON: Duration = Duration::from_secs(3);
/// Between two looks at the graph of nodes.
const LOOK: Duration = Duration::from_millis(20);
/// Name by which a cell finds out whether it is heard.
const PROBE: &str = "join_check";

/// The router of the cell: its own, or one that answered at its endpoint, whose place it takes when that one is gone.
pub(crate) struct Routing {
    config: Option<(RouterConfig, String)>,
    own: Option<Router>,
    socket: Option<OwnSocket>,
    /// What it opens to strangers.
    opened: BTreeSet<String>,
    looked: Instant,
}

impl Routing {
    /// Takes from the launcher what neither its router nor any process that it starts needs.
    pub(crate) fn confine(cell: &Cell, recorded: bool) -> anyhow::Result<Confined> {
        if let Some(socket) = own_socket(cell)? {
            socket.prepare()?;
        }
        confined::launcher(cell, &router_config(cell)?.listen, recorded)
    }

    /// Starts it, unless one answers.
    pub(crate) fn start(cell: &Cell) -> anyhow::Result<Self> {
        let mut routing = Self {
            config: None,
            own: None,
            socket: own_socket(cell)?,
            opened: strangers::opened(cell)?,
            looked: Instant::now(),
        };
        if cell.bus.transport == TransportName::Dds {
            return Ok(routing);
        }
        let config = router_config(cell)?;
        // A router may run there already: zenohd, rmw_zenoh's router, that of another cell, or one on another machine.
        if host::endpoint_answers(&cell.bus.router_endpoint) {
            routing.join(cell)?;
        } else {
            routing.own = Some(Router::start(&config)?);
            routing.write_opened(&cell.bus.router_endpoint)?;
        }
        routing.config = Some((config, cell.bus.router_endpoint.clone()));
        Ok(routing)
    }

    /// Uses the router of another process, if that lets this cell write, and opens what this cell needs open.
    fn join(&self, cell: &Cell) -> anyhow::Result<()> {
        let Some(socket) = &self.socket else {
            return Ok(());
        };
        let (file, endpoint) = (&cell.text().name, &cell.bus.router_endpoint);
        if !socket.answers() {
            refuse_unheard(cell)?;
            output::warning(&format!(
                "the router at {endpoint} is not of a cell of this user, and decides by itself who may write"
            ));
            return Ok(());
        }
        let opened = socket.read_opened();
        if opened.contains("**") {
            if cell.bus.strangers == Strangers::Read {
                output::warning(&format!(
                    "the cell that carries the router at {endpoint} opens it to strangers: they may command this cell, too"
                ));
            }
        } else if let Some(key) = self.opened.difference(&opened).next() {
            bail!(
                "{file}: bus.router_endpoint = {endpoint:?}: the router of the cell that runs there does not open {key} to \
                 strangers, as this cell needs: start this cell first, or choose another endpoint"
            );
        }
        Ok(())
    }

    /// Writes what the router opens, for cells that join it.
    fn write_opened(&self, endpoint: &str) -> anyhow::Result<()> {
        match &self.socket {
            Some(socket) => socket.write_opened(endpoint, &self.opened),
            None => Ok(()),
        }
    }

    /// It has just been started by this process.
    pub(crate) fn is_own(&self) -> bool {
        self.own.is_some()
    }

    /// Another process carries it.
    pub(crate) fn is_foreign(&self) -> bool {
        self.own.is_none() && self.config.is_some()
    }

    /// Takes the place of a foreign router that does not answer any more: processes that are started again need one.
    pub(crate) fn supervise(&mut self) {
        if self.own.is_some() || self.looked.elapsed() < PERIOD {
            return;
        }
        self.looked = Instant::now();
        let Some((config, endpoint)) = &self.config else {
            return;
        };
        if host::endpoint_answers(endpoint) {
            return;
        }
        // Another cell may be faster, or the endpoint lie on another machine: then there is nothing to take over.
        if let Ok(router) = Router::start(config) {
            output::remark(&format!(
                "no router answers at {endpoint} any more: this cell carries it now"
            ));
            self.own = Some(router);
            if let Err(reason) = self.write_opened(endpoint) {
                output::warning(&format!("{reason:#}"));
            }
        }
    }

    /// Stops the own one.
    pub(crate) fn close(self) -> anyhow::Result<()> {
        if let Some(router) = self.own {
            router.close()?;
        }
        Ok(())
    }
}

/// Refuses to work where this user is a stranger, who may read only.
pub(crate) fn refuse_unheard(cell: &Cell) -> anyhow::Result<()> {
    if !has_own_socket(cell)? {
        return Ok(());
    }
    let config = bus_config(cell, PROBE)?;
    let by_socket = |way: &String| way.starts_with(strangers::SOCKET);
    if config.endpoints.iter().any(by_socket) || is_heard(config, cell)? {
        return Ok(());
    }
    bail!(
        "{}: bus.router_endpoint = {:?}: the router there is of a cell of another user or host, and lets this one read only: \
         choose another endpoint, or have the cell there secured (probecell secure) and use its keys",
        cell.text().name,
        cell.bus.router_endpoint
    )
}

/// What this user announces at a router comes out of it again.
fn is_heard(mut config: BusConfig, cell: &Cell) -> anyhow::Result<bool> {
    // Two peers would hear each other past the router.
    config.zenoh["mode"] = "client".into();
    let namespace = format!("{}/{PROBE}", cell.namespace());
    // By a name that the router of a cell takes from no stranger.
    let said = Bus::open(&config, RECORDER, &namespace)?;
    let heard = Bus::open(&config, PROBE, &namespace)?;
    let name = format!("{namespace}/{RECORDER}");
    let deadline = Instant::now() + PASSED_ON;
    let mut found = false;
    while !found && Instant::now() < deadline {
        found = heard.graph().nodes().contains(&name);
        std::thread::sleep(LOOK);
    }
    for bus in [said, heard] {
        bus.close(PASSED_ON)?;
    }
    Ok(found)
}
