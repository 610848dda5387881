//! Drives a real controller: its driver polls the controller, and this process carries what it says and hears.
//!
//! The driver speaks and hears exactly the topics that the simulated machine does. It is no node: it does I/O, makes no
//! decision and keeps no journal; a replay takes what it said as external input.

use std::{
    sync::mpsc::{RecvTimeoutError, Sender, channel},
    time::{Duration, Instant},
};

use controllers::linuxcnc::{Driver, DriverOutput};
use graph::{Topic, topics};
use probecell_msgs::{
    ControllerCommand, InspectionPlan, MeasurementOrder, Message, from_cdr, to_cdr,
};
use tracing::error;

use crate::{
    bus::{Bus, BusError, Publisher, Received, Subscription},
    topology::{bus_qos, now},
};

/// Between two looks at the controller: 100 Hz, twice what the contract asks for.
const POLL: Duration = Duration::from_millis(10);
/// How long an end may take to write out what was published.
const CLOSE_PATIENCE: Duration = Duration::from_secs(5);

enum Heard {
    Command(Box<ControllerCommand>),
    Plan(Box<InspectionPlan>),
    Order(Box<MeasurementOrder>),
}

/// Runs `driver` on `bus` until `stopped` says so.
pub fn run_driver(
    bus: Bus,
    mut driver: Driver,
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
    let subscriptions = [
        hear(
            &bus,
            namespace,
            topics::CONTROLLER_COMMANDS,
            &sender,
            |message| Heard::Command(Box::new(message)),
        )?,
        hear(
            &bus,
            namespace,
            topics::INSPECTION_PLAN,
            &sender,
            |message| Heard::Plan(Box::new(message)),
        )?,
        hear(
            &bus,
            namespace,
            topics::MEASUREMENT_ORDER,
            &sender,
            |message| Heard::Order(Box::new(message)),
        )?,
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
                Ok(Heard::Command(command)) => driver.command(*command),
                Ok(Heard::Plan(plan)) => driver.plan(*plan),
                Ok(Heard::Order(order)) => driver.order(*order),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
    }
    drop(subscriptions);
    bus.close(CLOSE_PATIENCE)
}

fn publish(publisher: &Publisher, message: &impl Message, instant: i64) -> Result<(), BusError> {
    publisher.publish(to_cdr(message), instant).map(drop)
}

fn hear<M: Message>(
    bus: &Bus,
    namespace: &str,
    topic: Topic,
    sender: &Sender<Heard>,
    wrap: impl Fn(M) -> Heard + Send + Sync + 'static,
) -> Result<Subscription, BusError> {
    let sender = sender.clone();
    let on_sample = move |received: Received<'_>| match from_cdr::<M>(&received.payload) {
        // The queue outlives the subscription only at the end, when nobody needs the message any more.
        Ok(message) => drop(sender.send(wrap(message))),
        Err(refused) => error!(
            "a message on {} is not usable: {refused}: passed over",
            topic.name
        ),
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
