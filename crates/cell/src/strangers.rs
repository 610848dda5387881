//! What strangers may do on the bus of a cell that is not secured: a policy of Zenoh for the router that `up` carries.
//!
//! The processes of a cell, and the commands of the user who runs it, reach the router by a Unix socket in a private folder
//! of that user; everybody else comes by the network. Zenoh distinguishes the two by the protocol of the link:
//!
//! | link | may |
//! |---|---|
//! | Unix socket | everything |
//! | any other | read every topic and parameter, call `status`; publish and call what the cell file names |
//! | any other, for a robot on ROS 2 | publish the topics and serve the services and actions that `[ros2]` names |
//!
//! The policy names no cell where it can do without, so that several cells of one user share a router.

use std::collections::BTreeSet;

use graph::{parameters, topics};
use toml::{Table, Value};

use crate::{
    Cell, CellError, Strangers,
    policy::{
        self, ALL, ASKED, DRIVER, EVERYTHING, LAUNCHER, LISTEN, Policy, RECORDER, SERVE, SERVICES,
        SPEAK, TOLD,
    },
};

/// Protocol of the private socket, as Zenoh's rules and locators name it.
pub const SOCKET: &str = "unixsock-stream";
/// Every other protocol that Zenoh distinguishes.
const NETWORK: [&str; 8] = [
    "tcp", "udp", "tls", "quic", "serial", "unixpipe", "vsock", "ws",
];
/// Bytes of the longest request of a stranger that a router hands on.
const LONGEST_REQUEST: i64 = 256 << 10;
/// The process of the simulated machine, which drives in the place of `driver`.
const SIMULATOR: &str = "simulator";
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
///
/// # Errors
/// A domain that is none.
pub fn opened(cell: &Cell) -> Result<BTreeSet<String>, CellError> {
    if cell.bus.strangers == Strangers::Write {
        return Ok(BTreeSet::from(["**".to_owned()]));
    }
    let domain = cell.setting(cell.bus.domain())?;
    let names = published(cell).into_iter().chain(called(cell));
    let names = names.chain(cell.ros_endpoints().services);
    Ok(names.map(|name| key(domain, &name)).collect())
}

/// Topics that strangers publish, by their absolute names.
fn published(cell: &Cell) -> Vec<String> {
    let external = cell.is_driver_external();
    let driver = topics::ALL
        .iter()
        .filter(move |topic| external && topic.producer == DRIVER)
        .map(|topic| topic.name);
    let names = driver.chain(cell.bus.strangers_publish.iter().map(String::as_str));
    let names = names.map(|name| cell.topic(name));
    names.chain(cell.ros_endpoints().topics).collect()
}

/// Services of the cell that strangers call, by their absolute names.
fn called(cell: &Cell) -> impl Iterator<Item = String> {
    (cell.bus.strangers_call.iter()).map(|name| cell.topic(name))
}

/// Keys of an absolute name.
fn key(domain: u32, name: &str) -> String {
    format!("{domain}{name}/**")
}

/// Tokens of endpoints of that kind and absolute name. Session, node, entity, kind, enclave, namespace and name of the node
/// come before the name.
fn token(domain: u32, kind: &str, name: &str) -> String {
    let name = name.replace('/', "%");
    format!("@ros2_lv/{domain}/*/*/*/{kind}/*/*/*/{name}/**")
}

