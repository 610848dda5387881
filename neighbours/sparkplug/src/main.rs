//! `probecell-sparkplug`: a running cell as an edge node of MQTT Sparkplug B. `probecell sparkplug` starts it.
//!
//! ```text
//! probecell stream --> lines --> edge::Edge --> messages --> broker
//! ```
//!
//! It has neither the bus nor a key of the cell, opens no file once it has started, and connects to the broker only.

mod edge;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, atomic::AtomicBool, atomic::Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use clap::Parser;
use confinement::{Rights, Sockets, confine};
use probecell_msgs::CdrError;
use rumqttc::{AsyncClient, ClientError, Event, LastWill, MqttOptions, Packet, QoS};
use terminal::cell_stream::{DEFAULT_CELL, Line, Source, Stream};
use tokio::sync::mpsc::unbounded_channel;

use edge::{Edge, Message};

/// What is read of the cell.
const TOPICS: [&str; 7] = [
    "machine_state",
    "part_status",
    "part_reports",
    "inspection_plan",
    "feature_results",
    "verdicts",
    "gap_report",
];
/// The port of servers that look names up, where an answer is too long for UDP.
const NAMES: u16 = 53;
/// Time between two messages of data: what changes more often is told by its last value.
const PERIOD: Duration = Duration::from_millis(200);
/// Wait between two attempts to reach the broker, and for its last word.
const AGAIN: Duration = Duration::from_secs(2);
/// By which the broker learns that a connection is gone.
const KEEP_ALIVE: Duration = Duration::from_secs(10);
/// Bytes of the largest message: a birth of some thousand metrics.
const LARGEST: usize = 4 << 20;

/// Publish a running cell to an MQTT broker as an edge node of Sparkplug B.
#[derive(Parser)]
#[command(
    version,
    name = "probecell-sparkplug",
    bin_name = "probecell sparkplug",
    after_help = "Examples:\n  \
    The cell of this folder, to a broker on this computer:\n    \
    probecell sparkplug\n  \
    To the broker of the shop, which asks for a password:\n    \
    probecell sparkplug --cell launch-scripts/turn_mill.toml --broker broker.shop:1883 --group hall_3 --user cell --password-file mqtt.txt\n\n\
    Topics are spBv1.0/GROUP/TYPE/CELL[/machine]. The connection is not encrypted: beyond a trusted network let a broker on this\n\
    computer bridge to the other by TLS."
)]
struct Arguments {
    /// Cell file.
    #[arg(long, default_value = DEFAULT_CELL)]
    cell: PathBuf,
    /// Host and port of the broker.
    #[arg(long, default_value = "127.0.0.1:1883")]
    broker: String,
    /// Sparkplug group ID; the cell is the edge node.
    #[arg(long, default_value = "probecell")]
    group: String,
    /// User of the broker.
    #[arg(long, requires = "password_file")]
    user: Option<String>,
    /// File with that user's password.
    #[arg(long, requires = "user")]
    password_file: Option<PathBuf>,
}

/// The edge node, locked. A panic of another thread leaves it whole: each message changes it in one step.
fn lock(edge: &Mutex<Edge>) -> MutexGuard<'_, Edge> {
    edge.lock().unwrap_or_else(PoisonError::into_inner)
}

fn main() -> ExitCode {
    terminal::exit("probecell", run(Arguments::parse()))
}

/// Publishes until SIGINT or SIGTERM, or until the stream of the cell ends.
fn run(arguments: Arguments) -> anyhow::Result<u8> {
    let (host, port) = broker(&arguments.broker)?;
    let group = &arguments.group;
    if group.is_empty() || group.contains(['/', '+', '#']) {
        anyhow::bail!("--group {group}: the name must not contain /, + or #");
    }
    let login = match (&arguments.user, &arguments.password_file) {
        (Some(user), Some(file)) => {
            let text = std::fs::read_to_string(file);
            let text = text.with_context(|| format!("cannot read {}", file.display()))?;
            Some((user.clone(), text.trim_end().to_owned()))
        }
        _ => None,
    };
    let (cell, stream) = match Stream::start(&Source::Running(arguments.cell), &TOPICS)? {
        Ok(started) => started,
        Err(status) => return Ok(status),
    };
    confine(&Rights::default().with_sockets(Sockets {
        // By which some systems look names up.
        unix: true,
        tcp: true,
        udp: true,
        listens: false,
        ports: Some(vec![port, NAMES]),
    }))?;
    let name = cell.name.clone();
    let options = move || {
        let mut options = MqttOptions::new(format!("probecell-{name}"), host.clone(), port);
        options.set_keep_alive(KEEP_ALIVE);
        options.set_clean_session(true);
        options.set_max_packet_size(LARGEST, LARGEST);
        if let Some((user, password)) = &login {
            options.set_credentials(user, password);
        }
        options
    };
    let edge = Arc::new(Mutex::new(Edge::new(group, &cell.name, &cell.version)));
    let end = terminal::end_flag()?;
    let following = stream.follow(Arc::clone(&end), {
        let edge = Arc::clone(&edge);
        move |line| match line {
            Line::Message(message) => {
                if let Err(error) = take(&mut lock(&edge), &message) {
                    let topic = &message.topic;
                    terminal::warning(&format!(
                        "a message of {topic} cannot be decoded as the type of its topic: {error}"
                    ));
                }
            }
            Line::Present(present) => lock(&edge).present(present.is_present),
            Line::Cell(_) | Line::Complete {} => {}
        }
    })?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    terminal::line(&format!(
        "Sparkplug edge node {} of group {group}, to {}",
        cell.name, arguments.broker
    ));
    runtime.block_on(publish(&edge, options, &end))?;
    following.status()
}

