//! What the driver announces: types, their versions, and quality of service.

use std::time::{Duration, Instant};

use graph::topics;
use host::bus::{Durability, EntityKind, Reliability};

use super::{gate::Gate, judge::Judge};
use crate::external_driver::{Announced, PUBLISHED, announced};

/// A driver announces its topics one after the other.
const ANNOUNCEMENT: Duration = Duration::from_secs(2);

/// Waits for the driver; false when it is not there, or speaks another version.
pub(super) fn check(gate: &mut Gate, judge: &mut Judge, wait: Duration) -> bool {
    judge.begin("topics");
    let there = |gate: &Gate| {
        let graph = gate.graph();
        PUBLISHED.map(|topic| (topic, announced(&graph, gate.namespace(), topic)))
    };
    let anything = |gate: &Gate| {
        there(gate)
            .iter()
            .any(|(_, one)| *one != Announced::Nothing)
    };
    let begun = Instant::now();
    gate.receive_until(wait, anything);
    let left = ANNOUNCEMENT.min(wait.saturating_sub(begun.elapsed()).max(ANNOUNCEMENT));
    gate.receive_until(left, |gate| {
        let complete = |(_, one): &(_, Announced)| matches!(one, Announced::Publishers(_));
        there(gate).iter().all(complete)
    });
    for (topic, one) in there(gate) {
        match one {
            Announced::Nothing => judge.wrong(
                topic.name,
                format!(
                    "a publisher of {} within {} s",
                    gate.topic(topic),
                    wait.as_secs_f64()
                ),
                "none (no liveliness token on Zenoh, no writer on DDS)",
            ),
            Announced::OtherType { expected, came } => judge.wrong(topic.name, expected, came),
            Announced::Publishers(1) => {}
            Announced::Publishers(count) => {
                judge.wrong(topic.name, "one publisher", format!("{count} publishers"));
            }
        }
    }
    if judge.holds() {
        quality_of_service(gate, judge);
        subscriptions(gate, judge);
    }
    judge.end("all are announced with the types of this version")
}

/// Triggers and replies are reliable, and nothing is latched: a late joiner would take old answers for new ones.
fn quality_of_service(gate: &Gate, judge: &mut Judge) {
    for topic in PUBLISHED {
        let name = gate.topic(topic);
        for info in gate
            .graph()
            .topics()
            .iter()
            .filter(|info| info.name == name)
        {
            for qos in &info.offered {
                judge.demand(
                    qos.reliability == Reliability::Reliable,
                    &format!("{} reliability", topic.name),
                    "reliable",
                    "best effort",
                );
                judge.demand(
                    qos.durability == Durability::Volatile,
                    &format!("{} durability", topic.name),
                    "volatile",
                    "transient local",
                );
            }
        }
    }
}

/// Somebody subscribes to what the gate and path planning publish; who can do without the plan need not take it.
fn subscriptions(gate: &mut Gate, judge: &mut Judge) {
    let wanted = [
        topics::CONTROLLER_COMMANDS,
        topics::GATE_HEARTBEAT,
        topics::MEASUREMENT_ORDER,
    ];
    let missing = |gate: &Gate| {
        let graph = gate.graph();
        wanted.into_iter().find(|topic| {
            let name = gate.topic(*topic);
            !graph.entities().iter().any(|entity| {
                entity.kind == EntityKind::Subscription
                    && entity.channel.as_ref().is_some_and(|channel| {
                        let ty = host::bus::TypeId::from(topic.message);
                        channel.name == name
                            && channel.ty.dds_name() == ty.dds_name()
                            && (channel.ty.hash().is_empty() || channel.ty.hash() == ty.hash())
                    })
            })
        })
    };
    gate.receive_until(ANNOUNCEMENT, |gate| missing(gate).is_none());
    if let Some(topic) = missing(gate) {
        let expected = format!("a subscription to {} of this version", gate.topic(topic));
        judge.wrong(topic.name, expected, "none");
    }
}
