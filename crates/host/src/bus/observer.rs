//! Reads topics of every cell of a domain without being part of any: it publishes nothing, serves nothing and announces
//! nothing, so that no node waits for it or counts it, and a router that lets strangers only read lets it in.
//!
//! Zenoh only. One subscription per topic name covers every namespace (`<domain>/**/<name>/<type>/<hash>`), hence a cell that
//! appears needs no subscription of its own. It is a client of the router: what it reads leaves each node once, and a reader
//! that is slow holds up the router's queue to it, not a node. The session reconnects by itself when the router comes back.

use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use graph::parameters;
use probecell_msgs::{
    Service, definition_of, from_cdr, to_cdr,
    type_description_interfaces::srv::{
        GetTypeDescription, GetTypeDescriptionRequest, GetTypeDescriptionResponse,
    },
};
use zenoh::Wait;
use zenoh::key_expr::KeyExpr;
use zenoh::pubsub::Subscriber;
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::sample::{Sample, SampleKind};
use zenoh_ext::{
    AdvancedSubscriber, AdvancedSubscriberBuilderExt, HistoryConfig, RecoveryConfig,
    SampleMissListener,
};

use super::config::{BusConfig, overlay};
use super::graph::{Graph, LiveGraph};
use super::qos::Qos;
use super::services::ask;
use super::session::open_session;
use super::types::{ServiceId, TypeId};
use super::wire::{Attachment, NodeName, data_key, gid, topic_tokens, topic_tokens_in};
use super::{BusError, Received, wall_ns};

/// How long a node may take to describe a type.
const DESCRIBED: Duration = Duration::from_millis(500);

/// What to read: a topic name below any namespace, its type, and how.
#[derive(Clone, Debug)]
pub struct Observed {
    /// Name below the namespace of a cell.
    pub name: String,
    /// Its type; topics of this name with another type are not read.
    pub ty: TypeId,
    /// Latched: its history is fetched. Reliable: what a link drops is fetched late, or reported as missed. Best effort: the
    /// newest samples, as they come.
    pub qos: Qos,
}

