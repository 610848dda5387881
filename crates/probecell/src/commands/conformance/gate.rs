//! This end of the driver's topics: commands, plan, order and signs of life go out, and all that comes in is kept.

use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, Sender, channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use cell::Cell;
use graph::{Topic, supervision::HEARTBEAT_PERIOD, topics};
use host::{
    bus::{Bus, BusError, Graph, Lost, Publisher, Received, Subscription},
    bus_qos,
};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, GateHeartbeat, InspectionPlan,
    MeasurementOrder, Message, ProbeTrigger, from_cdr, to_cdr,
};

/// ns by which the wall clock is set back before another process of the gate is started.
const SET_BACK: u64 = 3_600_000_000_000;

/// What came from the driver.
pub(super) enum What {
    Status(Box<ControllerStatus>),
    Trigger(Box<ProbeTrigger>),
    Reply(Box<ControllerReply>),
    /// Bytes that are not of the type, and why.
    Unreadable(String),
    /// Numbers of the publisher that are missing.
    Lost(Lost),
}

/// One message, and when it came.
pub(super) struct Observation {
    /// Instant of reception, ns since 1970.
    pub(super) received: i64,
    /// Instant of publication that the publisher gives, ns since 1970.
    pub(super) source: i64,
    pub(super) topic: &'static str,
    pub(super) what: What,
}

/// The signs of life of the gate.
struct Beats {
    started: u64,
    count: u64,
    session: String,
    silent: bool,
    ended: bool,
}

/// The gate as a driver sees it.
pub(super) struct Gate {
    bus: Bus,
    namespace: String,
    commands: Publisher,
    plans: Publisher,
    orders: Publisher,
    beats: Arc<Mutex<Beats>>,
    heart: JoinHandle<()>,
    subscriptions: Vec<Subscription>,
    receiver: Receiver<Observation>,
    log: Vec<Observation>,
    next_command: u64,
    plans_made: u32,
}

impl Gate {
    /// Announces the topics of the gate, and begins to give signs of life.
    pub(super) fn join(bus: Bus, cell: &Cell) -> Result<Self, BusError> {
        let namespace = cell.namespace();
        let publisher = |topic: Topic| {
            let name = format!("{namespace}/{}", topic.name);
            bus.publisher(&name, topic.message, bus_qos(topic.qos))
        };
        let (sender, receiver) = channel();
        let subscriptions = vec![
            subscribe(
                &bus,
                &namespace,
                topics::CONTROLLER_STATUS,
                &sender,
                |one| What::Status(Box::new(one)),
            )?,
            subscribe(&bus, &namespace, topics::PROBE_TRIGGERS, &sender, |one| {
                What::Trigger(Box::new(one))
            })?,
            subscribe(
                &bus,
                &namespace,
                topics::CONTROLLER_REPLIES,
                &sender,
                |one| What::Reply(Box::new(one)),
            )?,
        ];
        let started = host::now().0.unsigned_abs();
        let beats = Arc::new(Mutex::new(Beats {
            started,
            count: 0,
            session: String::new(),
            silent: false,
            ended: false,
        }));
        let heart = beat(publisher(topics::GATE_HEARTBEAT)?, Arc::clone(&beats));
        Ok(Self {
            commands: publisher(topics::CONTROLLER_COMMANDS)?,
            plans: publisher(topics::INSPECTION_PLAN)?,
            orders: publisher(topics::MEASUREMENT_ORDER)?,
            bus,
            namespace,
            beats,
            heart,
            subscriptions,
            receiver,
            log: Vec::new(),
            next_command: started,
            plans_made: 0,
        })
    }

    /// Leaves the bus.
    pub(super) fn leave(self) -> anyhow::Result<()> {
        self.with_beats(|beats| beats.ended = true);
        drop(self.subscriptions);
        // A panic of the thread ends in silence, which the checks have seen.
        drop(self.heart.join());
        self.bus.close(Duration::from_secs(2))?;
        Ok(())
    }

