//! Settings of a bus, and the Zenoh configuration made from them.
//!
//! The defaults are those of a session of rmw_zenoh, narrowed to loopback: a peer that looks for the router at
//! `tcp/127.0.0.1:7447`, listens on loopback only, speaks no multicast and gossips. It does not stamp: caches are
//! ordered by position, the source time stands in the attachment, and Zenoh's own stamps cost both ends a clock.
//! Every setting of Zenoh (TLS, access control, user and password, links) passes through as a table laid over these
//! defaults.
//!
//! Peers of one router are taken to reach one another, hence it forwards nothing between them. A node that looks for
//! its router on another machine cannot promise that, and is a client: everything it receives comes by the router. So is a
//! node that reaches its router by a Unix socket, as the processes of a cell do: nothing that it says bypasses the router.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::time::Duration;

use confinement::Sockets;
use serde_json::{Value, json};

use super::BusError;
use super::error::without_source_lines;

/// Where the launcher's router listens unless the cell file says otherwise.
pub const ROUTER_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Transport, chosen at start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transport {
    /// Zenoh in the format of rmw_zenoh.
    #[default]
    Zenoh,
    /// DDS, as the other middlewares of ROS 2.
    Dds,
}

/// How DDS carries services; the middlewares of ROS 2 disagree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DdsServices {
    /// Identity of the request beside the payload: Fast DDS, Connext.
    #[default]
    Enhanced,
    /// Identity of the request in front of the payload: Cyclone DDS.
    Cyclone,
}

/// Announcements that the graph of a session holds. Zenoh gives the memory of one that has ended back neither in the router nor in
/// a session that follows it (some KiB each, 1.10.2), so a process that stays follows no more than it needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Followed {
    /// Everything in the domain: nodes, topics, services and their clients.
    #[default]
    Domain,
    /// Publishers and subscriptions of every namespace.
    Topics,
    /// Publishers and subscriptions of the nodes of the node's own namespace: what a process of a cell needs, and less to keep where
    /// many cells share a router.
    OwnTopics,
    /// None.
    Nothing,
}

/// How to reach the other nodes of the cell.
#[derive(Clone, Debug)]
pub struct BusConfig {
    /// Zenoh or DDS.
    pub transport: Transport,
    /// ROS domain; cells of different domains do not see one another.
    pub domain_id: u32,
    /// Routers to connect to, as Zenoh locators; DDS finds its peers itself.
    pub endpoints: Vec<String>,
    /// Where this session accepts direct connections, as Zenoh locators; not used by a client.
    pub listen: Vec<String>,
    /// Settings of Zenoh, laid over the defaults; unknown ones are refused.
    pub zenoh: Value,
    /// What the graph of nodes holds. Zenoh only.
    pub graph: Followed,
    /// The node and its endpoints are announced in the graph. What calls a service and leaves need not be; others subscribe and
    /// answer all the same. Zenoh only.
    pub announced: bool,
    /// Security enclave announced in the ROS graph.
    pub enclave: String,
    /// Samples that a keep-all history holds: a Zenoh publisher's for recovery, a DDS endpoint's before they are taken.
    pub keep_all_depth: usize,
    /// Timeout of the recovery of a gap, after which it is reported lost.
    pub recovery_timeout: Duration,
    /// How long [`super::Bus::open`] waits for a router.
    pub connect_timeout: Duration,
    /// Service mapping on DDS.
    pub dds_services: DdsServices,
    /// Addresses of the network interfaces that DDS uses.
    pub dds_interfaces: Vec<IpAddr>,
}

impl Default for BusConfig {
    fn default() -> Self {
        Self {
            transport: Transport::Zenoh,
            domain_id: 0,
            endpoints: vec![ROUTER_ENDPOINT.to_owned()],
            listen: vec!["tcp/127.0.0.1:0".to_owned()],
            zenoh: json!({}),
            graph: Followed::default(),
            announced: true,
            enclave: "/".to_owned(),
            keep_all_depth: 10_000,
            recovery_timeout: Duration::from_secs(10),
            connect_timeout: Duration::from_secs(5),
            dds_services: DdsServices::Enhanced,
            dds_interfaces: vec![IpAddr::V4(Ipv4Addr::LOCALHOST)],
        }
    }
}

/// Batches of 64 KiB that wait for one link.
const QUEUED_BATCHES: usize = 8;

/// How long a publisher waits for room on a link before the first sample is dropped.
const WAIT_BEFORE_DROP: Duration = Duration::from_millis(10);

