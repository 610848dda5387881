//! Tells DDS which node our endpoints belong to, reads the same from others (`ros_discovery_info`), and knows who has
//! found whom.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use futures::channel::oneshot;
use futures::future::{Either, select};
use futures::{StreamExt, pin_mut, stream};
use ros2_client::builtin_topics::ros_discovery;
use ros2_client::entities_info::{NodeEntitiesInfo, ParticipantEntitiesInfo};
use rustdds::no_key::{DataWriterCdr, SimpleDataReaderCdr};
use rustdds::{
    DomainParticipant, DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID,
    QosPolicies, RTPSEntity, StatusEvented, TopicKind, policy,
};

use super::super::BusError;
use super::super::graph::{Graph, lock};
use super::super::qos::{Durability, History, Qos, Reliability};
use super::super::types::TypeId;
use super::super::wire::{Channel, Entity, EntityKind, Gid, NodeName};

/// First 12 bytes of every identifier of one participant.
type Prefix = [u8; 12];

/// A writer learns that it has found a reader, but not that the reader has found the writer, and a volatile reader
/// takes what was written before that as past. Both find each other by the same exchange, hence a match counts only
/// after this time.
const MUTUAL_AFTER: Duration = Duration::from_millis(200);

/// How long a new endpoint waits for those that others have announced on its topic.
const MATCHED_WITHIN: Duration = Duration::from_secs(1);

/// Discovery that has had no news for so long since an endpoint was created is taken to have dealt with it: RustDDS does not tell.
const QUIET: Duration = Duration::from_millis(20);

/// What other participants have announced, and what this one has matched.
#[derive(Default)]
struct Known {
    /// Nodes of each participant.
    nodes: Mutex<BTreeMap<Prefix, Vec<NodeName>>>,
    matches: Mutex<Matches>,
    changed: Condvar,
}

/// Who has found whom, and since when.
#[derive(Default)]
struct Matches {
    /// Readers of each of our writers.
    readers: BTreeMap<GUID, BTreeMap<GUID, Instant>>,
    /// Writers of each of our readers.
    writers: BTreeMap<GUID, BTreeSet<GUID>>,
    /// One of ours and one of another participant whose policies do not fit each other.
    incompatible: BTreeSet<(GUID, GUID)>,
    /// When discovery last had news of any kind.
    last: Option<Instant>,
}

impl Matches {
    /// Our endpoint has been compared with that of another participant.
    fn have_met(&self, own: GUID, other: GUID) -> bool {
        let readers = self.readers.get(&own);
        let writers = self.writers.get(&own);
        readers.is_some_and(|readers| readers.contains_key(&other))
            || writers.is_some_and(|writers| writers.contains(&other))
            || self.incompatible.contains(&(own, other))
    }
}

/// Answer to the question whether what is waited for is there.
enum Readiness {
    Ready,
    At(Instant),
    Unknown,
}