/// Names that no topic or service of the cell has are refused, and those of the cell where another is meant.
pub(crate) fn check(cell: &Cell) -> Result<(), String> {
    let machine = cell.ros_endpoints();
    let own = format!("{}/", cell.namespace());
    if let Some(name) =
        (machine.topics.iter().chain(&machine.services)).find(|name| name.starts_with(&own))
    {
        return Err(format!(
            "{}: {name:?} is a name of this cell, not of its machine",
            cell.driver.source
        ));
    }
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
///
/// # Errors
/// A domain that is none, or a setting that a node refuses.
pub fn access_control(cell: &Cell) -> Result<Option<Table>, CellError> {
    if cell.bus.strangers == Strangers::Write {
        return Ok(None);
    }
    let domain = cell.setting(cell.bus.domain())?;
    let external = cell.is_driver_external();
    let productions = policy::productions(cell)?;
    let own = productions
        .keys()
        .filter(|name| !(external && *name == DRIVER));
    let called = self::called(cell).map(|name| key(domain, &name)).collect();
    let mut spoken = Vec::new();
    for name in published(cell) {
        let data = key(domain, &name);
        spoken.push(format!("{data}/@adv/**"));
        spoken.push(data);
        spoken.push(token(domain, "MP", &name));
    }
    let services = cell.ros_endpoints().services;
    let keys = services.iter().map(|name| key(domain, name));
    let tokens = services.iter().map(|name| token(domain, "SS", name));
    let served: Vec<String> = keys.chain(tokens).collect();
    let own = own.map(String::as_str);
    Ok(Some(section(own, called, &spoken, &served)))
}

/// The section `access_control` of a router that is of no cell: strangers read, and processes of the user who started it do
/// everything.
pub fn read_only() -> Table {
    let producers = topics::ALL.iter().map(|topic| topic.producer);
    let own: BTreeSet<&str> = producers.chain([LAUNCHER, RECORDER, SIMULATOR]).collect();
    section(own.into_iter(), Vec::new(), &[], &[])
}

/// The entry of `low_pass_filter` of a router that strangers read: a request of many megabytes would hold up what comes after it
/// on the link to a node, an operator's stop too.
pub fn short_requests() -> Table {
    let rule = [
        ("link_protocols", policy::list(&NETWORK)),
        ("flows", policy::list(&["ingress"])),
        ("messages", policy::list(&["query"])),
        ("key_exprs", policy::list(&EVERYTHING)),
        ("size_limit", Value::from(LONGEST_REQUEST)),
    ];
    let rule = rule.map(|(name, value)| (name.to_owned(), value));
    rule.into_iter().collect()
}

/// `own`: names of processes that no stranger may bear; `called`, `spoken` and `served`: keys that strangers may ask, put on and
/// serve, beside `status`.
fn section<'a>(
    own: impl Iterator<Item = &'a str>,
    mut called: Vec<String>,
    spoken: &[String],
    served: &[String],
) -> Table {
    let everything = EVERYTHING.map(str::to_owned);
    let mut policy = Policy::default();
    policy.rule("everything", &["ingress", "egress"], &ALL, &everything);
    policy.rule("listen", &["ingress"], &LISTEN, &everything);
    let asked = ASKED.map(str::to_owned);
    policy.rule("fetch_late", &["ingress"], &["query"], &asked);
    policy.rule("be_told", &["egress"], &TOLD, &everything);
    // Who calls looks first whether anybody serves.
    policy.rule(
        "be_offered",
        &["egress"],
        &["declare_queryable"],
        &everything[..2],
    );
    called.insert(0, format!("*/*/{STATUS}/**"));
    called.extend(parameters::READING.map(|service| format!("*/*/*/{service}/**")));
    policy.rule("call", &["ingress"], &["query"], &called);
    // Nodes, subscriptions and clients announce themselves, under other names than those of the processes of a cell.
    let shown = ["NN", "MS", "SC"].map(|kind| format!("@ros2_lv/*/*/*/*/{kind}/**"));
    policy.rule("show_reader", &["ingress"], &["liveliness_token"], &shown);
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
    if !spoken.is_empty() {
        policy.rule("speak", &["ingress"], &SPEAK, spoken);
        policy.rule("be_asked", &["egress"], &ALL, spoken);
        rules.extend(["speak", "be_asked"]);
    }
    if !served.is_empty() {
        policy.rule("serve", &["ingress"], &SERVE, served);
        policy.rule("be_called", &["egress"], &["query"], served);
        rules.extend(["serve", "be_called"]);
    }
    policy.who("own", "link_protocols", &[SOCKET], &["everything"]);
    policy.who("stranger", "link_protocols", &NETWORK, &rules);
    policy.table()
}
