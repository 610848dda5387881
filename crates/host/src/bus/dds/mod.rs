//! The DDS side of the bus: one participant per node, payloads passed through as they are.
//!
//! ros2-client gives the ROS names and the discovery messages (`ros_discovery_info`, so that `ros2 node list` knows
//! our nodes); endpoints are RustDDS's own. The publishers and subscriptions of ros2-client encode their messages
//! themselves, return no sequence numbers and cannot be waited on for acknowledgement, and its node brings parameter
//! services and log topics with it. Services are in [`services`].
//!
//! What DDS does not do here: type hashes (RustDDS writes no user data), shared memory, security. Discovery is by
//! multicast on the interfaces named in the configuration, loopback by default; RustDDS binds its UDP sockets to all
//! addresses even so. A reliable writer recovers losses by itself; what is gone is reported by number, from the gaps.

mod discovery;
mod payload;
pub(super) mod services;

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use futures::channel::oneshot;
use futures::future::{Either, select};
use futures::{StreamExt, pin_mut};
use rustdds::no_key::{DataWriter, DeserializedCacheChange, SimpleDataReader};
use rustdds::qos::HasQoSPolicy;
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, GUID, QosPolicies, QosPolicyBuilder, RTPSEntity,
    Topic, TopicDescription, TopicKind, WriteOptionsBuilder, policy,
};

use self::discovery::Discovery;
use self::payload::{PassThrough, Payload, nanoseconds, timestamp};
use super::config::BusConfig;
use super::gaps::{Gaps, Order};
use super::graph::{Graph, lock};
use super::qos::{History, Qos};
use super::subscription::Callbacks;
use super::types::TypeId;
use super::wire::{Gid, NodeName};
use super::{BusError, Lost, Received, wall_ns};

/// Timeout of the creation of an endpoint.
const CREATED_WITHIN: Duration = Duration::from_secs(10);

/// How long a participant stays when all that it has written is acknowledged. When a writer leaves, RustDDS (0.15.1,
/// `TopicCache::forget_reliable_writer`) hides from its readers what they have acknowledged and the application has not taken yet:
/// on a busy machine these are its last samples.
const TAKEN_WITHIN: Duration = Duration::from_secs(1);

/// How long a keep-last writer waits for room when a reader does not keep up.
const KEEP_LAST_WAIT: rustdds::Duration = rustdds::Duration::from_millis(100);

type Writer = DataWriter<Payload, PassThrough>;
type Reader = SimpleDataReader<Payload, PassThrough>;

pub(super) struct DdsBus {
    participant: DomainParticipant,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
    discovery: Arc<Discovery>,
    services: super::config::DdsServices,
    /// Samples that a keep-all history holds at most.
    keep_all_depth: usize,
    /// Writers to wait for at the end.
    writers: Mutex<Vec<Weak<Writer>>>,
    /// Endpoints are created one at a time.
    creation: Mutex<()>,
}

impl DdsBus {
    pub(super) fn open(config: &BusConfig, node: &NodeName) -> Result<Self, BusError> {
        let domain = u16::try_from(config.domain_id)
            .ok()
            .filter(|&domain| domain <= 232)
            .ok_or_else(|| BusError::Config {
                reason: format!("DDS knows no domain {}; 232 is the last", config.domain_id),
            })?;
        let failed =
            |reason: rustdds::dds::CreateError| BusError::transport("join the DDS domain", &reason);
        let participant = DomainParticipantBuilder::new(domain)
            .with_only_networks(config.dds_interfaces.iter().copied())
            .build()
            .map_err(failed)?;
        let qos = QosPolicies::builder().build();
        let publisher = participant.create_publisher(&qos).map_err(failed)?;
        let subscriber = participant.create_subscriber(&qos).map_err(failed)?;
        let discovery = Discovery::start(&participant, &publisher, &subscriber, node)?;
        Ok(Self {
            participant,
            publisher,
            subscriber,
            discovery: Arc::new(discovery),
            services: config.dds_services,
            keep_all_depth: config.keep_all_depth,
            writers: Mutex::new(Vec::new()),
            creation: Mutex::new(()),
        })
    }

    pub(super) fn publisher(
        &self,
        topic: &str,
        ty: &TypeId,
        qos: Qos,
    ) -> Result<DdsPublisher, BusError> {
        let topic = self.topic("rt", topic, "", ty.dds_name(), qos)?;
        let writer = self.writer(&topic)?;
        Ok(DdsPublisher { writer })
    }