pub(super) struct Discovery {
    participant: GUID,
    domain_id: u32,
    own: Mutex<NodeEntitiesInfo>,
    writer: DataWriterCdr<ParticipantEntitiesInfo>,
    known: Arc<Known>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Discovery {
    pub(super) fn start(
        participant: &DomainParticipant,
        publisher: &rustdds::Publisher,
        subscriber: &rustdds::Subscriber,
        node: &NodeName,
    ) -> Result<Self, BusError> {
        let failed =
            |reason: rustdds::dds::CreateError| BusError::transport("join ROS discovery", &reason);
        let name = ros2_client::NodeName::new(&node.namespace, &node.name)
            .map_err(|_| BusError::Name { name: node.full() })?;
        let qos: &QosPolicies = &ros_discovery::QOS_PUB;
        let topic = participant
            .create_topic(
                ros_discovery::TOPIC_NAME.to_owned(),
                ros_discovery::TYPE_NAME.to_owned(),
                qos,
                TopicKind::NoKey,
            )
            .map_err(failed)?;
        let writer = publisher
            .create_datawriter_no_key_cdr(&topic, None)
            .map_err(failed)?;
        let reader: SimpleDataReaderCdr<ParticipantEntitiesInfo> = subscriber
            .create_simple_datareader_no_key(&topic, None)
            .map_err(failed)?;
        let known = Arc::new(Known::default());
        let statuses = participant.status_listener();
        let (stop, stopped) = oneshot::channel();
        let thread = std::thread::Builder::new()
            .name("bus discovery".to_owned())
            .spawn({
                let known = Arc::clone(&known);
                move || futures::executor::block_on(watch(&reader, &statuses, stopped, &known))
            })
            .map_err(|reason| BusError::transport("start the discovery thread", &reason))?;
        let discovery = Self {
            participant: participant.guid(),
            domain_id: u32::from(participant.domain_id()),
            own: Mutex::new(NodeEntitiesInfo::new(name)),
            writer,
            known,
            stop: Some(stop),
            thread: Some(thread),
        };
        discovery.announce(&lock(&discovery.own))?;
        Ok(discovery)
    }

    /// Another writer belongs to our node.
    pub(super) fn add_writer(&self, guid: GUID) -> Result<(), BusError> {
        let mut own = lock(&self.own);
        own.add_writer(guid.into());
        self.announce(&own)
    }

    /// Another reader belongs to our node.
    pub(super) fn add_reader(&self, guid: GUID) -> Result<(), BusError> {
        let mut own = lock(&self.own);
        own.add_reader(guid.into());
        self.announce(&own)
    }

    fn announce(&self, own: &NodeEntitiesInfo) -> Result<(), BusError> {
        let info = ParticipantEntitiesInfo::new(self.participant.into(), vec![own.clone()]);
        self.writer
            .write(info, Some(rustdds::Timestamp::now()))
            .map_err(|reason| BusError::transport("announce the endpoints", &reason.forget_data()))
    }

    /// Waits until a new writer or reader of a topic has met the readers or writers that others have announced on it, and
    /// discovery is quiet.
    ///
    /// Only then the next endpoint is created. The discovery thread of RustDDS (0.15.1, `add_local_writer` and `add_local_reader`)
    /// holds its database for reading while it hands those of the topic, one by one, to the event loop through a queue of 32. Where
    /// that queue is full, the event loop asks for the database too, and an application thread waits to write to it, all three wait for
    /// ever. Waiting here makes this improbable, not impossible.
    pub(super) fn wait_until_met(
        &self,
        participant: &DomainParticipant,
        own: GUID,
        topic: &str,
        is_writer: bool,
    ) {
        let created = Instant::now();
        let deadline = created + MATCHED_WITHIN;
        loop {
            let announced = self.announced(participant, topic, is_writer);
            let settled = self.wait(deadline, |matches| {
                if announced.iter().all(|other| matches.have_met(own, *other)) {
                    let last = matches.last.map_or(created, |last| last.max(created));
                    Readiness::At(last + QUIET)
                } else {
                    Readiness::Unknown
                }
            });
            if !settled || self.announced(participant, topic, is_writer) == announced {
                return;
            }
        }
    }

    /// The readers, or for a reader the writers, that other participants have announced on a topic.
    fn announced(
        &self,
        participant: &DomainParticipant,
        topic: &str,
        is_writer: bool,
    ) -> BTreeSet<GUID> {
        let of_others = |guid: &GUID| guid.prefix != self.participant.prefix;
        if is_writer {
            let readers = participant.discovered_readers().into_iter();
            let of_topic = readers
                .filter(|reader| reader.subscription_topic_data.topic_name() == topic)
                .map(|reader| reader.reader_proxy.remote_reader_guid);
            of_topic.filter(of_others).collect()
        } else {
            let writers = participant.discovered_writers().into_iter();
            let of_topic = writers
                .filter(|writer| writer.publication_topic_data.topic_name == topic)
                .map(|writer| writer.writer_proxy.remote_writer_guid);
            of_topic.filter(of_others).collect()
        }
    }

    /// Waits until `writer` and at least `count` readers have found each other; false when `deadline` came first.
    pub(super) fn wait_for_readers(&self, writer: GUID, count: usize, deadline: Instant) -> bool {
        self.wait(deadline, |matches| {
            let mut since: Vec<Instant> = matches
                .readers
                .get(&writer)
                .map(|readers| readers.values().copied().collect())
                .unwrap_or_default();
            since.sort();
            match count.checked_sub(1).map(|last| since.get(last)) {
                None => Readiness::Ready,
                Some(Some(&found)) => Readiness::At(found + MUTUAL_AFTER),
                Some(None) => Readiness::Unknown,
            }
        })
    }

    /// Waits until `reader` has found a writer; false when `deadline` came first.
    pub(super) fn wait_for_writer(&self, reader: GUID, deadline: Instant) -> bool {
        self.wait(deadline, |matches| {
            if matches
                .writers
                .get(&reader)
                .is_some_and(|writers| !writers.is_empty())
            {
                Readiness::Ready
            } else {
                Readiness::Unknown
            }
        })
    }

    /// Waits until `writer` has found a reader of the participant that `peer` belongs to; false when `deadline` came
    /// first.
    pub(super) fn wait_for_reader_beside(
        &self,
        writer: GUID,
        peer: GUID,
        deadline: Instant,
    ) -> bool {
        let (prefix, _) = split(peer.to_bytes());
        self.wait(deadline, |matches| {
            let found = matches.readers.get(&writer).is_some_and(|readers| {
                readers
                    .keys()
                    .any(|reader| split(reader.to_bytes()).0 == prefix)
            });
            if found {
                Readiness::Ready
            } else {
                Readiness::Unknown
            }
        })
    }

    fn wait(&self, deadline: Instant, ready: impl Fn(&Matches) -> Readiness) -> bool {
        let mut matches = lock(&self.known.matches);
        loop {
            let now = Instant::now();
            let until = match ready(&matches) {
                Readiness::Ready => return true,
                Readiness::At(instant) if instant <= now => return true,
                Readiness::At(instant) => instant.min(deadline),
                Readiness::Unknown => deadline,
            };
            if deadline <= now {
                return false;
            }
            matches = self
                .known
                .changed
                .wait_timeout(matches, until.saturating_duration_since(now))
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
    }

    /// Nodes and endpoints that other participants have announced; an endpoint of a participant with several nodes is
    /// shown under the name that ROS 2 gives to the unknown.
    pub(super) fn graph(&self, participant: &DomainParticipant) -> Graph {
        let nodes = lock(&self.known.nodes);
        let mut entities = Vec::new();
        for (prefix, nodes) in nodes.iter() {
            for (number, node) in nodes.iter().enumerate() {
                entities.push(Entity {
                    domain_id: self.domain_id,
                    session: hex(prefix),
                    node_number: number as u32,
                    entity_number: number as u32,
                    kind: EntityKind::Node,
                    node: node.clone(),
                    channel: None,
                });
            }
        }
        let mut add = |gid: Gid, is_writer: bool, topic: &str, ty: &str, qos: Qos| {
            let Some((kind, channel)) = channel(is_writer, topic, ty, qos) else {
                return;
            };
            let (prefix, number) = split(gid);
            let node = match nodes.get(&prefix).map(Vec::as_slice) {
                Some([node]) => node.clone(),
                _ => unknown_node(),
            };
            entities.push(Entity {
                domain_id: self.domain_id,
                session: hex(&prefix),
                node_number: 0,
                entity_number: number,
                kind,
                node,
                channel: Some(channel),
            });
        };
        for writer in participant.discovered_writers() {
            let data = &writer.publication_topic_data;
            let qos = Qos {
                reliability: reliability(data.reliability),
                durability: durability(data.durability),
                history: History::KeepLast(1),
                lifespan: None,
            };
            add(
                data.key.to_bytes(),
                true,
                &data.topic_name,
                &data.type_name,
                qos,
            );
        }
        for reader in participant.discovered_readers() {
            let data = &reader.subscription_topic_data;
            let qos = Qos::best_effort(1);
            add(
                data.key().to_bytes(),
                false,
                data.topic_name(),
                data.type_name(),
                qos,
            );
        }
        entities.sort();
        entities.dedup();
        Graph::new(entities)
    }
}

impl Drop for Discovery {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the DDS discovery thread has panicked");
        }
    }
}

