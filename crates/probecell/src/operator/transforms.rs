//! The frames of the cell on `/tf` and `/tf_static`, which all robots of a ROS domain share: those of its own topics `tf` and
//! `tf_static`, with a prefix.

use std::sync::Mutex;

use cell::Cell;
use graph::{Topic, topics};
use host::{
    bus::{Bus, Received, Subscription},
    bus_qos,
};
use probecell_msgs::{from_cdr, tf2_msgs::TFMessage, to_cdr};

use crate::output;

/// Repeats both topics until the subscriptions are dropped.
pub(super) fn relay(bus: &Bus, cell: &Cell) -> anyhow::Result<Vec<Subscription>> {
    let prefix = cell.bus.frame_prefix.clone();
    let prefix = prefix.unwrap_or_else(|| format!("{}/", cell.cell.name));
    [(topics::TF, "/tf"), (topics::TF_STATIC, "/tf_static")]
        .into_iter()
        .map(|(topic, shared)| relay_topic(bus, cell, topic, cell.shared(shared), prefix.clone()))
        .collect()
}

fn relay_topic(
    bus: &Bus,
    cell: &Cell,
    topic: Topic,
    shared: &str,
    prefix: String,
) -> anyhow::Result<Subscription> {
    let qos = bus_qos(topic.qos);
    let publisher = Mutex::new(bus.publisher(shared, topic.message, qos)?);
    let shared = shared.to_owned();
    let on_sample = move |received: Received<'_>| {
        let Ok(mut message) = from_cdr::<TFMessage>(&received.payload) else {
            return;
        };
        for transform in &mut message.transforms {
            for frame in [
                &mut transform.header.frame_id,
                &mut transform.child_frame_id,
            ] {
                frame.insert_str(0, &prefix);
            }
        }
        let publisher = publisher.lock();
        let published =
            publisher.map(|publisher| publisher.publish(to_cdr(&message), received.source_time_ns));
        if let Ok(Err(error)) = published {
            output::remark(&format!("{shared} could not be published: {error}"));
        }
    };
    // A frame that was lost is followed by the next within 50 ms.
    let on_lost = |_| {};
    Ok(bus.subscribe(
        &cell.topic(topic.name),
        topic.message,
        qos,
        Box::new(on_sample),
        Box::new(on_lost),
    )?)
}
