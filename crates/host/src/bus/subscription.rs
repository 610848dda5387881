//! The Zenoh side of a subscription: samples are ordered, gaps recovered where possible, and both handed to callbacks.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::query::{ConsolidationMode, Reply, ReplyKeyExpr};
use zenoh::sample::Sample;
use zenoh::session::ZenohId;
use zenoh_ext::{
    AdvancedSubscriber, AdvancedSubscriberBuilderExt, HistoryConfig, RecoveryConfig, z_deserialize,
};

use super::gaps::{Gaps, Order};
use super::graph::lock;
use super::qos::Qos;
use super::recovery::{Action, Recovery};
use super::session::Core;
use super::types::TypeId;
use super::wire::{Attachment, EntityKind, Gid};
use super::{BusError, Lost, OnLost, OnSample, Received, wall_ns};

/// Timeout of a cache to report its last sample to a subscription that joins.
const JOIN_TIMEOUT: Duration = Duration::from_secs(2);

/// Shortest duration of a join: two heartbeats, by which publishers report their position whose cache could not be queried
/// yet.
const JOIN_AT_LEAST: Duration = Duration::from_secs(1);

/// Timeout of a query to a cache.
const QUERY_TIMEOUT: Duration = Duration::from_secs(5);

/// What receives the samples and the reports of loss.
pub(super) struct Callbacks {
    pub(super) on_sample: OnSample,
    pub(super) on_lost: OnLost,
}

/// An advanced publisher: its session and its number there.
type Source = (ZenohId, u32);

/// State of one subscription, shared with the callbacks of the transport.
pub(super) struct SubscriptionState {
    core: Weak<Core>,
    key: String,
    origin: Instant,
    callbacks: Callbacks,
    state: Mutex<State>,
}

struct State {
    /// None where nothing can be fetched, or where `zenoh-ext` fetches.
    recovery: Option<Recovery<Source, Sample>>,
    /// All reachable caches have reported their last sample.
    caches_reported: bool,
    /// Identifier of each source, and what to add to a position for the number on the wire.
    known: BTreeMap<Source, (Gid, i64)>,
    gaps: Gaps,
    /// Kept between samples for its memory.
    actions: Vec<Action<Source, Sample>>,
}

#[expect(dead_code, reason = "held for their drop")]
enum Declared {
    Plain(Subscriber<()>),
    Latched(AdvancedSubscriber<()>),
    Recovering {
        samples: Subscriber<()>,
        heartbeats: Subscriber<()>,
    },
}

pub(super) struct ZenohSubscription {
    _declared: Declared,
    _token: Option<LivelinessToken>,
    _state: Arc<SubscriptionState>,
}

impl ZenohSubscription {
    pub(super) fn declare(
        core: &Arc<Core>,
        topic: &str,
        ty: TypeId,
        qos: Qos,
        callbacks: Callbacks,
    ) -> Result<Self, BusError> {
        let recovers = qos.is_reliable() && !qos.is_latched();
        let subscription = Arc::new(SubscriptionState {
            core: Arc::downgrade(core),
            key: core.key(topic, &ty),
            origin: Instant::now(),
            callbacks,
            state: Mutex::new(State {
                recovery: recovers.then(|| Recovery::new(core.recovery_timeout)),
                caches_reported: false,
                known: BTreeMap::new(),
                gaps: Gaps::default(),
                actions: Vec::new(),
            }),
        });
        let failed = |reason| BusError::transport("declare a subscription", &reason);
        let declared = if qos.is_latched() {
            Declared::Latched(subscription.declare_latched(core, qos).map_err(failed)?)
        } else if recovers {
            core.watch(&subscription)?;
            subscription.declare_recovering(core).map_err(failed)?
        } else {
            Declared::Plain(subscription.declare_samples(core).map_err(failed)?)
        };
        let announced = core.announce_channel(EntityKind::Subscription, topic, ty, qos)?;
        Ok(Self {
            _declared: declared,
            _token: announced.token,
            _state: subscription,
        })
    }
}

