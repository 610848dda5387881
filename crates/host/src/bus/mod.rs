//! The bus: topics, services and the graph of nodes, over Zenoh or DDS as chosen at start.
//!
//! One small blocking interface. Payloads are CDR with its four-byte header, names are absolute ROS names, times are
//! nanoseconds since 1970. Callbacks run on the transport's threads, one at a time per subscription: they must not
//! block, and queue what takes time.
//!
//! **Zenoh** uses the wire format of rmw_zenoh, so that ROS 2 with that middleware sees our nodes, topics and
//! types. It is written here on the bare `zenoh` and `zenoh-ext` crates and not on a ROS client library such as
//! hiroz: the format is a key, 33 bytes and a token (module [`wire`]), while the libraries that exist differ from
//! rmw_zenoh in exactly these bytes (identifiers from another hash, sequences from 0, blocking for every reliable
//! topic) and bring executors, parameters and code generation that a cell does not use.
//!
//! **DDS** goes through ros2-client and RustDDS. It needs multicast and has no type hashes; see [`dds`].
//!
//! Delivery on Zenoh, by quality of service:
//!
//! | quality of service | publisher | subscription |
//! |---|---|---|
//! | reliable, volatile | cache of the history's depth, heartbeat | fetches what a cut lost, reports what is gone ([`recovery`]) |
//! | transient local | the same, and announces itself | history on joining, then as above (`zenoh-ext`, as rmw_zenoh does) |
//! | best effort | plain | counts gaps |
//!
//! No publisher blocks while a link is congested, not even a keep-all one (rmw_zenoh does): a recorder behind a cut link
//! would stop the machine. What is dropped stands in the publisher's cache, and the subscription fetches or reports it.
//! A clean end is [`Bus::close`]: what was published before it is written to the links first, and a node that has just
//! published something reliable stays for a second, so that what a busy link dropped can still be fetched.

pub mod config;
pub mod dds;
mod error;
mod gaps;
pub mod graph;
mod observer;
pub mod qos;
mod recovery;
pub mod router;
mod services;
mod session;
mod storage;
mod subscription;
mod types;
pub mod wire;

use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

pub use config::{BusConfig, DdsServices, Followed, ROUTER_ENDPOINT, RouterConfig, Transport};
pub use error::BusError;
pub use graph::Graph;
pub use observer::{Observed, Observer, OnKept, OnMissed, OnObserved, Watched};
pub use qos::{Durability, History, Qos, Reliability};
pub use router::Router;
pub use storage::Storage;
pub use types::{ServiceId, TypeId};
pub use wire::{Channel, Entity, EntityKind, Gid, NodeName};

/// One sample as it was taken from the bus.
#[derive(Clone, Debug)]
pub struct Received<'a> {
    /// CDR with its header.
    pub payload: Cow<'a, [u8]>,
    /// Number that the publisher gave it; rmw counts from 1.
    pub sequence: u64,
    /// Instant of publication, ns since 1970, by the publisher's clock.
    pub source_time_ns: i64,
    /// Instant of reception, ns since 1970, by our clock.
    pub received_ns: i64,
    /// Global identifier of the publisher.
    pub publisher: Gid,
}

/// Samples that will never come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lost {
    /// Global identifier of the publisher.
    pub publisher: Gid,
    /// Number of the first one.
    pub first: u64,
    /// How many, in a row.
    pub count: u64,
}