/// Silence after which a router gives up the link to a session, and after which a session gives up that to its router. Zenoh
/// (1.10) joins a session that returns to the link that its router is about to give up, and then takes numbers of key
/// expressions for those of the former one: the router has to be done before the session tries again.
const LEASE_OF_SESSION: Duration = Duration::from_secs(10);
const LEASE_OF_ROUTER: Duration = Duration::from_secs(20);

/// Longest silence of a link that is idle.
const KEEP_ALIVE: Duration = Duration::from_millis(2500);

/// Connections to a router that have not said who they are, in which time they have to, and sessions: as many as a process may
/// have descriptors ([`crate::process::raise_limits`]).
const PENDING: usize = 16_384;
const ACCEPTED_IN: Duration = Duration::from_secs(3);
const SESSIONS: usize = 16_384;
/// Longest message that a router takes, bytes: a plan of 3,000 touches has one.
const LONGEST_MESSAGE: usize = 64 << 20;

/// Between two attempts to reach a router that is gone: at first, and at most.
const RETRY: [Duration; 2] = [Duration::from_millis(50), Duration::from_millis(200)];

impl BusConfig {
    /// Whether Zenoh takes these settings; nothing is opened.
    ///
    /// # Errors
    /// The setting that Zenoh refuses, in a sentence.
    pub fn check(&self) -> Result<(), BusError> {
        self.to_zenoh().and_then(|settings| spoken(&settings))
    }

    /// Sockets that a session opens, also when its router has gone and comes back.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn sockets(&self) -> Result<Sockets, BusError> {
        if self.transport == Transport::Dds {
            return Ok(Sockets {
                udp: true,
                ..Sockets::default()
            });
        }
        let config = self.to_zenoh()?;
        let told = |key: &str| -> Value {
            let text = config.get_json(key).unwrap_or_default();
            serde_json::from_str(&text).unwrap_or_default()
        };
        let mut endpoints = Vec::new();
        texts(&told("connect/endpoints"), &mut endpoints);
        // A peer listens, and links to whichever peers its router tells it of.
        let mut listen = Vec::new();
        texts(&told("listen/endpoints"), &mut listen);
        let is_client = told("mode") == "client" && listen.is_empty();
        let mut sockets = Sockets {
            tcp: !is_client,
            listens: !is_client,
            ports: is_client.then(Vec::new),
            ..Sockets::default()
        };
        for endpoint in &endpoints {
            let (protocol, address) = endpoint.split_once('/').unwrap_or(("", endpoint));
            if protocol == "unixsock-stream" {
                sockets.unix = true;
                continue;
            }
            let address = address.split(['?', '#']).next().unwrap_or(address);
            let (host, port) = address.rsplit_once(':').unwrap_or((address, ""));
            let host = host.trim_start_matches('[').trim_end_matches(']');
            sockets.tcp = true;
            // A name is looked up.
            sockets.udp |= host.parse::<IpAddr>().is_err() && host != "localhost";
            match (&mut sockets.ports, port.parse()) {
                (Some(ports), Ok(port)) => ports.push(port),
                (ports, _) => *ports = None,
            }
        }
        Ok(sockets)
    }

    /// Files that a session reads: keys and certificates of TLS.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut texts_of_tls = Vec::new();
        texts(&self.zenoh["transport"]["link"]["tls"], &mut texts_of_tls);
        texts_of_tls.into_iter().map(PathBuf::from).collect()
    }

    pub(super) fn to_zenoh(&self) -> Result<zenoh::Config, BusError> {
        let is_peer = self.endpoints.iter().all(|endpoint| is_loopback(endpoint));
        let listen: &[String] = if is_peer { &self.listen } else { &[] };
        let mut settings = json!({
            "mode": if is_peer { "peer" } else { "client" },
            "connect": {
                "endpoints": self.endpoints,
                "timeout_ms": self.connect_timeout.as_millis() as u64,
                "exit_on_failure": true,
                "retry": {
                    "period_init_ms": RETRY[0].as_millis() as u64,
                    "period_max_ms": RETRY[1].as_millis() as u64,
                    "period_increase_factor": 2.0,
                },
            },
            "listen": { "endpoints": listen, "exit_on_failure": true },
            "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": true } },
            "transport": link(LEASE_OF_SESSION),
        });
        overlay(&mut settings, &self.zenoh);
        // A client links to its router alone; Zenoh would listen for one as well.
        if settings["mode"] == "client" && self.zenoh.get("listen").is_none() {
            settings["listen"]["endpoints"] = json!([]);
        }
        parse(&settings)
    }
}

/// How the router of a cell is started.
#[derive(Clone, Debug)]
pub struct RouterConfig {
    /// Where it accepts sessions and other routers, as Zenoh locators.
    pub listen: Vec<String>,
    /// Routers of other machines to join.
    pub connect: Vec<String>,
    /// Settings of Zenoh, laid over the defaults; unknown ones are refused.
    pub zenoh: Value,
}