    pub(super) fn subscribe(
        &self,
        topic: &str,
        ty: &TypeId,
        qos: Qos,
        callbacks: Callbacks,
    ) -> Result<DdsSubscription, BusError> {
        let topic = self.topic("rt", topic, "", ty.dds_name(), qos)?;
        let reader = self.reader(&topic)?;
        let mut gaps = Gaps::default();
        let reading = Reading::start(reader, move |change| {
            let publisher = change.writer_guid.to_bytes();
            let sequence = i64::from(change.sequence_number).max(0) as u64;
            match gaps.classify(publisher, sequence) {
                Order::Duplicate => return,
                Order::Consecutive => {}
                Order::AfterGap { first, count } => (callbacks.on_lost)(Lost {
                    publisher,
                    first,
                    count,
                }),
            }
            let received_ns = wall_ns();
            (callbacks.on_sample)(Received {
                source_time_ns: change.source_timestamp().map_or(received_ns, nanoseconds),
                payload: change.into_value().with_header().into(),
                sequence,
                received_ns,
                publisher,
            });
        })?;
        Ok(DdsSubscription { _reading: reading })
    }

    pub(super) fn graph(&self) -> Graph {
        self.discovery.graph(&self.participant)
    }

    pub(super) fn wait_for_subscribers(
        &self,
        publisher: &DdsPublisher,
        count: usize,
        deadline: Instant,
    ) -> bool {
        self.discovery
            .wait_for_readers(publisher.writer.guid(), count, deadline)
    }

    pub(super) fn close(self, within: Duration) -> Result<(), BusError> {
        let deadline = Instant::now() + within;
        let writers: Vec<Arc<Writer>> = (lock(&self.writers).iter())
            .filter_map(Weak::upgrade)
            .collect();
        for writer in &writers {
            let left = deadline.saturating_duration_since(Instant::now());
            let acknowledged = writer
                .wait_for_acknowledgments(left)
                .map_err(|reason| BusError::transport("wait for acknowledgements", &reason))?;
            if !acknowledged {
                return Err(BusError::Transport {
                    action: "deliver everything before closing",
                    reason: format!(
                        "a subscription has not acknowledged within {:.1} s",
                        within.as_secs_f64()
                    ),
                });
            }
        }
        if !writers.is_empty() {
            let left = deadline.saturating_duration_since(Instant::now());
            std::thread::sleep(TAKEN_WITHIN.min(left));
        }
        Ok(())
    }

    /// Topic `prefix` + `name` + `suffix`, the spelling of ROS on DDS.
    fn topic(
        &self,
        prefix: &str,
        name: &str,
        suffix: &str,
        dds_type: &str,
        qos: Qos,
    ) -> Result<Topic, BusError> {
        self.participant
            .create_topic(
                format!("{prefix}{name}{suffix}"),
                dds_type.to_owned(),
                &policies(qos, self.keep_all_depth),
                TopicKind::NoKey,
            )
            .map_err(|reason| BusError::transport("create a topic", &reason))
    }

    fn writer(&self, topic: &Topic) -> Result<Arc<Writer>, BusError> {
        let creation = lock(&self.creation);
        let watched = end_if_stuck(topic.name())?;
        let writer: Writer = self
            .publisher
            .create_datawriter_no_key(topic, None)
            .map_err(|reason| BusError::transport("create a writer", &reason))?;
        drop(watched);
        self.wait_until_met(writer.guid(), topic, true);
        drop(creation);
        self.discovery.add_writer(writer.guid())?;
        let writer = Arc::new(writer);
        let mut writers = lock(&self.writers);
        writers.retain(|writer| writer.strong_count() > 0);
        writers.push(Arc::downgrade(&writer));
        Ok(writer)
    }

    fn reader(&self, topic: &Topic) -> Result<Reader, BusError> {
        let qos = topic.qos();
        let is_limited = qos.resource_limits().is_some()
            || qos.durability() != Some(policy::Durability::Volatile);
        let waiting = (!is_limited).then(|| {
            let limits = at_most(WAITING);
            QosPolicyBuilder::new().resource_limits(limits).build()
        });
        let creation = lock(&self.creation);
        let watched = end_if_stuck(topic.name())?;
        let reader: Reader = self
            .subscriber
            .create_simple_datareader_no_key(topic, waiting)
            .map_err(|reason| BusError::transport("create a reader", &reason))?;
        drop(watched);
        self.wait_until_met(reader.guid(), topic, false);
        drop(creation);
        self.discovery.add_reader(reader.guid())?;
        Ok(reader)
    }

    fn wait_until_met(&self, own: GUID, topic: &Topic, is_writer: bool) {
        (self.discovery).wait_until_met(&self.participant, own, &topic.name(), is_writer);
    }
}