/// Called with samples, in order, each once.
pub type OnSample = Box<dyn Fn(Received<'_>) + Send + Sync>;

/// Called with reports of loss, in order with the samples.
pub type OnLost = Box<dyn Fn(Lost) + Send + Sync>;

/// Answers one request (CDR) with a response (CDR), or refuses it with a sentence.
pub type Handler = Box<dyn FnMut(&[u8]) -> Result<Vec<u8>, String> + Send>;

/// A request that any thread answers, at any time. Where it is dropped, the client learns that there is no answer, or runs
/// into its timeout.
pub struct Request {
    /// CDR with its header.
    pub payload: Vec<u8>,
    reply: Box<dyn FnOnce(Result<Vec<u8>, String>) + Send>,
}

impl Request {
    /// Answers with a response (CDR), or refuses with a sentence.
    pub fn answer(self, answer: Result<Vec<u8>, String>) {
        (self.reply)(answer);
    }
}

/// Bytes of requests that wait for the thread of a service; what comes beyond is refused.
const MOST_WAITING: usize = 64 << 20;

/// Bytes that wait, at most [`MOST_WAITING`].
#[derive(Default)]
struct Waiting(AtomicUsize);

impl Waiting {
    /// Takes so many bytes more; false where they are too many.
    fn takes(&self, length: usize) -> bool {
        let sum = |now: usize| now.checked_add(length).filter(|&sum| sum <= MOST_WAITING);
        (self.0)
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, sum)
            .is_ok()
    }

    fn leaves(&self, length: usize) {
        self.0.fetch_sub(length, Ordering::AcqRel);
    }
}

/// Called with requests; must not block.
pub type OnRequest = Box<dyn Fn(Request) + Send + Sync>;

/// One node's access to the bus.
pub struct Bus {
    inner: Inner,
}

enum Inner {
    Zenoh(session::ZenohBus),
    Dds(dds::DdsBus),
}

impl Bus {
    /// Joins the bus as node `name` in `namespace` (`/` for none).
    ///
    /// # Errors
    /// [`BusError::NoRouter`] when none of the endpoints answers within the connect timeout, [`BusError::Name`],
    /// [`BusError::Config`], [`BusError::Transport`].
    pub fn open(config: &BusConfig, name: &str, namespace: &str) -> Result<Self, BusError> {
        let node = NodeName {
            enclave: config.enclave.clone(),
            namespace: namespace.to_owned(),
            name: name.to_owned(),
        };
        wire::check_name(&node.full())?;
        let inner = match config.transport {
            Transport::Zenoh => Inner::Zenoh(session::ZenohBus::open(config, node)?),
            Transport::Dds => Inner::Dds(dds::DdsBus::open(config, &node)?),
        };
        Ok(Self { inner })
    }

    /// Publishes on `topic` (absolute).
    ///
    /// # Errors
    /// A name or type that is none of ROS, or what the transport says.
    pub fn publisher(
        &self,
        topic: &str,
        ty: impl Into<TypeId>,
        qos: Qos,
    ) -> Result<Publisher, BusError> {
        wire::check_name(topic)?;
        let inner = match &self.inner {
            Inner::Zenoh(bus) => PublisherInner::Zenoh(bus.publisher(topic, ty.into(), qos)?),
            Inner::Dds(bus) => PublisherInner::Dds(bus.publisher(topic, &ty.into(), qos)?),
        };
        Ok(Publisher { inner })
    }

    /// Subscribes to `topic` (absolute) until the subscription is dropped.
    ///
    /// # Errors
    /// A name or type that is none of ROS, or what the transport says.
    pub fn subscribe(
        &self,
        topic: &str,
        ty: impl Into<TypeId>,
        qos: Qos,
        on_sample: OnSample,
        on_lost: OnLost,
    ) -> Result<Subscription, BusError> {
        wire::check_name(topic)?;
        let callbacks = subscription::Callbacks { on_sample, on_lost };
        Ok(Subscription {
            _inner: match &self.inner {
                Inner::Zenoh(bus) => {
                    SubscriptionInner::Zenoh(bus.subscribe(topic, ty.into(), qos, callbacks)?)
                }
                Inner::Dds(bus) => {
                    SubscriptionInner::Dds(bus.subscribe(topic, &ty.into(), qos, callbacks)?)
                }
            },
        })
    }