impl Default for RouterConfig {
    fn default() -> Self {
        Self {
            listen: vec![ROUTER_ENDPOINT.to_owned()],
            connect: Vec::new(),
            zenoh: json!({}),
        }
    }
}

impl RouterConfig {
    /// Whether Zenoh takes these settings; nothing is started.
    ///
    /// # Errors
    /// The setting that Zenoh refuses, in a sentence.
    pub fn check(&self) -> Result<(), BusError> {
        self.to_zenoh().and_then(|settings| spoken(&settings))
    }

    pub(super) fn to_zenoh(&self) -> Result<zenoh::Config, BusError> {
        let mut settings = json!({
            "mode": "router",
            // A router of another machine may start later, hence it is looked for in the background, for ever.
            "connect": { "endpoints": self.connect, "timeout_ms": -1, "exit_on_failure": false },
            "listen": { "endpoints": self.listen, "timeout_ms": 0, "exit_on_failure": true },
            "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": true } },
            "timestamping": { "enabled": true },
            "transport": link(LEASE_OF_ROUTER),
        });
        overlay(&mut settings, &strangers());
        overlay(&mut settings, &self.zenoh);
        parse(&settings)
    }
}

/// How much a link takes on before it drops: half a megabyte at once, and the time in which a busy machine gets round to
/// sending. What a link that is cut costs its publishers is one such wait, since Zenoh then drops without waiting until
/// the link moves again. The other side gives it up after `lease` without a word.
fn link(lease: Duration) -> Value {
    json!({ "link": { "tx": {
        "lease": lease.as_millis() as u64,
        "keep_alive": (lease.as_millis() / KEEP_ALIVE.as_millis()) as u64,
        "queue": {
            "size": { "data": QUEUED_BATCHES },
            "congestion_control": { "drop": { "wait_before_drop": WAIT_BEFORE_DROP.as_micros() as u64 } },
        },
    } } })
}

/// What strangers may take of a router: connections that have not said who they are yet, for how long each, sessions, and bytes of
/// a message. Zenoh (1.10) lets 100 connections that say nothing for ten seconds keep everybody else out, and takes messages of a
/// gigabyte.
fn strangers() -> Value {
    json!({ "transport": {
        "unicast": {
            "accept_pending": PENDING,
            "accept_timeout": ACCEPTED_IN.as_millis() as u64,
            "max_sessions": SESSIONS,
        },
        "link": { "rx": { "max_message_size": LONGEST_MESSAGE } },
    } })
}

/// The locator's address is one of this machine only.
fn is_loopback(endpoint: &str) -> bool {
    let address = endpoint
        .split_once('/')
        .map_or(endpoint, |(_, address)| address);
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost" || host.parse().is_ok_and(|host: IpAddr| host.is_loopback())
}

/// Every text in a value.
fn texts(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::String(text) => found.push(text.clone()),
        Value::Array(values) => values.iter().for_each(|one| texts(one, found)),
        Value::Object(table) => table.values().for_each(|one| texts(one, found)),
        _ => {}
    }
}

/// Lays `over` on `base`: tables are merged, everything else is replaced.
pub(super) fn overlay(base: &mut Value, over: &Value) {
    match (base, over) {
        (Value::Object(base), Value::Object(over)) => {
            for (key, value) in over {
                overlay(base.entry(key.clone()).or_insert(Value::Null), value);
            }
        }
        (base, over) => *base = over.clone(),
    }
}

/// Protocols of links that are built into this program: TLS by the feature `tls`.
const PROTOCOLS: &[&str] = if cfg!(feature = "tls") {
    &["tcp", "unixsock-stream", "tls"]
} else {
    &["tcp", "unixsock-stream"]
};

/// Refuses endpoints of a protocol that is not built in.
pub(super) fn spoken(settings: &zenoh::Config) -> Result<(), BusError> {
    let mut endpoints = Vec::new();
    for key in ["connect/endpoints", "listen/endpoints"] {
        let text = settings.get_json(key).unwrap_or_default();
        texts(
            &serde_json::from_str(&text).unwrap_or_default(),
            &mut endpoints,
        );
    }
    let protocol = |endpoint: &str| endpoint.split('/').next().unwrap_or_default().to_owned();
    let unknown = |endpoint: &&String| !PROTOCOLS.contains(&protocol(endpoint).as_str());
    let Some(endpoint) = endpoints.iter().find(unknown) else {
        return Ok(());
    };
    let reason = if protocol(endpoint) == "tls" {
        format!(
            "{endpoint}: this program is built without TLS; `cargo build --release --features tls` builds it with TLS"
        )
    } else {
        format!(
            "{endpoint}: the protocol must be one of {}",
            PROTOCOLS.join(", ")
        )
    };
    Err(BusError::Config { reason })
}

