//! What processes of one cell share: quality of service on the wire, and waiting for one another.

use std::{
    net::{TcpStream, ToSocketAddrs},
    time::{Duration, Instant},
};

use crate::bus::{Bus, Durability, History, Qos, Reliability, TypeId};

/// Polling period of the graph.
const PERIOD: Duration = Duration::from_millis(20);

/// Quality of service of the table of topics, as the bus takes it.
pub fn bus_qos(qos: graph::Qos) -> Qos {
    Qos {
        reliability: if qos.reliable {
            Reliability::Reliable
        } else {
            Reliability::BestEffort
        },
        durability: if qos.transient_local {
            Durability::TransientLocal
        } else {
            Durability::Volatile
        },
        history: qos
            .depth
            .map_or(History::KeepAll, |depth| History::KeepLast(depth as usize)),
        lifespan: None,
    }
}

/// Waits until each of `wanted` (absolute topic, type, number) has that many subscriptions; returns the first topic that lacks
/// one when `timeout` is over.
pub fn wait_for_subscriptions<'a>(
    bus: &Bus,
    wanted: &'a [(String, TypeId, usize)],
    timeout: Duration,
) -> Option<&'a str> {
    let deadline = Instant::now() + timeout;
    loop {
        let graph = bus.graph();
        let missing = wanted
            .iter()
            .find(|(topic, ty, count)| graph.subscriptions(topic, ty) < *count);
        match missing {
            None => return None,
            Some((topic, ..)) if Instant::now() >= deadline => return Some(topic),
            // A change of the graph has no event of its own here; this wait is bounded and happens at the start only.
            Some(_) => std::thread::sleep(PERIOD),
        }
    }
}

/// Something accepts a TCP connection at this Zenoh locator.
pub fn endpoint_answers(endpoint: &str) -> bool {
    let address = endpoint
        .split_once('/')
        .map_or(endpoint, |(_, address)| address);
    let address = address.split(['?', '#']).next().unwrap_or(address);
    let Ok(mut candidates) = address.to_socket_addrs() else {
        return false;
    };
    candidates
        .any(|candidate| TcpStream::connect_timeout(&candidate, Duration::from_millis(500)).is_ok())
}