    /// Serves `name` (absolute) until the server is dropped; requests are answered one after the other on a thread
    /// of the service's own.
    ///
    /// # Errors
    /// A name or type that is none of ROS, or what the transport says.
    pub fn serve(
        &self,
        name: &str,
        ty: impl Into<ServiceId>,
        mut handler: Handler,
    ) -> Result<Server, BusError> {
        let (sender, requests) = mpsc::channel::<Request>();
        let waiting = Arc::new(Waiting::default());
        let answered = Arc::clone(&waiting);
        std::thread::Builder::new()
            .name(format!("service {name}"))
            .spawn(move || {
                for request in requests {
                    let length = request.payload.len();
                    let answer = handler(&request.payload);
                    request.answer(answer);
                    answered.leaves(length);
                }
            })
            .map_err(|reason| BusError::transport("start a service's thread", &reason))?;
        // The thread ends only after this sender, unless the handler has panicked: then the request is dropped here.
        let queue = move |request: Request| {
            if waiting.takes(request.payload.len()) {
                drop(sender.send(request));
            } else {
                request.answer(Err("too much is waiting to be answered".to_owned()));
            }
        };
        self.serve_deferred(name, ty, Box::new(queue))
    }

    /// Serves `name` (absolute) until the server is dropped; whoever takes the requests answers them when it can.
    ///
    /// # Errors
    /// A name or type that is none of ROS, or what the transport says.
    pub fn serve_deferred(
        &self,
        name: &str,
        ty: impl Into<ServiceId>,
        on_request: OnRequest,
    ) -> Result<Server, BusError> {
        wire::check_name(name)?;
        Ok(Server {
            _inner: match &self.inner {
                Inner::Zenoh(bus) => ServerInner::Zenoh(bus.serve(name, ty.into(), on_request)?),
                Inner::Dds(bus) => ServerInner::Dds(bus.serve(name, &ty.into(), on_request)?),
            },
        })
    }

    /// True over Zenoh in the format of rmw_zenoh, which has type hashes.
    pub fn is_zenoh(&self) -> bool {
        matches!(self.inner, Inner::Zenoh(_))
    }

    /// Announces a client of service `name` (absolute).
    ///
    /// # Errors
    /// A name or type that is none of ROS, or what the transport says.
    pub fn client(&self, name: &str, ty: impl Into<ServiceId>) -> Result<Client, BusError> {
        wire::check_name(name)?;
        Ok(Client {
            inner: match &self.inner {
                Inner::Zenoh(bus) => ClientInner::Zenoh(bus.client(name, ty.into())?),
                Inner::Dds(bus) => ClientInner::Dds(bus.client(name, &ty.into())?),
            },
        })
    }

    /// Calls service `name` once; for several calls keep a [`Client`].
    ///
    /// # Errors
    /// No server within the timeout, no answer, or its refusal.
    pub fn call(
        &self,
        name: &str,
        ty: impl Into<ServiceId>,
        request: &[u8],
        timeout: Duration,
    ) -> Result<Vec<u8>, BusError> {
        self.client(name, ty)?.call(request, timeout)
    }

    /// The same for a service that may take longer to answer than to be discovered.
    ///
    /// # Errors
    /// No server within the first timeout, no answer within the second, or its refusal.
    pub fn call_with_timeouts(
        &self,
        name: &str,
        ty: impl Into<ServiceId>,
        request: &[u8],
        discovery_timeout: Duration,
        reply_timeout: Duration,
    ) -> Result<Vec<u8>, BusError> {
        let client = self.client(name, ty)?;
        client.call_with_timeouts(request, discovery_timeout, reply_timeout)
    }

    /// What the nodes of this domain announce, this one included, as far as [`BusConfig::graph`] follows it.
    pub fn graph(&self) -> Graph {
        match &self.inner {
            Inner::Zenoh(bus) => bus.graph(),
            Inner::Dds(bus) => bus.graph(),
        }
    }

    /// Waits until at least `count` subscriptions match `publisher`; false when `deadline` came first.
    pub fn wait_for_subscribers(
        &self,
        publisher: &Publisher,
        count: usize,
        deadline: Instant,
    ) -> bool {
        match (&self.inner, &publisher.inner) {
            (Inner::Zenoh(bus), PublisherInner::Zenoh(publisher)) => {
                bus.wait_for_subscribers(publisher, count, deadline)
            }
            (Inner::Dds(bus), PublisherInner::Dds(publisher)) => {
                bus.wait_for_subscribers(publisher, count, deadline)
            }
            _ => false,
        }
    }