/// Called with the absolute name of a topic and each of its samples, on threads of the transport: it must not block.
pub type OnObserved = Arc<dyn Fn(&str, Received<'_>) + Send + Sync>;

/// Called with the name of a topic as in [`Observed`], the session (hexadecimal) of the publisher, and how many samples
/// will never come.
pub type OnMissed = Arc<dyn Fn(&str, &str, u64) + Send + Sync>;

/// Called with the absolute name of a topic, a payload (CDR) that some storage keeps of it, and the stamp of that (ns since 1970).
pub type OnKept = Arc<dyn Fn(&str, &[u8], i64) + Send + Sync>;

/// A reader of every cell of a domain; dropping it ends it.
pub struct Observer {
    session: zenoh::Session,
    /// Of subscriptions to single keys ([`Observer::watch`]). Among hundreds of these, each sample of a subscription with wildcards would be
    /// compared with all of them.
    by_key: zenoh::Session,
    domain_id: u32,
    graph: LiveGraph,
    _tokens: Option<Subscriber<()>>,
    _subscriptions: Vec<Declared>,
}

/// A topic of one namespace that is read; dropping it ends that.
pub struct Watched(#[expect(dead_code, reason = "held for its drop")] Declared);

#[expect(dead_code, reason = "held for their drop")]
enum Declared {
    Plain(Subscriber<()>),
    Recovering(AdvancedSubscriber<()>, SampleMissListener<()>),
}

impl Observer {
    /// Connects to the first router of the configuration that answers.
    ///
    /// # Errors
    /// [`BusError::NoRouter`] when none answers within the connect timeout; [`BusError::Config`], [`BusError::Transport`].
    pub fn open(
        config: &BusConfig,
        observed: &[Observed],
        on_sample: &OnObserved,
        on_missed: &OnMissed,
    ) -> Result<Self, BusError> {
        let config = client(config);
        let (session, graph, tokens) = open_session(&config, Some(topic_tokens(config.domain_id)))?;
        let subscriptions = observed
            .iter()
            .map(|one| {
                let everywhere = format!("**/{}", one.name);
                KeyExpr::try_from(data_key(config.domain_id, &everywhere, &one.ty))
                    .and_then(|key| subscribe(&session, key, one, on_sample, on_missed))
                    .map_err(|reason| BusError::transport("declare a subscription", &reason))
            })
            .collect::<Result<_, _>>()?;
        let by_key = if observed.is_empty() {
            session.clone()
        } else {
            open_session(&config, None)?.0
        };
        Ok(Self {
            session,
            by_key,
            domain_id: config.domain_id,
            graph,
            _tokens: tokens,
            _subscriptions: subscriptions,
        })
    }

    /// Connects as [`Observer::open`] does, reads nothing yet, and follows what is announced in one namespace (without its first
    /// slash) only.
    ///
    /// # Errors
    /// As of [`Observer::open`].
    pub fn open_in(config: &BusConfig, namespace: &str) -> Result<Self, BusError> {
        let config = client(config);
        let tokens = topic_tokens_in(config.domain_id, &format!("/{namespace}"));
        let (session, graph, tokens) = open_session(&config, Some(tokens))?;
        Ok(Self {
            by_key: session.clone(),
            session,
            domain_id: config.domain_id,
            graph,
            _tokens: tokens,
            _subscriptions: Vec::new(),
        })
    }

    /// Reads a topic of one namespace (without its first slash) as well, until the answer is dropped.
    ///
    /// Its key is declared, so that each sample comes with the number of the key and finds its subscription by it. The declaration
    /// stays for the life of the session; reading the topic again takes the same number.
    ///
    /// # Errors
    /// [`BusError::Transport`].
    pub fn watch(
        &self,
        namespace: &str,
        observed: &Observed,
        on_sample: &OnObserved,
        on_missed: &OnMissed,
    ) -> Result<Watched, BusError> {
        let topic = format!("{namespace}/{}", observed.name);
        self.by_key
            .declare_keyexpr(data_key(self.domain_id, &topic, &observed.ty))
            .wait()
            .and_then(|key| subscribe(&self.by_key, key, observed, on_sample, on_missed))
            .map(Watched)
            .map_err(|reason| BusError::transport("declare a subscription", &reason))
    }

    /// Asks every storage of Zenoh that is reached for its latest sample of these topics, of any namespace: [`super::Storage`], or
    /// the storage manager of `zenohd`. No publisher answers. All copies of `on_kept` are dropped when all have answered, or
    /// after Zenoh's timeout for questions.
    ///
    /// # Errors
    /// [`BusError::Transport`].
    pub fn ask_kept(&self, topics: &[Observed], on_kept: &OnKept) -> Result<(), BusError> {
        for one in topics {
            let key = data_key(self.domain_id, &format!("**/{}", one.name), &one.ty);
            let on_kept = Arc::clone(on_kept);
            let asked = self
                .session
                .get(key)
                .target(QueryTarget::All)
                .consolidation(ConsolidationMode::None)
                .callback(move |reply| {
                    if let Ok(sample) = reply.result()
                        && sample.kind() == SampleKind::Put
                        && let Some(stamp) = sample.timestamp()
                        && let Some(topic) = topic_of(sample.key_expr().as_str())
                    {
                        let since_1970 = stamp.get_time().to_duration();
                        let at_ns = since_1970.as_nanos() as i64;
                        on_kept(&topic, &sample.payload().to_bytes(), at_ns);
                    }
                });
            asked
                .wait()
                .map_err(|reason| BusError::transport("ask for what is kept", &reason))?;
        }
        Ok(())
    }

    /// Waits until [`Observer::graph`] holds what was announced before this call: the router answers in order.
    ///
    /// # Errors
    /// [`BusError::Transport`].
    pub fn await_graph(&self) -> Result<(), BusError> {
        let (held, ended) = mpsc::channel::<()>();
        // A callback: what is known already answers within the call, which a bounded channel would block.
        self.session
            .liveliness()
            .get(topic_tokens(self.domain_id))
            .callback(move |_| {
                let _ = &held;
            })
            .wait()
            .map_err(|reason| BusError::transport("ask for the graph", &reason))?;
        // It ends when the callback is dropped, after the last answer.
        ended.into_iter().for_each(drop);
        Ok(())
    }

    /// The definition (`ros2msg`) of a type, of the texts that a node that uses it gives (REP 2016).
    ///
    /// # Errors
    /// [`BusError::NoServer`] or [`BusError::Timeout`] where the node describes no types; [`BusError::Refused`] where it has no
    /// text of this one; [`BusError::Transport`].
    pub fn definition_of(&self, node: &NodeName, ty: &TypeId) -> Result<String, BusError> {
        let name = format!("{}/{}", node.full(), parameters::TYPE_DESCRIPTION);
        let service = ServiceId::from(GetTypeDescription::TYPE);
        let request = GetTypeDescriptionRequest {
            type_name: ty.ros_name(),
            type_hash: ty.hash().to_owned(),
            include_type_sources: true,
        };
        let attachment = Attachment {
            sequence: wall_ns(),
            source_time_ns: wall_ns(),
            gid: gid(&self.session.zid().to_string()),
        };
        let begun = Instant::now();
        let answer = ask(
            &self.session,
            (&name, data_key(self.domain_id, &name, &service.0)),
            &to_cdr(&request),
            attachment,
            (begun, begun + DESCRIBED),
        )?;
        let refused = |reason: &str| BusError::Refused {
            name: name.clone(),
            reason: reason.to_owned(),
        };
        let answer: GetTypeDescriptionResponse =
            from_cdr(&answer).map_err(|error| refused(&error.to_string()))?;
        if !answer.successful {
            return Err(refused(&answer.failure_reason));
        }
        definition_of(&request.type_name, &answer.type_sources)
            .ok_or_else(|| refused("it has no text of the type"))
    }

    /// Publishers and subscriptions that the nodes of the domain announce.
    pub fn graph(&self) -> Graph {
        self.graph.snapshot()
    }

    /// A router is connected.
    pub fn is_connected(&self) -> bool {
        self.session.info().routers_zid().wait().next().is_some()
    }
}

/// A client of the router, which listens nowhere.
fn client(config: &BusConfig) -> BusConfig {
    let mut config = config.clone();
    overlay(
        &mut config.zenoh,
        &serde_json::json!({ "mode": "client", "listen": { "endpoints": [] } }),
    );
    config
}

fn subscribe(
    session: &zenoh::Session,
    key: KeyExpr<'static>,
    observed: &Observed,
    on_sample: &OnObserved,
    on_missed: &OnMissed,
) -> zenoh::Result<Declared> {
    let on_sample = Arc::clone(on_sample);
    let builder = session
        .declare_subscriber(key)
        .callback(move |sample| deliver(&sample, &on_sample));
    if !observed.qos.is_reliable() {
        return Ok(Declared::Plain(builder.wait()?));
    }
    let mut builder = builder
        .advanced()
        .recovery(RecoveryConfig::default().heartbeat());
    if observed.qos.is_latched() {
        builder = builder.history(
            HistoryConfig::default()
                .detect_late_publishers()
                .max_samples(observed.qos.depth(usize::MAX)),
        );
    }
    let subscriber = builder.wait()?;
    let (name, on_missed) = (observed.name.clone(), Arc::clone(on_missed));
    let misses = subscriber
        .sample_miss_listener()
        .callback(move |miss| {
            let session = miss.source().zid().to_string();
            on_missed(&name, &session, u64::from(miss.nb()));
        })
        .wait()?;
    Ok(Declared::Recovering(subscriber, misses))
}

fn deliver(sample: &Sample, on_sample: &OnObserved) {
    let attachment = sample.attachment();
    let attachment = attachment.and_then(|bytes| Attachment::from_bytes(&bytes.to_bytes()));
    // Samples of plain Zenoh programs are none of ROS.
    if let (Some(attachment), Some(topic)) = (attachment, topic_of(sample.key_expr().as_str())) {
        let received = Received {
            payload: sample.payload().to_bytes(),
            sequence: attachment.sequence.max(0) as u64,
            source_time_ns: attachment.source_time_ns,
            received_ns: wall_ns(),
            publisher: attachment.gid,
        };
        on_sample(&topic, received);
    }
}

/// The topic in a data key `<domain>/<name>/<type>/<hash>`.
pub(super) fn topic_of(key: &str) -> Option<String> {
    let (_, rest) = key.split_once('/')?;
    let (rest, _) = rest.rsplit_once('/')?;
    let (name, _) = rest.rsplit_once('/')?;
    Some(format!("/{name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_topic_of_a_key_is_what_the_key_was_made_of() {
        let ty = TypeId::new("probecell_msgs::msg::dds_::MachineState_", "RIHS01_00ff");
        for topic in ["/cell/machine_state", "/hall_2/cell/compensation/faults"] {
            assert_eq!(
                topic_of(&data_key(7, topic, &ty)).as_deref(),
                Some(topic),
                "{topic}"
            );
        }
        assert_eq!(topic_of("0/chatter"), None);
    }
}
