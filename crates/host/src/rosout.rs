//! Log messages of this process on `/rosout`, as every ROS 2 node publishes its own: RViz, rqt and Foxglove show them.
//!
//! A process has one node, so its log has one publisher. What `tracing` lets through goes out ([`layer`]), and what the
//! process says on its terminal ([`log`]). Messages wait in a bounded queue; those that do not fit are counted and the count is
//! published. What the transport itself logs stays on the terminal, since publishing it could cause the next one.

use std::fmt::Write;
use std::sync::{
    OnceLock,
    atomic::{AtomicU64, Ordering},
    mpsc::{Receiver, SyncSender, sync_channel},
};
use std::time::Duration;

use probecell_msgs::{Message, builtin_interfaces::Time, rcl_interfaces::Log, to_cdr};
use tracing::{Level, Metadata, field::Field};
use tracing_subscriber::{Layer, layer::Context};

use crate::{
    bus::{Bus, BusError, Publisher, Qos},
    clock::now,
    log_limit::shortened,
};

/// Absolute name of the topic.
pub const TOPIC: &str = "/rosout";
/// Messages that wait to be published.
const QUEUE: usize = 1_000;
/// Quality of service of rcl's logs.
const QOS: Qos = Qos::latched(1_000).with_lifespan(Duration::from_secs(10));
/// Beginnings of the targets of the transports.
const TRANSPORTS: [&str; 4] = ["zenoh", "rustdds", "ros2_client", "mio"];

static LOG: OnceLock<SyncSender<Log>> = OnceLock::new();
static DROPPED: AtomicU64 = AtomicU64::new(0);

/// Publishes the log of this process under the name of its node, from now on until the process ends. A second call changes
/// nothing.
///
/// # Errors
/// What the bus says of the publisher.
pub fn publish(bus: &Bus, namespace: &str, node: &str) -> Result<(), BusError> {
    let publisher = bus.publisher(TOPIC, Log::TYPE, QOS)?;
    let name = format!("{}/{node}", namespace.trim_matches('/')).replace('/', ".");
    let (sender, queue) = sync_channel(QUEUE);
    if LOG.set(sender).is_err() {
        return Ok(());
    }
    std::thread::Builder::new()
        .name("rosout".to_owned())
        .spawn(move || forward(&queue, &publisher, name.trim_start_matches('.')))
        .map_err(|reason| BusError::transport("start the thread of the log", &reason))?;
    Ok(())
}

/// Publishes a line on `/rosout` that is not an event of `tracing`; nothing happens in a process that does not publish its log.
pub fn log(level: Level, text: &str) {
    enqueue(Log {
        level: code(level),
        msg: shortened(text).to_owned(),
        ..Log::default()
    });
}

/// Takes the events of `tracing` to `/rosout`.
pub fn layer<S: tracing::Subscriber>() -> impl Layer<S> {
    RosoutLayer
}

struct RosoutLayer;

impl<S: tracing::Subscriber> Layer<S> for RosoutLayer {
    fn on_event(&self, event: &tracing::Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        if LOG.get().is_none() || is_of_transport(metadata) {
            return;
        }
        let mut text = Text::default();
        event.record(&mut text);
        enqueue(Log {
            level: code(*metadata.level()),
            msg: shortened(&(text.message + &text.fields)).to_owned(),
            file: metadata.file().unwrap_or_default().to_owned(),
            function: metadata.module_path().unwrap_or_default().to_owned(),
            line: metadata.line().unwrap_or_default(),
            ..Log::default()
        });
    }
}

fn is_of_transport(metadata: &Metadata<'_>) -> bool {
    let target = metadata.target();
    TRANSPORTS.iter().any(|name| target.starts_with(name))
}

/// The message of an event, and its fields as `name=value`.
#[derive(Default)]
struct Text {
    message: String,
    fields: String,
}

impl tracing::field::Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        if field.name() == "message" {
            self.message = format!("{value:?}");
        } else {
            // Writing to a string cannot fail.
            write!(self.fields, " {}={value:?}", field.name()).ok();
        }
    }
}

/// Level as rcl counts it.
fn code(level: Level) -> u8 {
    match level {
        Level::ERROR => Log::ERROR,
        Level::WARN => Log::WARN,
        Level::INFO => Log::INFO,
        Level::DEBUG | Level::TRACE => Log::DEBUG,
    }
}

fn enqueue(mut message: Log) {
    let Some(queue) = LOG.get() else {
        return;
    };
    message.stamp = Time::from_nanos(now().0);
    if queue.try_send(message).is_err() {
        DROPPED.fetch_add(1, Ordering::Relaxed);
    }
}

fn forward(queue: &Receiver<Log>, publisher: &Publisher, name: &str) {
    let publish = |message: Log| {
        let stamp = now().0;
        let message = Log {
            name: name.to_owned(),
            ..message
        };
        // A log that cannot be published must not be logged.
        publisher.publish(to_cdr(&message), stamp).is_ok()
    };
    for message in queue {
        publish(message);
        let dropped = DROPPED.swap(0, Ordering::Relaxed);
        if dropped > 0 {
            publish(Log {
                stamp: Time::from_nanos(now().0),
                level: Log::WARN,
                msg: format!(
                    "{dropped} log messages were dropped, since they came faster than they could be published"
                ),
                ..Log::default()
            });
        }
    }
}
