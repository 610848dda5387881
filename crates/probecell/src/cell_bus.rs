//! How the processes of a cell join its bus.

use std::collections::BTreeSet;
use std::path::PathBuf;

use cell::{
    Cell, TransportName,
    keys::{BusUsers, KeyError, KeyFolder},
    policy, strangers,
};
use host::{
    bus::{Bus, BusConfig, Followed, RouterConfig, Transport},
    parameters::{Declared, Parameters},
};
use nix::ifaddrs::{InterfaceAddress, getifaddrs};
use nix::net::if_::InterfaceFlags;
use probecell_msgs::rcl_interfaces::{ParameterType, ParameterValue};
use serde_json::Value;
use toml::Table;

use crate::own_socket::{COMMAND_PATIENCE, OwnSocket, PATIENCE, own_locator};

/// Messages of a topic on which none may be lost that its publisher keeps for whoever a cut link has kept from them: ten seconds of
/// events at 100 Hz, the rate at which drivers are polled, and twenty parts of the cell of the README. With these a process has all
/// the memory that it needs after a quarter of an hour.
const KEPT: usize = 1_000;

/// A failure of the running cell, as opposed to wrong input.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct CellFailure(pub(crate) String);

/// How a process of the cell joins the bus; `node` is its name there.
pub(crate) fn bus_config(cell: &Cell, node: &str) -> anyhow::Result<BusConfig> {
    refuse_exposed_dds(cell)?;
    Ok(BusConfig {
        transport: match cell.bus.transport {
            TransportName::Zenoh => Transport::Zenoh,
            TransportName::Dds => Transport::Dds,
        },
        domain_id: cell.bus.domain().map_err(anyhow::Error::msg)?,
        endpoints: vec![router_locator(cell, node)?],
        listen: cell.bus.listen.clone(),
        zenoh: session_settings(cell, node)?,
        graph: followed(cell, node),
        keep_all_depth: KEPT,
        ..BusConfig::default()
    })
}

/// Processes of the cell look for one another's topics only; the launcher of an external driver looks for that everywhere.
fn followed(cell: &Cell, node: &str) -> Followed {
    if is_supervised(cell, node) || node == policy::LAUNCHER && !cell.is_driver_external() {
        Followed::OwnTopics
    } else if node == policy::LAUNCHER {
        Followed::Topics
    } else {
        Followed::Domain
    }
}

/// How a command joins that calls services of the cell and leaves: neither announced nor following what is, so that a cell that gets
/// many commands keeps nothing of them.
pub(crate) fn visitor_config(cell: &Cell, node: &str) -> anyhow::Result<BusConfig> {
    Ok(BusConfig {
        graph: Followed::Nothing,
        announced: false,
        ..bus_config(cell, node)?
    })
}

/// It is a process that the launcher starts.
fn is_supervised(cell: &Cell, node: &str) -> bool {
    node == policy::RECORDER
        || cell.node_names().contains(&node)
        || cell.driver_process() == Some(node)
        || cell.signals_process() == Some(node)
}

/// Where a process of the cell finds the router. What only reads comes as a stranger, who may do no more.
fn router_locator(cell: &Cell, node: &str) -> anyhow::Result<String> {
    let endpoint = &cell.bus.router_endpoint;
    if node == policy::SCREEN || !has_own_socket(cell)? {
        return Ok(endpoint.clone());
    }
    let patience = if is_supervised(cell, node) {
        PATIENCE
    } else {
        COMMAND_PATIENCE
    };
    Ok(own_locator(endpoint, patience))
}

/// The router of the cell distinguishes the user's processes from strangers by a private socket: over Zenoh, where neither `probecell
/// secure` nor the cell file has another way.
pub(crate) fn has_own_socket(cell: &Cell) -> anyhow::Result<bool> {
    Ok(cell.bus.transport == TransportName::Zenoh
        && !strangers::has_own_policy(cell)
        && users(cell)?.is_none())
}

/// DDS has no access control here, and RustDDS binds its sockets to all addresses whichever interface it is told to use.
fn refuse_exposed_dds(cell: &Cell) -> anyhow::Result<()> {
    if cell.bus.transport != TransportName::Dds || cell.bus.dds_on_all_addresses {
        return Ok(());
    }
    let interfaces = interfaces_up();
    if !interfaces.is_empty() {
        anyhow::bail!(
            "{}: bus.transport = \"dds\": sockets of DDS listen on all addresses, and this machine has the interface {}, by \
             which anybody could command the cell: run it in a network namespace with lo alone, or set \
             bus.dds_on_all_addresses = true",
            cell.text().name,
            interfaces.join(", ")
        );
    }
    Ok(())
}

