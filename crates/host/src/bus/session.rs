//! The Zenoh side of the bus: one session per node, its tokens, its publishers.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::sample::SampleKind;
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

use super::BusError;
use super::config::BusConfig;
use super::error::without_source_lines;
use super::graph::{Graph, LiveGraph, lock};
use super::qos::Qos;
use super::subscription::{Callbacks, SubscriptionState, ZenohSubscription};
use super::types::TypeId;
use super::wire::{Attachment, Channel, Entity, EntityKind, Gid, NodeName, data_key};

/// How often a publisher repeats its last number, so that a lost last sample is noticed; rmw_zenoh's value.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// How long a publisher stays after its last reliable message, so that whoever missed it learns so and fetches it:
/// a heartbeat, the ticks until a gap is queried, and the reply.
const LINGER: Duration = Duration::from_secs(1);

/// How often gaps are looked at.
const TICK: Duration = Duration::from_millis(100);

/// What publishers, subscriptions and services of one node share.
pub(super) struct Core {
    pub(super) session: zenoh::Session,
    pub(super) graph: LiveGraph,
    pub(super) recovery_timeout: Duration,
    node: NodeName,
    domain_id: u32,
    announced: bool,
    keep_all_depth: usize,
    next_entity: AtomicU32,
    /// When a reliable message was last published, in ms since `opened`; 0 for never.
    last_reliable_ms: Arc<AtomicU64>,
    opened: Instant,
    ticker: Mutex<Option<Sender<Weak<SubscriptionState>>>>,
}

pub(super) struct ZenohBus {
    core: Arc<Core>,
    _node_token: Option<LivelinessToken>,
    _tokens: Option<Subscriber<()>>,
}

/// A session that watches what nodes announce by these tokens, for as long as the subscriber is held.
pub(super) fn open_session(
    config: &BusConfig,
    tokens: Option<String>,
) -> Result<(zenoh::Session, LiveGraph, Option<Subscriber<()>>), BusError> {
    let settings = config.to_zenoh()?;
    super::config::spoken(&settings)?;
    let session = zenoh::open(settings)
        .wait()
        .map_err(|reason| BusError::NoRouter {
            endpoints: config.endpoints.join(", "),
            seconds: config.connect_timeout.as_secs_f64(),
            reason: without_source_lines(&reason.to_string()),
        })?;
    let graph = LiveGraph::default();
    let follow = |tokens: String| {
        let graph = graph.clone();
        session
            .liveliness()
            .declare_subscriber(tokens)
            .history(true)
            .callback(move |sample| match sample.kind() {
                SampleKind::Put => graph.add(sample.key_expr().as_str()),
                SampleKind::Delete => graph.remove(sample.key_expr().as_str()),
            })
            .wait()
            .map_err(|reason| BusError::transport("watch the graph", &reason))
    };
    let tokens = tokens.map(follow).transpose()?;
    Ok((session, graph, tokens))
}

impl ZenohBus {
    pub(super) fn open(config: &BusConfig, node: NodeName) -> Result<Self, BusError> {
        let tokens = node.tokens(config.domain_id, config.graph);
        let (session, graph, tokens) = open_session(config, tokens)?;
        let core = Core {
            session,
            graph,
            recovery_timeout: config.recovery_timeout,
            node,
            domain_id: config.domain_id,
            announced: config.announced,
            keep_all_depth: config.keep_all_depth,
            next_entity: AtomicU32::new(1),
            last_reliable_ms: Arc::default(),
            opened: Instant::now(),
            ticker: Mutex::new(None),
        };
        let node_token = core.announce(&core.entity(EntityKind::Node, 0, None))?;
        Ok(Self {
            core: Arc::new(core),
            _node_token: node_token.token,
            _tokens: tokens,
        })
    }

    pub(super) fn core(&self) -> &Arc<Core> {
        &self.core
    }