    /// Leaves the bus; what was published before is written out first, for at most `within`.
    ///
    /// # Errors
    /// What the transport says.
    pub fn close(self, within: Duration) -> Result<(), BusError> {
        match self.inner {
            Inner::Zenoh(bus) => bus.close(within),
            Inner::Dds(bus) => bus.close(within),
        }
    }
}

/// Publishes samples of one topic until it is dropped.
pub struct Publisher {
    inner: PublisherInner,
}

#[expect(
    clippy::large_enum_variant,
    reason = "one for each topic, and never moved about"
)]
enum PublisherInner {
    Zenoh(session::ZenohPublisher),
    Dds(dds::DdsPublisher),
}

impl Publisher {
    /// Publishes one message (CDR with header) with the source time `source_time_ns`, and returns its sequence number.
    /// Bytes that are given away are not copied.
    ///
    /// # Errors
    /// A payload that is not CDR with its header, or what the transport says.
    pub fn publish(&self, cdr: impl Into<Vec<u8>>, source_time_ns: i64) -> Result<u64, BusError> {
        let cdr = cdr.into();
        match &self.inner {
            PublisherInner::Zenoh(publisher) => publisher.publish(cdr, source_time_ns),
            PublisherInner::Dds(publisher) => publisher.publish(cdr, source_time_ns),
        }
    }

    /// Global identifier that its samples carry.
    pub fn gid(&self) -> Gid {
        match &self.inner {
            PublisherInner::Zenoh(publisher) => publisher.gid(),
            PublisherInner::Dds(publisher) => publisher.gid(),
        }
    }
}

/// A subscription; dropping it ends it.
pub struct Subscription {
    _inner: SubscriptionInner,
}

#[expect(dead_code, reason = "held for their drop")]
enum SubscriptionInner {
    Zenoh(subscription::ZenohSubscription),
    Dds(dds::DdsSubscription),
}

/// A served service; dropping it ends it.
pub struct Server {
    _inner: ServerInner,
}

#[expect(dead_code, reason = "held for their drop")]
enum ServerInner {
    Zenoh(services::ZenohServer),
    Dds(dds::services::DdsServer),
}

/// A client of a service, announced until it is dropped.
pub struct Client {
    inner: ClientInner,
}

enum ClientInner {
    Zenoh(services::ZenohClient),
    Dds(dds::services::DdsClient),
}

impl Client {
    /// Sends one request (CDR) and waits for its response (CDR).
    ///
    /// # Errors
    /// [`BusError::NoServer`], [`BusError::Timeout`], [`BusError::Refused`] with the server's sentence.
    pub fn call(&self, request: &[u8], timeout: Duration) -> Result<Vec<u8>, BusError> {
        self.call_with_timeouts(request, timeout, timeout)
    }

    /// The same for a service that may take longer to answer than to be discovered.
    ///
    /// # Errors
    /// No server within the first timeout, no answer within the second, or its refusal.
    pub fn call_with_timeouts(
        &self,
        request: &[u8],
        discovery_timeout: Duration,
        reply_timeout: Duration,
    ) -> Result<Vec<u8>, BusError> {
        let begun = Instant::now();
        let found = begun + discovery_timeout;
        let answered = begun + reply_timeout;
        match &self.inner {
            ClientInner::Zenoh(client) => client.call(request, found, answered),
            ClientInner::Dds(client) => client.call(request, found, answered),
        }
    }
}

/// The instant now, ns since 1970, by the clock of the cell.
pub(crate) fn wall_ns() -> i64 {
    crate::clock::now().0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_is_bounded_and_makes_room_again() {
        let waiting = Waiting::default();
        assert!(waiting.takes(MOST_WAITING - 1) && waiting.takes(1));
        assert!(!waiting.takes(1) && !waiting.takes(usize::MAX));
        waiting.leaves(MOST_WAITING - 1);
        assert!(waiting.takes(MOST_WAITING - 1) && !waiting.takes(1));
    }
}
