//! Tells DDS which node our endpoints belong to, reads the same from others (`ros_discovery_info`), and knows who has
//! found whom.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

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

/// What others have told, and what the participant has matched.
#[derive(Default)]
struct Known {
    /// Nodes of each participant.
    nodes: Mutex<BTreeMap<Prefix, Vec<NodeName>>>,
    /// Readers of each of our writers.
    readers: Mutex<BTreeMap<GUID, BTreeSet<GUID>>>,
    matched: Condvar,
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
        discovery.tell(&lock(&discovery.own))?;
        Ok(discovery)
    }

    /// Another writer belongs to our node.
    pub(super) fn add_writer(&self, guid: GUID) -> Result<(), BusError> {
        let mut own = lock(&self.own);
        own.add_writer(guid.into());
        self.tell(&own)
    }

    /// Another reader belongs to our node.
    pub(super) fn add_reader(&self, guid: GUID) -> Result<(), BusError> {
        let mut own = lock(&self.own);
        own.add_reader(guid.into());
        self.tell(&own)
    }

    fn tell(&self, own: &NodeEntitiesInfo) -> Result<(), BusError> {
        let info = ParticipantEntitiesInfo::new(self.participant.into(), vec![own.clone()]);
        self.writer
            .write(info, Some(rustdds::Timestamp::now()))
            .map_err(|reason| BusError::transport("tell our endpoints", &reason.forget_data()))
    }

    /// Waits until at least `count` readers have found `writer`; false when `deadline` came first.
    pub(super) fn wait_for_readers(&self, writer: GUID, count: usize, deadline: Instant) -> bool {
        let mut readers = lock(&self.known.readers);
        while readers.get(&writer).map_or(0, BTreeSet::len) < count {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            readers = self
                .known
                .matched
                .wait_timeout(readers, left)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
        true
    }

    /// Nodes and endpoints that other participants have told; an endpoint of a participant with several nodes is
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
    let told = reader.as_async_stream().map(Either::Left);
    let events = statuses.as_async_status_stream().map(Either::Right);
    let news = stream::select(told, events);
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
        let mut readers = lock(&self.readers);
        match event {
            DomainParticipantStatusEvent::RemoteReaderMatched {
                local_writer,
                remote_reader,
            } => {
                readers
                    .entry(*local_writer)
                    .or_default()
                    .insert(*remote_reader);
            }
            DomainParticipantStatusEvent::ReaderLost { guid, .. } => {
                for matched in readers.values_mut() {
                    matched.remove(guid);
                }
            }
            _ => return,
        }
        self.matched.notify_all();
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
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
