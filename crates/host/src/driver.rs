//! Runs the driver of a real controller: polls its connection and carries its messages to and from the bus.
//!
//! The process publishes and subscribes to exactly the topics of the simulated machine. It is not a node: it does I/O, makes
//! no decision and keeps no journal; a replay takes what it published as external input.

use std::{
    sync::mpsc::{RecvTimeoutError, Sender, channel},
    time::{Duration, Instant},
};

use controllers::driver::{Connection, DriverOutput};
use graph::{Topic, topics};
use probecell_msgs::{
    ControllerCommand, InspectionPlan, MeasurementOrder, Message, from_cdr, to_cdr,
};
use tracing::error;

use crate::{
    bus::{Bus, BusError, Publisher, Received, Subscription},
    topology::{bus_qos, now},
};

/// Polling period: 100 Hz, twice what the contract asks for.
const POLL: Duration = Duration::from_millis(10);
/// Timeout of the end, in which what was published is written out.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(5);

/// Topics that a driver subscribes to.
pub const SUBSCRIBED: [Topic; 3] = [
    topics::CONTROLLER_COMMANDS,
    topics::INSPECTION_PLAN,
    topics::MEASUREMENT_ORDER,
];

enum Incoming {
    Command(Box<ControllerCommand>),
    Plan(Box<InspectionPlan>),
    Order(Box<MeasurementOrder>),
}

/// Runs a connection to a controller on `bus` until `stopped` returns true.
pub fn run_driver(
    bus: Bus,
    mut driver: Box<dyn Connection>,
    namespace: &str,
    stopped: &dyn Fn() -> bool,
) -> Result<(), BusError> {
    let absolute = |topic: &Topic| format!("{namespace}/{}", topic.name);
    let publisher =
        |topic: Topic| bus.publisher(&absolute(&topic), topic.message, bus_qos(topic.qos));
    let status = publisher(topics::CONTROLLER_STATUS)?;
    let triggers = publisher(topics::PROBE_TRIGGERS)?;
    let replies = publisher(topics::CONTROLLER_REPLIES)?;
    let (sender, receiver) = channel();
    let [commands, plans, orders] = SUBSCRIBED;
    let subscriptions = [
        subscribe(&bus, namespace, commands, &sender, |message| {
            Incoming::Command(Box::new(message))
        })?,
        subscribe(&bus, namespace, plans, &sender, |message| {
            Incoming::Plan(Box::new(message))
        })?,
        subscribe(&bus, namespace, orders, &sender, |message| {
            Incoming::Order(Box::new(message))
        })?,
    ];
    let mut next = Instant::now();
    while !stopped() {
        let instant = now().0;
        for output in driver.poll(instant) {
            match output {
                DriverOutput::Status(message) => publish(&status, &message, instant)?,
                DriverOutput::Trigger(message) => publish(&triggers, &message, instant)?,
                DriverOutput::Reply(message) => publish(&replies, &message, instant)?,
            }
        }
        next = (next + POLL).max(Instant::now());
        loop {
            match receiver.recv_timeout(next.saturating_duration_since(Instant::now())) {
                Ok(Incoming::Command(command)) => driver.command(*command),
                Ok(Incoming::Plan(plan)) => driver.plan(*plan),
                Ok(Incoming::Order(order)) => driver.order(*order),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
    }
    drop(subscriptions);
    bus.close(CLOSE_TIMEOUT)
}

fn publish(publisher: &Publisher, message: &impl Message, instant: i64) -> Result<(), BusError> {
    publisher.publish(to_cdr(message), instant).map(drop)
}

fn subscribe<M: Message>(
    bus: &Bus,
    namespace: &str,
    topic: Topic,
    sender: &Sender<Incoming>,
    wrap: impl Fn(M) -> Incoming + Send + Sync + 'static,
) -> Result<Subscription, BusError> {
    let sender = sender.clone();
    let on_sample = move |received: Received<'_>| match from_cdr::<M>(&received.payload) {
        // The queue is gone only at the end, when the message is no longer needed.
        Ok(message) => drop(sender.send(wrap(message))),
        Err(refused) => error!("ignored an invalid message on {}: {refused}", topic.name),
    };
    let on_lost =
        move |lost: crate::bus::Lost| error!("lost {} messages on {}", lost.count, topic.name);
    let name = format!("{namespace}/{}", topic.name);
    bus.subscribe(
        &name,
        topic.message,
        bus_qos(topic.qos),
        Box::new(on_sample),
        Box::new(on_lost),
    )
}
