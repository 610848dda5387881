//! Runs the driver of a real controller: polls its connection and carries its messages to and from the bus.
//!
//! The process publishes and subscribes to exactly the topics of the simulated machine. It is not a node: it does I/O, makes
//! no decision and keeps no journal; a replay takes what it published as external input.

use std::{
    sync::mpsc::{RecvTimeoutError, Sender, channel},
    time::{Duration, Instant},
};

use controllers::driver::{Connection, DriverOutput};
use graph::{Stamp, Topic, supervision::GateWatch, topics};
use probecell_msgs::{
    ControllerCommand, GateHeartbeat, InspectionPlan, MeasurementOrder, Message, from_cdr, to_cdr,
};
use tracing::error;

use crate::{
    bus::{Bus, BusError, Publisher, Received, Subscription, TypeId},
    clock::now,
    topology::bus_qos,
};

/// Polling period: 100 Hz, twice what the contract asks for.
const POLL: Duration = Duration::from_millis(10);
/// Polls between two looks whether the gate is still on the bus.
const LOOK: u64 = 10;
/// Polls in which a connection ends what is under way when the driver ends.
const LAST_POLLS: u32 = 20;
/// Timeout of the end, in which what was published is written out.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(5);

/// Topics that a driver subscribes to.
pub const SUBSCRIBED: [Topic; 4] = [
    topics::CONTROLLER_COMMANDS,
    topics::GATE_HEARTBEAT,
    topics::INSPECTION_PLAN,
    topics::MEASUREMENT_ORDER,
];

enum Incoming {
    Command(Box<ControllerCommand>),
    Beat(GateHeartbeat),
    Plan(Box<InspectionPlan>),
    Order(Box<MeasurementOrder>),
}

/// The topics that a driver publishes.
struct Outputs {
    status: Publisher,
    triggers: Publisher,
    replies: Publisher,
}

impl Outputs {
    fn announce(bus: &Bus, namespace: &str) -> Result<Self, BusError> {
        let publisher = |topic: Topic| {
            let name = format!("{namespace}/{}", topic.name);
            bus.publisher(&name, topic.message, bus_qos(topic.qos))
        };
        Ok(Self {
            status: publisher(topics::CONTROLLER_STATUS)?,
            triggers: publisher(topics::PROBE_TRIGGERS)?,
            replies: publisher(topics::CONTROLLER_REPLIES)?,
        })
    }

    /// Polls the connection once and publishes what it gives.
    fn poll(&self, driver: &mut dyn Connection) -> Result<(), BusError> {
        let instant = now().0;
        for output in driver.poll(instant) {
            match output {
                DriverOutput::Status(message) => publish(&self.status, &message, instant)?,
                DriverOutput::Trigger(message) => publish(&self.triggers, &message, instant)?,
                DriverOutput::Reply(message) => publish(&self.replies, &message, instant)?,
            }
        }
        Ok(())
    }
}

/// Whether `machine_state` is there: by its heartbeats, and by its announcement on the bus, which ends with its process.
struct Gate {
    watch: GateWatch,
    commands: String,
    polls: u64,
    present: bool,
}

impl Gate {
    fn new(namespace: &str) -> Self {
        Self {
            watch: GateWatch::default(),
            commands: format!("{namespace}/{}", topics::CONTROLLER_COMMANDS.name),
            polls: 0,
            present: false,
        }
    }

    /// Why nothing may go on at the machine.
    fn missing(&mut self, bus: &Bus) -> Option<&'static str> {
        self.polls += 1;
        if self.polls.is_multiple_of(LOOK) {
            let ty = TypeId::from(topics::CONTROLLER_COMMANDS.message);
            let was = self.present;
            self.present = bus.graph().publishers(&self.commands, &ty) > 0;
            if was && !self.present {
                return Some("machine_state has left the bus");
            }
        }
        let silent = self.watch.is_silent(now());
        silent.then_some("machine_state has fallen silent")
    }
}

/// Runs a connection to a controller on `bus` until `stopped` returns true. What is under way at the machine ends when
/// `machine_state` is no longer there, and with this process.
///
/// # Errors
/// What the bus says.
pub fn run_driver(
    bus: Bus,
    mut driver: Box<dyn Connection>,
    namespace: &str,
    stopped: &dyn Fn() -> bool,
) -> Result<(), BusError> {
    let outputs = Outputs::announce(&bus, namespace)?;
    let (sender, receiver) = channel();
    let [commands, beats, plans, orders] = SUBSCRIBED;
    let subscriptions = [
        subscribe(&bus, namespace, commands, &sender, |message| {
            Incoming::Command(Box::new(message))
        })?,
        subscribe(&bus, namespace, beats, &sender, Incoming::Beat)?,
        subscribe(&bus, namespace, plans, &sender, |message| {
            Incoming::Plan(Box::new(message))
        })?,
        subscribe(&bus, namespace, orders, &sender, |message| {
            Incoming::Order(Box::new(message))
        })?,
    ];
    let mut gate = Gate::new(namespace);
    let mut next = Instant::now();
    while !stopped() {
        if let Some(why) = gate.missing(&bus) {
            driver.inbox().stop = Some(why.to_owned());
        }
        outputs.poll(driver.as_mut())?;
        next = (next + POLL).max(Instant::now());
        loop {
            match receiver.recv_timeout(next.saturating_duration_since(Instant::now())) {
                Ok(Incoming::Command(command)) => {
                    gate.watch.command(now());
                    gate.present = true;
                    driver.inbox().commands.push_back(*command);
                }
                Ok(Incoming::Beat(beat)) => take_beat(&mut gate, driver.as_mut(), now(), &beat),
                Ok(Incoming::Plan(plan)) => driver.inbox().plan = Some(*plan),
                Ok(Incoming::Order(order)) => driver.inbox().order = Some(*order),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
    }
    drop(subscriptions);
    driver.inbox().stop = Some("the driver was ended".to_owned());
    for _ in 0..LAST_POLLS {
        outputs.poll(driver.as_mut())?;
    }
    bus.close(CLOSE_TIMEOUT)
}

fn take_beat(gate: &mut Gate, driver: &mut dyn Connection, now: Stamp, beat: &GateHeartbeat) {
    if gate.watch.beat(now, beat) {
        let why = "machine_state is another process than before";
        driver.inbox().stop = Some(why.to_owned());
    }
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