    fn with_beats<T>(&self, change: impl FnOnce(&mut Beats) -> T) -> T {
        change(&mut self.beats.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Gives signs of life, or none any more.
    pub(super) fn be_silent(&self, silent: bool) {
        self.with_beats(|beats| beats.silent = silent);
    }

    /// Gives signs of life as another process does.
    pub(super) fn be_replaced(&self) {
        self.with_beats(|beats| (beats.started, beats.count) = (beats.started + 1, 0));
    }

    /// Gives signs of life as another process does whose clock was set back before it was started.
    pub(super) fn be_set_back(&self) {
        self.with_beats(|beats| (beats.started, beats.count) = (beats.started - SET_BACK, 0));
    }

    /// Absolute name of a topic.
    pub(super) fn topic(&self, topic: Topic) -> String {
        format!("{}/{}", self.namespace, topic.name)
    }

    /// The namespace of the cell.
    pub(super) fn namespace(&self) -> &str {
        &self.namespace
    }

    /// What is announced on the bus.
    pub(super) fn graph(&self) -> Graph {
        self.bus.graph()
    }

    /// Place of what comes next, in what was received.
    pub(super) fn mark(&self) -> usize {
        self.log.len()
    }

    /// What was received since a mark.
    pub(super) fn since(&self, mark: usize) -> &[Observation] {
        &self.log[mark..]
    }

    /// Samples since a mark.
    pub(super) fn samples(&self, mark: usize) -> impl Iterator<Item = &ControllerStatus> {
        self.since(mark)
            .iter()
            .filter_map(|heard| match &heard.what {
                What::Status(status) => Some(status.as_ref()),
                _ => None,
            })
    }

    /// Triggers since a mark.
    pub(super) fn triggers(&self, mark: usize) -> Vec<ProbeTrigger> {
        let heard = self.since(mark).iter();
        heard
            .filter_map(|heard| match &heard.what {
                What::Trigger(trigger) => Some(trigger.as_ref().clone()),
                _ => None,
            })
            .collect()
    }

    /// Replies to a command since a mark.
    pub(super) fn replies(&self, mark: usize, command_id: u64) -> Vec<ControllerReply> {
        let heard = self.since(mark).iter();
        heard
            .filter_map(|heard| match &heard.what {
                What::Reply(reply) if reply.command_id == command_id => {
                    Some(reply.as_ref().clone())
                }
                _ => None,
            })
            .collect()
    }

    /// How many replies each command has got so far.
    pub(super) fn counts_of_replies(&self) -> BTreeMap<u64, usize> {
        let mut counts = BTreeMap::new();
        for heard in &self.log {
            if let What::Reply(reply) = &heard.what {
                *counts.entry(reply.command_id).or_default() += 1;
            }
        }
        counts
    }

    /// The last sample.
    pub(super) fn last(&self) -> Option<&ControllerStatus> {
        self.log.iter().rev().find_map(|heard| match &heard.what {
            What::Status(status) => Some(status.as_ref()),
            _ => None,
        })
    }

    /// Session of the last sample.
    pub(super) fn session(&self) -> String {
        self.last()
            .map(|status| status.session.clone())
            .unwrap_or_default()
    }

    /// Takes what comes until `enough`, for at most `within`; whether it was enough.
    pub(super) fn receive_until(
        &mut self,
        within: Duration,
        mut enough: impl FnMut(&Self) -> bool,
    ) -> bool {
        let deadline = Instant::now() + within;
        loop {
            while let Ok(heard) = self.receiver.try_recv() {
                self.log.push(heard);
            }
            if enough(self) {
                return true;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            if let Ok(heard) = self
                .receiver
                .recv_timeout(left.min(Duration::from_millis(50)))
            {
                self.log.push(heard);
            }
            let session = self.session();
            self.with_beats(|beats| beats.session = session);
        }
    }

    /// Takes what comes for so long.
    pub(super) fn hear_for(&mut self, time: Duration) {
        self.receive_until(time, |_| false);
    }

    /// The first reply to a command since a mark, within a time.
    pub(super) fn reply(
        &mut self,
        mark: usize,
        command_id: u64,
        within: Duration,
    ) -> Option<ControllerReply> {
        self.receive_until(within, |gate| !gate.replies(mark, command_id).is_empty());
        self.replies(mark, command_id).into_iter().next()
    }

    /// Numbers a command, addresses it to the session of the driver, and sends it.
    pub(super) fn command(&mut self, command: ControllerCommand) -> ControllerCommand {
        let command = ControllerCommand {
            session: self.session(),
            ..command
        };
        self.command_as_addressed(command)
    }

    /// Numbers a command and sends it to the session that it names.
    pub(super) fn command_as_addressed(&mut self, command: ControllerCommand) -> ControllerCommand {
        let command = ControllerCommand {
            header: host::now().header(""),
            command_id: self.next_command,
            ..command
        };
        self.next_command += 1;
        self.send(&command);
        command
    }

    /// Sends a command as it is.
    pub(super) fn send(&self, command: &ControllerCommand) {
        publish(&self.commands, command);
    }

    /// Name of the next plan.
    pub(super) fn next_plan(&mut self) -> String {
        self.plans_made += 1;
        format!("conformance-{}-{}", self.next_command, self.plans_made)
    }

    /// Publishes plan and order.
    pub(super) fn publish_plan(&self, plan: &InspectionPlan, order: &MeasurementOrder) {
        publish(&self.plans, plan);
        publish(&self.orders, order);
    }
}

fn publish(publisher: &Publisher, message: &impl Message) {
    // A bus that is gone shows as a driver that does not answer.
    drop(publisher.publish(to_cdr(message), host::now().0));
}

/// The thread that gives signs of life.
fn beat(publisher: Publisher, beats: Arc<Mutex<Beats>>) -> JoinHandle<()> {
    std::thread::spawn(move || {
        loop {
            {
                let mut beats = beats.lock().unwrap_or_else(PoisonError::into_inner);
                if beats.ended {
                    return;
                }
                if !beats.silent {
                    beats.count += 1;
                    let beat = GateHeartbeat {
                        header: host::now().header(""),
                        session: beats.session.clone(),
                        started: beats.started,
                        count: beats.count,
                    };
                    publish(&publisher, &beat);
                }
            }
            std::thread::sleep(Duration::from_secs_f64(HEARTBEAT_PERIOD));
        }
    })
}

fn subscribe<M: Message>(
    bus: &Bus,
    namespace: &str,
    topic: Topic,
    sender: &Sender<Observation>,
    wrap: impl Fn(M) -> What + Send + Sync + 'static,
) -> Result<Subscription, BusError> {
    let heard = move |received: &Received<'_>, what| Observation {
        received: received.received_ns,
        source: received.source_time_ns,
        topic: topic.name,
        what,
    };
    let (samples, losses) = (sender.clone(), sender.clone());
    // The queue is gone only at the end.
    let on_sample = move |received: Received<'_>| {
        let what = match from_cdr::<M>(&received.payload) {
            Ok(message) => wrap(message),
            Err(error) => What::Unreadable(error.to_string()),
        };
        drop(samples.send(heard(&received, what)));
    };
    let on_lost = move |lost: Lost| {
        let instant = host::now().0;
        drop(losses.send(Observation {
            received: instant,
            source: instant,
            topic: topic.name,
            what: What::Lost(lost),
        }));
    };
    bus.subscribe(
        &format!("{namespace}/{}", topic.name),
        topic.message,
        bus_qos(topic.qos),
        Box::new(on_sample),
        Box::new(on_lost),
    )
}