    pub(super) fn publisher(
        &self,
        topic: &str,
        ty: TypeId,
        qos: Qos,
    ) -> Result<ZenohPublisher, BusError> {
        let core = &self.core;
        let key = data_key(core.domain_id, topic, &ty);
        let failed = |reason| BusError::transport("declare a publisher", &reason);
        let reliability = if qos.is_reliable() {
            Reliability::Reliable
        } else {
            Reliability::BestEffort
        };
        let mut builder = core
            .session
            .declare_publisher(key)
            // Never block: see the module doc of the bus.
            .congestion_control(CongestionControl::Drop)
            .reliability(reliability)
            .advanced();
        if qos.is_reliable() || qos.is_latched() {
            let depth = qos.depth(core.keep_all_depth);
            let positions = MissDetectionConfig::default();
            builder = builder
                .cache(CacheConfig::default().max_samples(depth))
                .sample_miss_detection(if qos.is_reliable() {
                    positions.heartbeat(HEARTBEAT)
                } else {
                    positions
                });
        }
        if qos.is_latched() {
            builder = builder.publisher_detection();
        }
        let publisher = builder.wait().map_err(failed)?;
        let announced = core.announce_channel(EntityKind::Publisher, topic, ty.clone(), qos)?;
        Ok(ZenohPublisher {
            topic: topic.to_owned(),
            ty,
            gid: announced.gid,
            stream: Mutex::new((1, publisher)),
            opened: core.opened,
            last_reliable_ms: qos
                .is_reliable()
                .then(|| Arc::clone(&core.last_reliable_ms)),
            _token: announced.token,
        })
    }

    pub(super) fn subscribe(
        &self,
        topic: &str,
        ty: TypeId,
        qos: Qos,
        callbacks: Callbacks,
    ) -> Result<ZenohSubscription, BusError> {
        ZenohSubscription::declare(&self.core, topic, ty, qos, callbacks)
    }

    pub(super) fn graph(&self) -> Graph {
        self.core.graph.snapshot()
    }

    pub(super) fn wait_for_subscribers(
        &self,
        publisher: &ZenohPublisher,
        count: usize,
        deadline: Instant,
    ) -> bool {
        self.core.graph.wait_for(
            EntityKind::Subscription,
            &publisher.topic,
            &publisher.ty,
            count,
            deadline,
        ) && publisher.wait_for_match(count, deadline)
    }

    pub(super) fn close(self, within: Duration) -> Result<(), BusError> {
        let last = self.core.last_reliable_ms.load(Ordering::Relaxed);
        let since = self
            .core
            .opened
            .elapsed()
            .saturating_sub(Duration::from_millis(last));
        let linger = if last == 0 {
            Duration::ZERO
        } else {
            LINGER.saturating_sub(since).min(within)
        };
        std::thread::sleep(linger);
        self.core
            .session
            .close()
            .timeout(within.saturating_sub(linger))
            .wait()
            .map_err(|reason| BusError::transport("close the session", &reason))
    }
}

/// An entity that the graph shows for as long as this is held, if its session is announced.
pub(super) struct Announced {
    pub(super) gid: Gid,
    pub(super) token: Option<LivelinessToken>,
}

impl Core {
    pub(super) fn key(&self, name: &str, ty: &TypeId) -> String {
        data_key(self.domain_id, name, ty)
    }

    fn entity(&self, kind: EntityKind, number: u32, channel: Option<Channel>) -> Entity {
        Entity {
            domain_id: self.domain_id,
            session: self.session.zid().to_string(),
            node_number: 0,
            entity_number: number,
            kind,
            node: self.node.clone(),
            channel,
        }
    }

    pub(super) fn announce_channel(
        &self,
        kind: EntityKind,
        name: &str,
        ty: TypeId,
        qos: Qos,
    ) -> Result<Announced, BusError> {
        let number = self.next_entity.fetch_add(1, Ordering::Relaxed);
        let channel = Channel {
            name: name.to_owned(),
            ty,
            qos,
        };
        self.announce(&self.entity(kind, number, Some(channel)))
    }