/// Network interfaces that are up and have an address, loopback left out.
fn interfaces_up() -> Vec<String> {
    let has_address = |one: &InterfaceAddress| {
        let address = one.address.as_ref();
        address.is_some_and(|one| one.as_sockaddr_in().is_some() || one.as_sockaddr_in6().is_some())
    };
    // One entry for each address of an interface.
    let reached = getifaddrs().into_iter().flatten().filter(|one| {
        let is_up = one.flags.contains(InterfaceFlags::IFF_UP);
        is_up && !one.flags.contains(InterfaceFlags::IFF_LOOPBACK) && has_address(one)
    });
    let names: BTreeSet<String> = reached.map(|one| one.interface_name).collect();
    names.into_iter().collect()
}

/// Zenoh settings of a session. Where the router controls access, sessions are clients, which link to nothing but the
/// router, so that no traffic bypasses it.
fn session_settings(cell: &Cell, node: &str) -> anyhow::Result<serde_json::Value> {
    if let Some(users) = users(cell)? {
        return zenoh_settings(Some(&users.session(node, cell.bus.zenoh.as_ref())));
    }
    let mut settings = zenoh_settings(cell.bus.zenoh.as_ref())?;
    let router = zenoh_settings(cell.bus.router_zenoh.as_ref())?;
    if router.get("access_control").is_some() && settings.get("mode").is_none() {
        settings["mode"] = "client".into();
    }
    Ok(settings)
}

/// Users of a cell that `probecell secure` has secured. Without a place for keys there are none.
pub(crate) fn users(cell: &Cell) -> anyhow::Result<Option<BusUsers>> {
    match KeyFolder::of(cell) {
        Ok(folder) => Ok(folder.bus_users(cell)?),
        Err(KeyError::NoHome) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn zenoh_settings(table: Option<&cell::secrets::Settings>) -> anyhow::Result<serde_json::Value> {
    Ok(table
        .map(cell::secrets::resolved)
        .transpose()?
        .map(serde_json::to_value)
        .transpose()?
        .unwrap_or_else(|| serde_json::json!({})))
}

/// The private socket of the cell's router, where it has one.
pub(crate) fn own_socket(cell: &Cell) -> anyhow::Result<Option<OwnSocket>> {
    if !has_own_socket(cell)? {
        return Ok(None);
    }
    let socket = OwnSocket::of(&cell.bus.router_endpoint);
    socket.map(Some).ok_or_else(|| {
        anyhow::anyhow!(
            "the private socket of the cell cannot be created: neither HOME nor XDG_STATE_HOME is set"
        )
    })
}

/// The router that `up` embeds.
pub(crate) fn router_config(cell: &Cell) -> anyhow::Result<RouterConfig> {
    let mut zenoh = match users(cell)? {
        Some(users) => zenoh_settings(Some(&users.router(cell)?))?,
        None => zenoh_settings(cell.bus.router_zenoh.as_ref())?,
    };
    // The socket first: see own_locator.
    let mut listen = vec![cell.bus.router_endpoint.clone()];
    if let Some(socket) = own_socket(cell)? {
        listen.insert(0, socket.locator());
        if let Some(rules) = strangers::access_control(cell)? {
            bind_strangers(&mut zenoh, &rules)?;
        }
    }
    Ok(RouterConfig {
        listen,
        connect: cell.bus.join.clone(),
        zenoh,
    })
}

/// Gives a router the rules for strangers, and the limit of their requests beside what its settings filter.
pub(crate) fn bind_strangers(zenoh: &mut Value, rules: &Table) -> anyhow::Result<()> {
    let own = zenoh.get("low_pass_filter").and_then(Value::as_array);
    let mut filters = own.cloned().unwrap_or_default();
    filters.push(serde_json::to_value(strangers::short_requests())?);
    zenoh["low_pass_filter"] = filters.into();
    zenoh["access_control"] = serde_json::to_value(rules)?;
    Ok(())
}

/// Publishes the log of this process, and serves its settings as parameters, under the name of its node.
pub(crate) fn show(bus: &Bus, cell: &Cell, node: &str) -> anyhow::Result<()> {
    let namespace = cell.namespace();
    host::rosout::publish(bus, &namespace, node)?;
    // Every ROS 2 node has it.
    let sim_time = ParameterValue {
        r#type: ParameterType::PARAMETER_BOOL,
        bool_value: host::clock::simulated().is_some(),
        ..ParameterValue::default()
    };
    let sim_time = Declared::read_only("use_sim_time", sim_time, "by `up --speed`");
    let settings = cell::parameters::of(cell, node).into_iter();
    let settings =
        settings.map(|(name, value)| Declared::read_only(&name, value, "of the cell file"));
    let parameters = Parameters(std::iter::once(sim_time).chain(settings).collect());
    Ok(host::parameters::serve(bus, &namespace, node, parameters)?)
}

/// Folder of the next recording: name of the cell and time, in the cell's recordings folder.
pub(crate) fn new_recording(cell: &Cell) -> PathBuf {
    let stamp = host::now().0 / 1_000_000;
    cell.recorder
        .folder
        .join(format!("{}_{stamp}", cell.cell.name))
}
