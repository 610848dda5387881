//! What strangers may do on the bus of a cell that is not secured: a policy of Zenoh for the router that `up` carries.
//!
//! The processes of a cell, and the commands of the user who runs it, reach the router by a Unix socket in a private folder
//! of that user; everybody else comes by the network. Zenoh tells the two apart by the protocol of the link:
//!
//! | link | may |
//! |---|---|
//! | Unix socket | everything |
//! | any other | read every topic, call `status`; publish and call what the cell file names |
//!
//! The policy names no cell where it can do without, so that several cells of one user share a router.

use std::collections::BTreeSet;

use graph::topics;
use toml::Table;

use crate::{
    Cell, CellError, Strangers,
    policy::{self, ALL, DRIVER, EVERYTHING, LISTEN, Policy, SERVICES, SPEAK, TOLD},
};

/// Protocol of the private socket, as Zenoh's rules and locators name it.
pub const SOCKET: &str = "unixsock-stream";
/// Every other protocol that Zenoh tells apart.
const NETWORK: [&str; 8] = [
    "tcp", "udp", "tls", "quic", "serial", "unixpipe", "vsock", "ws",
];
/// The service that changes nothing.
const STATUS: &str = "status";

/// The cell file has rules or users of its own for the router: nothing is added to them.
pub fn has_own_policy(cell: &Cell) -> bool {
    let settings = [cell.bus.zenoh.as_ref(), cell.bus.router_zenoh.as_ref()];
    settings.into_iter().flatten().any(|settings| {
        let auth = settings
            .get("transport")
            .and_then(|transport| transport.get("auth"));
        settings.contains_key("access_control") || auth.is_some()
    })
}

/// What the cell file opens to strangers beyond reading: key expressions of topics and services, `**` for everything.
pub fn opened(cell: &Cell) -> Result<BTreeSet<String>, CellError> {
    if cell.bus.strangers == Strangers::Write {
        return Ok(BTreeSet::from(["**".to_owned()]));
    }
    let domain = cell.setting(cell.bus.domain())?;
    let names = published(cell).chain(cell.bus.strangers_call.iter().map(String::as_str));
    Ok(names.map(|name| key(cell, domain, name)).collect())
}

/// Topics that strangers publish.
fn published(cell: &Cell) -> impl Iterator<Item = &str> {
    let external = cell.is_driver_external();
    let driver = topics::ALL
        .iter()
        .filter(move |topic| external && topic.producer == DRIVER)
        .map(|topic| topic.name);
    driver.chain(cell.bus.strangers_publish.iter().map(String::as_str))
}

fn key(cell: &Cell, domain: u32, name: &str) -> String {
    format!("{domain}/{}/{name}/**", cell.cell.name)
}

/// Names that no topic or service of the cell has are refused.
pub(crate) fn check(cell: &Cell) -> Result<(), String> {
    for name in &cell.bus.strangers_publish {
        if topics::by_name(name).is_none() {
            return Err(format!(
                "bus.strangers_publish: {name:?} is no topic of a cell"
            ));
        }
    }
    for name in &cell.bus.strangers_call {
        if !SERVICES.iter().any(|(service, _)| service == name) {
            let known = SERVICES.map(|(service, _)| service).join(", ");
            return Err(format!(
                "bus.strangers_call: {name:?} is no service of a cell; those are {known}"
            ));
        }
    }
    Ok(())
}

/// The section `access_control` of the router that `up` carries; none where the bus is open to strangers.
pub fn access_control(cell: &Cell) -> Result<Option<Table>, CellError> {
    if cell.bus.strangers == Strangers::Write {
        return Ok(None);
    }
    let domain = cell.setting(cell.bus.domain())?;
    let everything = EVERYTHING.map(str::to_owned);
    let mut policy = Policy::default();
    policy.rule("everything", &["ingress", "egress"], &ALL, &everything);
    policy.rule("listen", &["ingress"], &LISTEN, &everything);
    policy.rule(
        "fetch_late",
        &["ingress"],
        &["query"],
        &["**/@adv/**".to_owned()],
    );
    policy.rule("be_told", &["egress"], &TOLD, &everything);
    // Who calls looks first whether anybody serves.
    policy.rule(
        "be_offered",
        &["egress"],
        &["declare_queryable"],
        &everything[..2],
    );
    let mut called = vec![format!("*/*/{STATUS}/**")];
    called.extend((cell.bus.strangers_call.iter()).map(|name| key(cell, domain, name)));
    policy.rule("call", &["ingress"], &["query"], &called);
    // Nodes, subscriptions and clients announce themselves, under other names than those of the processes of a cell.
    let shown = ["NN", "MS", "SC"].map(|kind| format!("@ros2_lv/*/*/*/*/{kind}/**"));
    policy.rule("show_reader", &["ingress"], &["liveliness_token"], &shown);
    let external = cell.is_driver_external();
    let productions = policy::productions(cell)?;
    let own = productions
        .keys()
        .filter(|name| !(external && *name == DRIVER));
    let own: Vec<String> = own
        .map(|name| format!("@ros2_lv/*/*/*/*/*/*/*/{name}/**"))
        .collect();
    policy.deny("own_names", &["ingress"], &["liveliness_token"], &own);
    let mut rules = vec![
        "listen",
        "fetch_late",
        "be_told",
        "be_offered",
        "call",
        "show_reader",
        "own_names",
    ];
    let mut spoken = Vec::new();
    for name in published(cell) {
        let data = key(cell, domain, name);
        spoken.push(format!("{data}/@adv/**"));
        spoken.push(data);
        // Session, node, entity, kind, enclave, namespace and name of the node; then the topic.
        let topic = cell.topic(name).replace('/', "%");
        spoken.push(format!("@ros2_lv/{domain}/*/*/*/MP/*/*/*/{topic}/**"));
    }
    if !spoken.is_empty() {
        policy.rule("speak", &["ingress"], &SPEAK, &spoken);
        policy.rule("be_asked", &["egress"], &ALL, &spoken);
        rules.extend(["speak", "be_asked"]);
    }
    policy.who("own", "link_protocols", &[SOCKET], &["everything"]);
    policy.who("stranger", "link_protocols", &NETWORK, &rules);
    Ok(Some(policy.table()))
}