/// Ends this process, to be started anew by what supervises it, unless the creation of an endpoint returns in time: RustDDS can
/// deadlock there ([`Discovery::wait_until_met`]), and nothing but the end of the process releases its sockets. What is returned is
/// dropped after the creation.
fn end_if_stuck(topic: String) -> Result<Sender<()>, BusError> {
    let (created, waiting) = channel();
    std::thread::Builder::new()
        .name("bus watchdog".to_owned())
        .spawn(move || {
            if waiting.recv_timeout(CREATED_WITHIN) == Err(RecvTimeoutError::Timeout) {
                tracing::error!(
                    topic,
                    "RustDDS does not create an endpoint: this process ends"
                );
                std::process::exit(1);
            }
        })
        .map_err(|reason| BusError::transport("start a watchdog", &reason))?;
    Ok(created)
}

/// Samples of a volatile topic that wait at a reader until they are taken. A writer whose process was held up sends at once what has
/// come together, and the reader of a busy machine takes it later: these are ten seconds of a topic at 100 Hz.
const WAITING: usize = 1_000;

/// The policies of ROS, as its other middlewares set them. Of any history RustDDS forgets all but the last 64 samples, taken or
/// not, unless a limit says otherwise.
fn policies(qos: Qos, keep_all_depth: usize) -> QosPolicies {
    let wait = if qos.keeps_all() {
        rustdds::Duration::INFINITE
    } else {
        KEEP_LAST_WAIT
    };
    let builder = QosPolicyBuilder::new()
        .durability(if qos.is_latched() {
            policy::Durability::TransientLocal
        } else {
            policy::Durability::Volatile
        })
        .history(match qos.history {
            History::KeepLast(depth) => policy::History::KeepLast {
                depth: i32::try_from(depth).unwrap_or(i32::MAX),
            },
            History::KeepAll => policy::History::KeepAll,
        });
    let builder = if qos.keeps_all() {
        builder.resource_limits(at_most(keep_all_depth))
    } else {
        builder
    };
    let builder = match qos.lifespan {
        Some(age) => builder.lifespan(policy::Lifespan {
            duration: rustdds::Duration::from(age),
        }),
        None => builder,
    };
    if qos.is_reliable() {
        builder.reliable(wait).build()
    } else {
        builder.best_effort().build()
    }
}

fn at_most(samples: usize) -> policy::ResourceLimits {
    let samples = i32::try_from(samples.max(1)).unwrap_or(i32::MAX);
    policy::ResourceLimits {
        max_samples: samples,
        max_instances: samples,
        max_samples_per_instance: samples,
    }
}

pub(super) struct DdsPublisher {
    writer: Arc<Writer>,
}

impl DdsPublisher {
    pub(super) fn publish(&self, cdr: Vec<u8>, source_time_ns: i64) -> Result<u64, BusError> {
        let payload = Payload::from_cdr(cdr)?;
        let options = WriteOptionsBuilder::new()
            .source_timestamp(timestamp(source_time_ns))
            .build();
        self.writer
            .write_with_options(payload, options)
            .map(|identity| i64::from(identity.sequence_number).max(0) as u64)
            .map_err(|reason| BusError::transport("publish", &reason.forget_data()))
    }

    pub(super) fn gid(&self) -> Gid {
        self.writer.guid().to_bytes()
    }
}

pub(super) struct DdsSubscription {
    _reading: Reading,
}

/// A thread that takes what a reader receives, until this is dropped.
struct Reading {
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Reading {
    fn start(
        reader: Reader,
        mut take: impl FnMut(DeserializedCacheChange<Payload>) + Send + 'static,
    ) -> Result<Self, BusError> {
        let (stop, mut stopped) = oneshot::channel();
        let thread = std::thread::Builder::new()
            .name("bus reader".to_owned())
            .spawn(move || {
                futures::executor::block_on(async {
                    let changes = reader.as_async_stream();
                    pin_mut!(changes);
                    loop {
                        match select(changes.next(), &mut stopped).await {
                            Either::Left((Some(Ok(change)), _)) => take(change),
                            Either::Left((Some(Err(reason)), _)) => {
                                tracing::error!(%reason, "a DDS sample could not be read");
                            }
                            Either::Left((None, _)) | Either::Right(_) => break,
                        }
                    }
                });
            })
            .map_err(|reason| BusError::transport("start a reader's thread", &reason))?;
        Ok(Self {
            stop: Some(stop),
            thread: Some(thread),
        })
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        drop(self.stop.take());
        // A callback that drops its own subscription must not wait for itself.
        if let Some(thread) = self.thread.take()
            && thread.thread().id() != std::thread::current().id()
            && thread.join().is_err()
        {
            tracing::error!("a DDS reader has panicked");
        }
    }
}
