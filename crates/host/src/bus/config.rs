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
use std::time::Duration;

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
    /// The graph of nodes holds those of the node's own namespace only: what a process of a cell needs, and less to keep where
    /// many cells share a router. Zenoh only.
    pub own_namespace_only: bool,
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
            own_namespace_only: false,
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

/// Between two attempts to reach a router that is gone: at first, and at most.
const RETRY: [Duration; 2] = [Duration::from_millis(50), Duration::from_secs(1)];

impl BusConfig {
    /// Whether Zenoh takes these settings; nothing is opened.
    ///
    /// # Errors
    /// The setting that Zenoh refuses, in a sentence.
    pub fn check(&self) -> Result<(), BusError> {
        self.to_zenoh().map(drop)
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
            "transport": link(),
        });
        overlay(&mut settings, &self.zenoh);
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
        self.to_zenoh().map(drop)
    }

    pub(super) fn to_zenoh(&self) -> Result<zenoh::Config, BusError> {
        let mut settings = json!({
            "mode": "router",
            // A router of another machine may start later, hence it is looked for in the background, for ever.
            "connect": { "endpoints": self.connect, "timeout_ms": -1, "exit_on_failure": false },
            "listen": { "endpoints": self.listen, "timeout_ms": 0, "exit_on_failure": true },
            "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": true } },
            "timestamping": { "enabled": true },
            "transport": link(),
        });
        overlay(&mut settings, &self.zenoh);
        parse(&settings)
    }
}

/// How much a link takes on before it drops: half a megabyte at once, and the time in which a busy machine gets round to
/// sending. What a link that is cut costs its publishers is one such wait, since Zenoh then drops without waiting until
/// the link moves again.
fn link() -> Value {
    json!({ "link": { "tx": { "queue": {
        "size": { "data": QUEUED_BATCHES },
        "congestion_control": { "drop": { "wait_before_drop": WAIT_BEFORE_DROP.as_micros() as u64 } },
    } } } })
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

fn parse(settings: &Value) -> Result<zenoh::Config, BusError> {
    zenoh::Config::from_json5(&settings.to_string()).map_err(|reason| BusError::Config {
        reason: without_source_lines(&reason.to_string()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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
