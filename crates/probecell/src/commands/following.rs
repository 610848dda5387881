//! What a running cell publishes, for a process that hands it on.

use std::sync::Arc;
use std::time::Duration;

use graph::Topic;
use host::bus::{BusConfig, EntityKind, Observed, Observer, OnMissed, OnObserved};
use host::bus_qos;

/// How often it is looked whether the cell is on the bus.
const PERIOD: Duration = Duration::from_millis(200);
/// Wait between two attempts to reach the router.
const AGAIN: Duration = Duration::from_secs(1);

/// Gives every message on these topics of the cell to `take`, by the name of its topic below the namespace, and five times a second
/// whether the cell is on the bus to `present`, for as long as the process runs. A router that does not answer is tried again.
pub(super) fn follow(
    bus: &BusConfig,
    cell: &str,
    topics: &[Topic],
    take: impl Fn(&str, &[u8]) + Send + Sync + 'static,
    present: impl Fn(bool),
) -> ! {
    let namespace = format!("/{cell}/");
    let on_sample: OnObserved = Arc::new(move |topic, received| {
        let name = topic.strip_prefix(&namespace).unwrap_or(topic);
        take(name, &received.payload);
    });
    let on_missed: OnMissed = Arc::new(|topic, _, count| {
        tracing::warn!(%topic, count, "messages of the cell were missed");
    });
    let observer = loop {
        match Observer::open(bus, &[], &on_sample, &on_missed) {
            Ok(observer) => break observer,
            Err(error) => {
                tracing::debug!(%error, "no router yet");
                std::thread::sleep(AGAIN);
            }
        }
    };
    let mut watched = Vec::new();
    for topic in topics {
        let observed = Observed {
            name: topic.name.to_owned(),
            ty: topic.message.into(),
            qos: bus_qos(topic.qos),
        };
        match observer.watch(cell, &observed, &on_sample, &on_missed) {
            Ok(one) => watched.push(one),
            Err(error) => tracing::error!(topic = topic.name, %error, "a topic cannot be read"),
        }
    }
    loop {
        present(is_present(&observer, cell));
        std::thread::sleep(PERIOD);
    }
}

/// Whether somebody publishes the state of the cell's machine.
fn is_present(observer: &Observer, cell: &str) -> bool {
    let topic = format!("/{cell}/{}", graph::topics::MACHINE_STATE.name);
    let graph = observer.graph();
    let mut publishers = graph
        .entities()
        .iter()
        .filter(|one| one.kind == EntityKind::Publisher);
    publishers.any(|one| {
        one.channel
            .as_ref()
            .is_some_and(|channel| channel.name == topic)
    })
}