async fn watch(
    reader: &SimpleDataReaderCdr<ParticipantEntitiesInfo>,
    statuses: &DomainParticipantStatusListener,
    mut stopped: oneshot::Receiver<()>,
    known: &Known,
) {
    let announced = reader.as_async_stream().map(Either::Left);
    let events = statuses.as_async_status_stream().map(Either::Right);
    let news = stream::select(announced, events);
    pin_mut!(news);
    while let Either::Left((Some(item), _)) = select(news.next(), &mut stopped).await {
        match item {
            Either::Left(Ok(change)) => known.take_nodes(&change.into_value()),
            Either::Left(Err(reason)) => {
                tracing::warn!(%reason, "ROS discovery could not be read");
            }
            Either::Right(event) => known.take_event(&event),
        }
    }
}

impl Known {
    fn take_nodes(&self, info: &ParticipantEntitiesInfo) {
        let (prefix, _) = split(info.gid().to_bytes16());
        let names = info
            .nodes()
            .iter()
            .map(|node| NodeName {
                enclave: "/".to_owned(),
                namespace: node.namespace().to_owned(),
                name: node.name().to_owned(),
            })
            .collect();
        lock(&self.nodes).insert(prefix, names);
    }

    fn take_event(&self, event: &DomainParticipantStatusEvent) {
        let mut matches = lock(&self.matches);
        matches.last = Some(Instant::now());
        match *event {
            DomainParticipantStatusEvent::RemoteReaderMatched {
                local_writer,
                remote_reader,
            } => {
                matches
                    .readers
                    .entry(local_writer)
                    .or_default()
                    .entry(remote_reader)
                    .or_insert_with(Instant::now);
            }
            DomainParticipantStatusEvent::RemoteWriterMatched {
                local_reader,
                remote_writer,
            } => {
                matches
                    .writers
                    .entry(local_reader)
                    .or_default()
                    .insert(remote_writer);
            }
            DomainParticipantStatusEvent::RemoteReaderQosIncompatible {
                local_writer: own,
                remote_reader: other,
                ..
            }
            | DomainParticipantStatusEvent::RemoteWriterQosIncompatible {
                local_reader: own,
                remote_writer: other,
                ..
            } => {
                matches.incompatible.insert((own, other));
            }
            DomainParticipantStatusEvent::ReaderLost { guid, .. } => {
                matches.incompatible.retain(|(_, other)| *other != guid);
                for readers in matches.readers.values_mut() {
                    readers.remove(&guid);
                }
            }
            DomainParticipantStatusEvent::WriterLost { guid, .. } => {
                matches.incompatible.retain(|(_, other)| *other != guid);
                for writers in matches.writers.values_mut() {
                    writers.remove(&guid);
                }
            }
            _ => {}
        }
        self.changed.notify_all();
    }
}

