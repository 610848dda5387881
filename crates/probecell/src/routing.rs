//! The router of a cell.

use std::time::{Duration, Instant};

use cell::{Cell, TransportName};
use host::bus::{Router, RouterConfig};

use crate::{cell_bus::router_config, output};

/// Between two looks whether a router answers.
const PERIOD: Duration = Duration::from_secs(1);

/// The router of the cell: its own, or one that answered at its endpoint, whose place it takes when that one is gone.
pub(crate) struct Routing {
    config: Option<(RouterConfig, String)>,
    own: Option<Router>,
    looked: Instant,
}

impl Routing {
    /// Starts it, unless one answers.
    pub(crate) fn start(cell: &Cell) -> anyhow::Result<Self> {
        let mut routing = Self {
            config: None,
            own: None,
            looked: Instant::now(),
        };
        if cell.bus.transport == TransportName::Dds {
            return Ok(routing);
        }
        let config = router_config(cell)?;
        // A router may run there already: zenohd, rmw_zenoh's router, that of another cell, or one on another machine.
        if !host::endpoint_answers(&cell.bus.router_endpoint) {
            routing.own = Some(Router::start(&config)?);
        }
        routing.config = Some((config, cell.bus.router_endpoint.clone()));
        Ok(routing)
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
