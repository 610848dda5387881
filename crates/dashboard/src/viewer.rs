//! Topics of the bus for Foxglove, Lichtblick and PlotJuggler, live: a server of the WebSocket protocol `foxglove.websocket.v1`
//! (<https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>; `foxglove.sdk.v1` is the same on the wire for what is
//! used here).
//!
//! Every topic of the domain that somebody publishes and whose type is known is offered, in CDR with its `ros2msg` schema; a
//! topic is read from the bus while a viewer subscribes to it. Nothing that a viewer sends reaches the bus. Each viewer has
//! sessions of its own and a bounded [`Outbox`]: one that is slow loses its oldest samples, is told how many, and holds up
//! neither others nor the bus.

mod outbox;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use fastwebsockets::{FragmentCollectorRead, Frame, OpCode, WebSocket, WebSocketError};
use host::bus::{BusConfig, Observed, Observer, OnMissed, OnObserved, Qos, TypeId, Watched};
use probecell_msgs::MessageType;
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncWrite};

use self::outbox::Outbox;

/// Protocols that are supported, by the names of their handshake.
pub(crate) const PROTOCOLS: [&str; 2] = ["foxglove.websocket.v1", "foxglove.sdk.v1"];
/// Viewers at once.
pub(crate) const VIEWERS: usize = 16;
/// Subscriptions of a viewer.
const SUBSCRIPTIONS: usize = 1000;
/// Requests of a viewer that wait.
const WAITING: usize = 256;
/// Bytes of a request: a subscription takes about 30.
const LONGEST: usize = 1 << 20;
/// How often the topics of the bus are looked at.
const ROUND: Duration = Duration::from_millis(500);
/// Kind of a binary message that carries a sample.
const MESSAGE_DATA: u8 = 1;
/// Levels of a status.
const WARNING: u8 = 1;
const ERROR: u8 = 2;

/// Serves one viewer until it leaves. `session` distinguishes runs of the program.
pub(crate) async fn serve<S>(
    socket: WebSocket<S>,
    buses: Arc<[BusConfig]>,
    session: u64,
) -> Result<(), WebSocketError>
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let (mut read, mut write) = socket.split(tokio::io::split);
    read.set_max_message_size(LONGEST);
    let mut read = FragmentCollectorRead::new(read);
    let outbox = Arc::new(Outbox::default());
    outbox.say(&json!({ "op": "serverInfo", "name": "probecell", "capabilities": [], "sessionId": format!("{session:x}") }));
    let (asked, requests) = sync_channel(WAITING);
    std::thread::Builder::new()
        .name("viewer".to_owned())
        .spawn({
            let outbox = Arc::clone(&outbox);
            move || Session::new(outbox).run(&buses, &requests)
        })?;
    let reading = async {
        // What the protocol answers by itself (pong, close) goes the way of everything else.
        let mut answer = |frame: Frame<'_>| {
            outbox.answer(&frame);
            std::future::ready(Ok::<(), WebSocketError>(()))
        };
        loop {
            let frame = read.read_frame(&mut answer).await?;
            if frame.opcode == OpCode::Close || !take(&frame, &asked, &outbox) {
                return Ok(());
            }
        }
    };
    let writing = async {
        loop {
            for frame in outbox.next().await {
                write.write_frame(frame).await?;
            }
            write.flush().await?;
        }
    };
    // The thread ends when `asked` is dropped, and with it what it reads of the bus.
    let ended: Result<(), WebSocketError> = tokio::select! {
        ended = reading => ended,
        ended = writing => ended,
    };
    drop(asked);
    ended
}

/// Hands a request on; false when the viewer asks faster than it is served.
fn take(frame: &Frame<'_>, asked: &SyncSender<String>, outbox: &Outbox) -> bool {
    if frame.opcode != OpCode::Text {
        outbox.status(
            ERROR,
            "this dashboard only reads: nothing is published for a viewer",
        );
        return true;
    }
    let text = String::from_utf8_lossy(&frame.payload).into_owned();
    asked.try_send(text).is_ok()
}

/// What a viewer may ask for.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Request {
    Subscribe {
        subscriptions: Vec<Wanted>,
    },
    Unsubscribe {
        #[serde(rename = "subscriptionIds")]
        ids: Vec<u32>,
    },
}

#[derive(Deserialize)]
struct Wanted {
    id: u32,
    #[serde(rename = "channelId")]
    channel: u64,
}

/// A topic that is offered.
struct Channel {
    id: u64,
    bus: usize,
    qos: Qos,
}

/// What one viewer is offered and reads.
struct Session {
    outbox: Arc<Outbox>,
    observers: Vec<Option<Observer>>,
    /// By name and type.
    channels: BTreeMap<(String, TypeId), Channel>,
    next: u64,
    /// Channel and reader of each subscription.
    read: BTreeMap<u32, (u64, Watched)>,
    /// Types that are not known, as they were reported to the viewer.
    unknown: BTreeSet<String>,
}

impl Session {
    fn new(outbox: Arc<Outbox>) -> Self {
        Self {
            outbox,
            observers: Vec::new(),
            channels: BTreeMap::new(),
            next: 1,
            read: BTreeMap::new(),
            unknown: BTreeSet::new(),
        }
    }