/// What ROS means by a DDS topic; none for what is not ROS.
fn channel(is_writer: bool, topic: &str, ty: &str, qos: Qos) -> Option<(EntityKind, Channel)> {
    let (prefix, name) = topic.split_at_checked(2)?;
    let (kind, name, ty) = match (prefix, is_writer) {
        ("rt", true) => (EntityKind::Publisher, name, ty),
        ("rt", false) => (EntityKind::Subscription, name, ty),
        ("rq", _) => (
            if is_writer {
                EntityKind::Client
            } else {
                EntityKind::Server
            },
            name.strip_suffix("Request")?,
            ty.strip_suffix("Request_")?,
        ),
        _ => return None,
    };
    Some((
        kind,
        Channel {
            name: name.to_owned(),
            ty: TypeId::new(ty.to_owned(), ""),
            qos,
        },
    ))
}

fn reliability(policy: Option<policy::Reliability>) -> Reliability {
    match policy {
        Some(policy::Reliability::BestEffort) => Reliability::BestEffort,
        _ => Reliability::Reliable,
    }
}

fn durability(policy: Option<policy::Durability>) -> Durability {
    match policy {
        None | Some(policy::Durability::Volatile) => Durability::Volatile,
        _ => Durability::TransientLocal,
    }
}

fn unknown_node() -> NodeName {
    NodeName {
        enclave: "/".to_owned(),
        namespace: "_NODE_NAMESPACE_UNKNOWN_".to_owned(),
        name: "_NODE_NAME_UNKNOWN_".to_owned(),
    }
}

/// Participant and number of an endpoint.
fn split(gid: Gid) -> (Prefix, u32) {
    let mut prefix = [0; 12];
    prefix.copy_from_slice(&gid[..12]);
    let mut number = [0; 4];
    number.copy_from_slice(&gid[12..]);
    (prefix, u32::from_be_bytes(number))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        write!(text, "{byte:02x}").unwrap_or_default();
        text
    })
}