impl SubscriptionState {
    fn declare_samples(self: &Arc<Self>, core: &Core) -> zenoh::Result<Subscriber<()>> {
        let subscription = Arc::clone(self);
        core.session
            .declare_subscriber(self.key.clone())
            .callback(move |sample| subscription.receive(sample, false))
            .wait()
    }

    fn declare_latched(
        self: &Arc<Self>,
        core: &Core,
        qos: Qos,
    ) -> zenoh::Result<AdvancedSubscriber<()>> {
        let subscription = Arc::clone(self);
        let history = HistoryConfig::default()
            .detect_late_publishers()
            .max_samples(qos.depth(usize::MAX));
        let mut builder = core
            .session
            .declare_subscriber(self.key.clone())
            .callback(move |sample| subscription.receive(sample, false))
            .history(history)
            .subscriber_detection();
        if qos.is_reliable() {
            builder = builder.recovery(RecoveryConfig::default().heartbeat());
        }
        builder.wait()
    }

    fn declare_recovering(self: &Arc<Self>, core: &Core) -> zenoh::Result<Declared> {
        let samples = self.declare_samples(core)?;
        let heartbeats = core
            .session
            .declare_subscriber(format!("{}/@adv/pub/**", self.key))
            .callback({
                let subscription = Arc::clone(self);
                move |sample| subscription.heartbeat(&sample)
            })
            .wait()?;
        let end = QueryEnd(Arc::clone(self), None);
        core.session
            .get(format!("{}/@adv/pub/**?_max=1", self.key))
            .consolidation(ConsolidationMode::None)
            .accept_replies(ReplyKeyExpr::Any)
            .timeout(JOIN_TIMEOUT)
            .callback(move |reply| end.0.past(&reply))
            .wait()?;
        Ok(Declared::Recovering {
            samples,
            heartbeats,
        })
    }

    /// A cache reported its newest sample from before the join.
    fn past(&self, reply: &Reply) {
        if let Some((source, position)) = reply.result().ok().and_then(source_of)
            && let Some(recovery) = &mut lock(&self.state).recovery
        {
            recovery.past(source, position);
        }
    }

    /// A sample arrived, by itself or in a reply.
    fn receive(self: &Arc<Self>, sample: Sample, is_reply: bool) {
        let Some(attachment) = attachment_of(&sample) else {
            tracing::warn!(key = %sample.key_expr(), "ignored a sample without the attachment of rmw_zenoh");
            return;
        };
        let source = source_of(&sample);
        if let Some((source, position)) = source
            && self.deliver_next(source, position, &attachment, &sample)
        {
            return;
        }
        self.step(|state, now, actions| {
            if let (Some(recovery), Some((source, position))) = (&mut state.recovery, source) {
                let offset = attachment.sequence - i64::from(position);
                state
                    .known
                    .entry(source)
                    .or_insert((attachment.gid, offset));
                recovery.sample(now, source, position, is_reply, sample, actions);
                return;
            }
            match state
                .gaps
                .classify(attachment.gid, attachment.sequence.max(0) as u64)
            {
                Order::Duplicate => return,
                Order::Consecutive => {}
                Order::AfterGap { first, count } => (self.callbacks.on_lost)(Lost {
                    publisher: attachment.gid,
                    first,
                    count,
                }),
            }
            self.deliver(&attachment, &sample);
        });
    }

    /// Delivers the sample if it is the next one and nothing is missing; false when there is more to decide.
    fn deliver_next(
        &self,
        source: Source,
        position: u32,
        attachment: &Attachment,
        sample: &Sample,
    ) -> bool {
        let mut state = lock(&self.state);
        let is_next = state
            .recovery
            .as_mut()
            .is_some_and(|recovery| recovery.is_next(source, position));
        if is_next {
            self.deliver(attachment, sample);
        }
        is_next
    }

    /// A publisher reported the position of its newest sample.
    fn heartbeat(self: &Arc<Self>, sample: &Sample) {
        let source = sample
            .key_expr()
            .as_str()
            .rsplit_once("/@adv/pub/")
            .and_then(|(_, rest)| {
                let mut parts = rest.split('/');
                Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
            });
        let position = z_deserialize::<u32>(sample.payload());
        if let (Some(source), Ok(position)) = (source, position) {
            self.step(|state, now, _| {
                if let Some(recovery) = &mut state.recovery {
                    recovery.heartbeat(now, source, position);
                }
            });
        }
    }