    fn run(mut self, buses: &[BusConfig], requests: &Receiver<String>) {
        self.observers.resize_with(buses.len(), || None);
        let mut looked: Option<Instant> = None;
        loop {
            if looked.is_none_or(|last| last.elapsed() >= ROUND) {
                self.connect(buses);
                self.offer();
                looked = Some(Instant::now());
            }
            match requests.recv_timeout(ROUND) {
                Ok(text) => match serde_json::from_str(&text) {
                    Ok(request) => self.answer(request),
                    Err(_) => self.outbox.status(ERROR, &refusal(&text)),
                },
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Opens what is not open; a router that does not answer is asked again in the next round.
    fn connect(&mut self, buses: &[BusConfig]) {
        let on_sample: OnObserved = Arc::new(|_, _| {});
        let on_missed: OnMissed = Arc::new(|_, _, _| {});
        for (place, config) in self.observers.iter_mut().zip(buses) {
            if place.is_none() {
                match Observer::open(config, &[], &on_sample, &on_missed) {
                    Ok(observer) => *place = Some(observer),
                    Err(error) => tracing::debug!(%error, "no router for a viewer yet"),
                }
            }
        }
    }

    /// Tells what has come and gone. A channel that goes takes its subscriptions with it.
    fn offer(&mut self) {
        let mut present = BTreeMap::new();
        for (bus, observer) in self.observers.iter().enumerate() {
            for topic in observer.iter().flat_map(|one| one.graph().topics()) {
                if let Some(qos) = topic.offered.first().copied() {
                    present.entry((topic.name, topic.ty)).or_insert((bus, qos));
                }
            }
        }
        let mut gone = Vec::new();
        self.channels.retain(|key, channel| {
            let stays = present.contains_key(key);
            if !stays {
                gone.push(channel.id);
            }
            stays
        });
        self.read.retain(|_, (channel, _)| !gone.contains(channel));
        let mut come = Vec::new();
        for ((name, ty), (bus, qos)) in present {
            let known = known(&ty);
            if known.is_none() {
                self.tell_unknown(&name, &ty);
            }
            if let Some(message) = known
                && !self.channels.contains_key(&(name.clone(), ty.clone()))
            {
                come.push(described(self.next, &name, message));
                let channel = Channel {
                    id: self.next,
                    bus,
                    qos,
                };
                self.next += 1;
                self.channels.insert((name, ty), channel);
            }
        }
        if !gone.is_empty() {
            self.outbox
                .say(&json!({ "op": "unadvertise", "channelIds": gone }));
        }
        if !come.is_empty() {
            self.outbox
                .say(&json!({ "op": "advertise", "channels": come }));
        }
    }

    fn tell_unknown(&mut self, name: &str, ty: &TypeId) {
        let text = format!(
            "{name} is not offered: its type {} is not known here",
            ty.ros_name()
        );
        if !self.unknown.contains(&text) {
            self.outbox.status(WARNING, &text);
            self.unknown.insert(text);
        }
    }

    fn answer(&mut self, request: Request) {
        match request {
            Request::Subscribe { subscriptions } => {
                for wanted in &subscriptions {
                    if let Err(why) = self.subscribe(wanted) {
                        self.outbox.status(ERROR, &why);
                    }
                }
            }
            Request::Unsubscribe { ids } => {
                for id in ids {
                    if self.read.remove(&id).is_none() {
                        let why = format!("there is no subscription {id}");
                        self.outbox.status(ERROR, &why);
                    }
                }
            }
        }
    }

    fn subscribe(&mut self, wanted: &Wanted) -> Result<(), String> {
        if self.read.contains_key(&wanted.id) {
            return Err(format!("subscription {} is there already", wanted.id));
        }
        if self.read.len() >= SUBSCRIPTIONS {
            return Err(format!("there are {SUBSCRIPTIONS} subscriptions already"));
        }
        let mut channels = self.channels.iter();
        let found = channels.find(|(_, channel)| channel.id == wanted.channel);
        let ((name, ty), channel) =
            found.ok_or_else(|| format!("there is no channel {}", wanted.channel))?;
        let observer = (self.observers[channel.bus].as_ref())
            .ok_or_else(|| format!("the router of {name} is gone"))?;
        let on_sample: OnObserved = Arc::new({
            let (outbox, id) = (Arc::clone(&self.outbox), wanted.id);
            move |_, received| {
                let at = received.received_ns.cast_unsigned();
                outbox.sample(id, at, &received.payload);
            }
        });
        let on_missed: OnMissed = Arc::new({
            let (outbox, name) = (Arc::clone(&self.outbox), name.clone());
            move |_, _, count| {
                let text = format!("{count} messages of {name} were lost in transit");
                outbox.status(WARNING, &text);
            }
        });
        let (namespace, last) = name.rsplit_once('/').unwrap_or(("", name));
        let observed = Observed {
            name: last.to_owned(),
            ty: ty.clone(),
            qos: channel.qos,
        };
        let watched = observer
            .watch(namespace, &observed, &on_sample, &on_missed)
            .map_err(|error| format!("{name} cannot be read: {error}"))?;
        self.read.insert(wanted.id, (channel.id, watched));
        Ok(())
    }
}

/// The type as it is known here, with the same definition.
fn known(ty: &TypeId) -> Option<&'static MessageType> {
    probecell_msgs::by_name(&ty.ros_name()).filter(|known| known.type_hash == ty.hash())
}

fn described(id: u64, topic: &str, ty: &MessageType) -> Value {
    json!({
        "id": id, "topic": topic, "encoding": "cdr",
        "schemaName": ty.name, "schemaEncoding": "ros2msg", "schema": ty.definition,
    })
}

/// Why a request is not served.
fn refusal(text: &str) -> String {
    let read: Option<Value> = serde_json::from_str(text).ok();
    match read.as_ref().and_then(|one| one["op"].as_str()) {
        Some(op @ ("subscribe" | "unsubscribe")) => format!("this {op} cannot be read"),
        Some(op) => format!("this dashboard only reads: {op} is not served"),
        None => "this is no request".to_owned(),
    }
}