fn parse(settings: &Value) -> Result<zenoh::Config, BusError> {
    zenoh::Config::from_json5(&settings.to_string()).map_err(|reason| BusError::Config {
        reason: without_source_lines(&reason.to_string()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_protocol_that_is_not_built_in_is_refused_in_a_sentence() {
        let check = |endpoint: &str| {
            let endpoints = vec![endpoint.to_owned()];
            let config = BusConfig {
                endpoints,
                ..BusConfig::default()
            };
            config.check().map_err(|error| error.to_string())
        };
        assert_eq!(check("tcp/10.0.0.7:7447"), Ok(()));
        let quic = check("quic/10.0.0.7:7447").unwrap_err();
        assert!(
            quic.contains("quic/10.0.0.7:7447: the protocol must be one of tcp"),
            "{quic}"
        );
        let tls = check("tls/cell.example:7447");
        assert_eq!(tls.is_ok(), cfg!(feature = "tls"), "{tls:?}");
    }

    #[test]
    fn overrides_reach_zenoh_and_leave_their_neighbours() {
        let config = BusConfig {
            zenoh: json!({ "mode": "client", "scouting": { "gossip": { "enabled": false } } }),
            ..BusConfig::default()
        }
        .to_zenoh()
        .unwrap();
        assert_eq!(config.get_json("mode").unwrap(), r#""client""#);
        assert_eq!(config.get_json("scouting/gossip/enabled").unwrap(), "false");
        assert_eq!(
            config.get_json("scouting/multicast/enabled").unwrap(),
            "false"
        );
    }

    #[test]
    fn a_node_of_a_distant_router_is_a_client() {
        for (endpoint, mode) in [
            ("tcp/127.0.0.1:7447", "peer"),
            ("tls/localhost:7447", "peer"),
            ("tcp/[::1]:7447", "peer"),
            ("tcp/192.168.1.7:7447", "client"),
            ("tls/cell.example:7447", "client"),
        ] {
            let config = BusConfig {
                endpoints: vec![endpoint.to_owned()],
                ..BusConfig::default()
            }
            .to_zenoh()
            .unwrap();
            assert_eq!(
                config.get_json("mode").unwrap(),
                format!("\"{mode}\""),
                "{endpoint}"
            );
        }
    }

    #[test]
    fn sockets_are_those_of_the_links() {
        let of = |endpoint: &str, zenoh: Value| {
            let config = BusConfig {
                endpoints: vec![endpoint.to_owned()],
                zenoh,
                ..BusConfig::default()
            };
            config.sockets().unwrap()
        };
        let unix = of("unixsock-stream//run/cell.socket", json!({}));
        let expected = Sockets {
            unix: true,
            ports: Some(Vec::new()),
            ..Sockets::default()
        };
        assert_eq!(unix, expected);
        let expected = Sockets {
            tcp: true,
            ports: Some(vec![7447]),
            ..Sockets::default()
        };
        assert_eq!(of("tcp/192.168.1.7:7447", json!({})), expected);
        assert_eq!(of("tls/[::1]:7447", json!({ "mode": "client" })), expected);
        assert!(of("tls/cell.example:7447", json!({})).udp);
        let peer = of("tcp/127.0.0.1:7447", json!({}));
        assert!(peer.listens && peer.tcp && peer.ports.is_none() && !peer.unix && !peer.udp);
        // Settings of the cell file go over the defaults.
        let client = of("tcp/127.0.0.1:7447", json!({ "mode": "client" }));
        assert!(!client.listens && client.ports == Some(vec![7447]));
        let other = json!({ "mode": "client", "connect": { "endpoints": ["tcp/127.0.0.1:8000"] } });
        assert_eq!(of("tcp/127.0.0.1:7447", other).ports, Some(vec![8000]));
    }

    #[test]
    fn unknown_settings_are_refused() {
        let config = BusConfig {
            zenoh: json!({ "transprt": {} }),
            ..BusConfig::default()
        };
        assert!(matches!(config.to_zenoh(), Err(BusError::Config { .. })));
    }

    #[test]
    fn nothing_listens_beyond_loopback_by_default() {
        for config in [
            BusConfig::default().to_zenoh().unwrap(),
            RouterConfig::default().to_zenoh().unwrap(),
        ] {
            let listen = config.get_json("listen/endpoints").unwrap();
            assert!(listen.contains("tcp/127.0.0.1:"), "{listen}");
            assert!(
                !listen.contains("[::]") && !listen.contains("0.0.0.0"),
                "{listen}"
            );
        }
    }
}