/// Host and port.
fn broker(text: &str) -> anyhow::Result<(String, u16)> {
    let parts = text.rsplit_once(':');
    let parts = parts.and_then(|(host, port)| Some((host.to_owned(), port.parse().ok()?)));
    let parts = parts.filter(|(host, _)| !host.is_empty());
    parts.with_context(|| format!("--broker {text}: expected HOST:PORT, such as 127.0.0.1:1883"))
}

fn take(edge: &mut Edge, message: &terminal::cell_stream::Message) -> Result<(), CdrError> {
    match message.topic.as_str() {
        "machine_state" => edge.machine(&message.decode()?),
        "part_status" => edge.part(&message.decode()?),
        "part_reports" => edge.report(&message.decode()?),
        "inspection_plan" => edge.plan(message.decode()?),
        "feature_results" => edge.result(message.decode()?),
        "verdicts" => edge.verdict(message.decode()?),
        "gap_report" => edge.gap(&message.decode()?),
        _ => {}
    }
    Ok(())
}

/// ms since 1970.
fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    u64::try_from(since.unwrap_or_default().as_millis()).unwrap_or_default()
}

/// Publishes over one connection after the other, each with a number of its own, until `end`.
async fn publish(
    edge: &Mutex<Edge>,
    options: impl Fn() -> MqttOptions,
    end: &AtomicBool,
) -> anyhow::Result<()> {
    let mut told = String::new();
    for session in 0.. {
        let mut options = options();
        let death = lock(edge).death(session);
        options.set_last_will(LastWill::new(
            &death.topic,
            death.payload.clone(),
            QoS::AtLeastOnce,
            false,
        ));
        let lost = connection(edge, options, session, death, end).await;
        lock(edge).disconnected();
        match lost {
            None => return Ok(()),
            Some(text) if text == told => {}
            Some(text) => {
                terminal::warning(&format!("the broker: {text}; trying again"));
                told = text;
            }
        }
        tokio::time::sleep(AGAIN).await;
    }
    Ok(())
}

/// One connection: births, data, and at `end` the death. Why it is gone, where it is lost.
async fn connection(
    edge: &Mutex<Edge>,
    options: MqttOptions,
    session: u64,
    death: Message,
    end: &AtomicBool,
) -> Option<String> {
    let (client, mut events) = AsyncClient::new(options, 1024);
    let (sender, mut packets) = unbounded_channel();
    let moving = tokio::spawn(async move {
        loop {
            let (packet, is_last) = match events.poll().await {
                Ok(Event::Incoming(packet)) => (Ok(packet), false),
                Ok(Event::Outgoing(_)) => continue,
                Err(error) => (Err(error.to_string()), true),
            };
            if sender.send(packet).is_err() || is_last {
                return;
            }
        }
    });
    let mut tick = tokio::time::interval(PERIOD);
    let commands = lock(edge).commands();
    loop {
        let messages = tokio::select! {
            packet = packets.recv() => match packet {
                Some(Ok(Packet::ConnAck(_))) => {
                    if let Err(error) = client.subscribe(&commands, QoS::AtLeastOnce).await {
                        return Some(error.to_string());
                    }
                    lock(edge).connected(session, now())
                }
                Some(Ok(Packet::Publish(command))) => lock(edge).command(&command.payload, now()),
                Some(Ok(_)) => Vec::new(),
                Some(Err(text)) => return Some(text),
                None => return Some("the connection is gone".to_owned()),
            },
            _ = tick.tick() => lock(edge).changes(now()),
        };
        if let Err(error) = send(&client, messages).await {
            return Some(error.to_string());
        }
        if end.load(Ordering::SeqCst) {
            let last = async {
                send(&client, vec![death]).await?;
                client.disconnect().await
            };
            if last.await.is_ok() {
                // A broker that does not take it publishes it by itself.
                drop(tokio::time::timeout(AGAIN, moving).await);
            }
            return None;
        }
    }
}

async fn send(client: &AsyncClient, messages: Vec<Message>) -> Result<(), ClientError> {
    for message in messages {
        client
            .publish(message.topic, QoS::AtMostOnce, false, message.payload)
            .await?;
    }
    Ok(())
}