    pub(super) fn tick(self: &Arc<Self>) {
        self.step(|state, now, actions| {
            if let Some(recovery) = &mut state.recovery {
                if state.caches_reported && now >= JOIN_AT_LEAST {
                    recovery.joined();
                }
                if recovery.has_gap() {
                    recovery.tick(now, actions);
                }
            }
        });
    }

    /// Changes the state and carries out the actions that follow: samples are delivered under the lock, to keep their order;
    /// caches are queried outside of it, since a cache of this session replies within the call.
    fn step(
        self: &Arc<Self>,
        change: impl FnOnce(&mut State, Duration, &mut Vec<Action<Source, Sample>>),
    ) {
        let mut queries = Vec::new();
        {
            let mut state = lock(&self.state);
            let mut actions = std::mem::take(&mut state.actions);
            change(&mut state, self.origin.elapsed(), &mut actions);
            for action in actions.drain(..) {
                match action {
                    Action::Deliver(sample) => {
                        if let Some(attachment) = attachment_of(&sample) {
                            self.deliver(&attachment, &sample);
                        }
                    }
                    Action::Query { source, from } => queries.push((source, from)),
                    Action::Lost {
                        source,
                        first,
                        count,
                    } => self.report(&state, source, first, count),
                }
            }
            state.actions = actions;
        }
        for (source, from) in queries {
            self.query(source, from);
        }
    }

    fn report(&self, state: &State, source: Source, first: u64, count: u64) {
        // The identifier of a source is unknown before its first sample; rmw counts from 1.
        let (publisher, offset) = state.known.get(&source).copied().unwrap_or(([0; 16], 1));
        (self.callbacks.on_lost)(Lost {
            publisher,
            first: first.saturating_add_signed(offset),
            count,
        });
    }

    fn query(self: &Arc<Self>, source: Source, from: u64) {
        let Some(core) = self.core.upgrade() else {
            return;
        };
        let end = QueryEnd(Arc::clone(self), Some(source));
        let selector = format!(
            "{}/@adv/pub/{}/{}/**?_sn={}..",
            self.key, source.0, source.1, from as u32
        );
        let query = core
            .session
            .get(selector)
            .consolidation(ConsolidationMode::None)
            .accept_replies(ReplyKeyExpr::Any)
            .timeout(QUERY_TIMEOUT)
            .callback(move |reply| {
                if let Ok(sample) = reply.into_result() {
                    end.0.receive(sample, true);
                }
            })
            .wait();
        if let Err(reason) = query {
            tracing::warn!(%reason, "cannot query lost samples");
        }
    }

    fn deliver(&self, attachment: &Attachment, sample: &Sample) {
        (self.callbacks.on_sample)(Received {
            payload: sample.payload().to_bytes(),
            sequence: attachment.sequence.max(0) as u64,
            source_time_ns: attachment.source_time_ns,
            received_ns: wall_ns(),
            publisher: attachment.gid,
        });
    }
}

/// Dropped with the callback of a query, which is when the query has ended: that of the join (`None`) or of a source.
struct QueryEnd(Arc<SubscriptionState>, Option<Source>);

impl Drop for QueryEnd {
    fn drop(&mut self) {
        let source = self.1;
        let mut state = lock(&self.0.state);
        match (source, &mut state.recovery) {
            (Some(source), Some(recovery)) => recovery.replied(source),
            (None, _) => state.caches_reported = true,
            (Some(_), None) => {}
        }
    }
}

fn source_of(sample: &Sample) -> Option<(Source, u32)> {
    let info = sample.source_info()?;
    let id = info.source_id();
    Some(((id.zid(), id.eid()), info.source_sn()))
}

fn attachment_of(sample: &Sample) -> Option<Attachment> {
    Attachment::from_bytes(&sample.attachment()?.to_bytes())
}