    fn announce(&self, entity: &Entity) -> Result<Announced, BusError> {
        let declare = || {
            self.session
                .liveliness()
                .declare_token(entity.token())
                .wait()
        };
        let token = self.announced.then(declare).transpose();
        Ok(Announced {
            gid: entity.gid(),
            token: token.map_err(|reason| BusError::transport("announce an entity", &reason))?,
        })
    }

    /// Checks the gaps of `subscription` periodically.
    pub(super) fn watch(&self, subscription: &Arc<SubscriptionState>) -> Result<(), BusError> {
        let mut ticker = lock(&self.ticker);
        if ticker.is_none() {
            let (sender, subscriptions) = mpsc::channel::<Weak<SubscriptionState>>();
            std::thread::Builder::new()
                .name("bus recovery".to_owned())
                .spawn(move || {
                    let mut watched = Vec::new();
                    loop {
                        match subscriptions.recv_timeout(TICK) {
                            Ok(subscription) => watched.push(subscription),
                            Err(RecvTimeoutError::Timeout) => {
                                watched.retain(|subscription| {
                                    subscription
                                        .upgrade()
                                        .inspect(SubscriptionState::tick)
                                        .is_some()
                                });
                            }
                            Err(RecvTimeoutError::Disconnected) => break,
                        }
                    }
                })
                .map_err(|reason| BusError::transport("start the recovery thread", &reason))?;
            *ticker = Some(sender);
        }
        if let Some(sender) = &*ticker {
            sender
                .send(Arc::downgrade(subscription))
                .map_err(|reason| BusError::transport("watch a subscription", &reason))?;
        }
        Ok(())
    }
}

pub(super) struct ZenohPublisher {
    topic: String,
    ty: TypeId,
    gid: Gid,
    /// Next sequence number; one lock for both, so that numbers and positions of the cache rise together.
    stream: Mutex<(u64, AdvancedPublisher<'static>)>,
    opened: Instant,
    /// Where a reliable publisher notes the time; none for others.
    last_reliable_ms: Option<Arc<AtomicU64>>,
    _token: Option<LivelinessToken>,
}

impl ZenohPublisher {
    pub(super) fn publish(&self, cdr: Vec<u8>, source_time_ns: i64) -> Result<u64, BusError> {
        let mut stream = lock(&self.stream);
        let sequence = stream.0;
        let attachment = Attachment {
            sequence: sequence as i64,
            source_time_ns,
            gid: self.gid,
        };
        stream
            .1
            .put(cdr)
            .attachment(attachment.to_bytes())
            .wait()
            .map_err(|reason| BusError::transport("publish", &reason))?;
        stream.0 += 1;
        if let Some(last) = &self.last_reliable_ms {
            last.store(
                self.opened.elapsed().as_millis() as u64 + 1,
                Ordering::Relaxed,
            );
        }
        Ok(sequence)
    }

    /// Others announce a subscription before they declare it: waits for the declaration as well.
    fn wait_for_match(&self, count: usize, deadline: Instant) -> bool {
        let (sender, changes) = mpsc::channel();
        let listener = lock(&self.stream)
            .1
            .matching_listener()
            .callback(move |status| {
                // The wait may be over.
                sender.send(status.matching()).ok();
            })
            .wait();
        let Ok(_listener) = listener else {
            return false;
        };
        let matching = || {
            lock(&self.stream)
                .1
                .matching_status()
                .wait()
                .is_ok_and(|status| status.matching())
        };
        let mut matched = count == 0 || matching();
        while !matched {
            let left = deadline.saturating_duration_since(Instant::now());
            let Ok(change) = changes.recv_timeout(left) else {
                return false;
            };
            matched = change;
        }
        true
    }

    pub(super) fn gid(&self) -> Gid {
        self.gid
    }
}
