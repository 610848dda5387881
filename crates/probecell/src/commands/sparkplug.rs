//! `probecell sparkplug`: a running cell as an edge node of MQTT Sparkplug B.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, atomic::AtomicBool, atomic::Ordering};
use std::time::Duration;

use anyhow::Context;
use exchange::export::sparkplug::{Edge, Message, milliseconds};
use graph::topics::{self, Topic};
use probecell_msgs::from_cdr;
use rumqttc::{AsyncClient, ClientError, Event, LastWill, MqttOptions, Packet, QoS};
use tokio::sync::mpsc::unbounded_channel;

use super::{dashboard, following::follow};
use crate::{DEFAULT_CELL, GOOD, confined, output, ros_arguments::read_cell, signals};

/// What is read of the cell.
const READ: [Topic; 7] = [
    topics::MACHINE_STATE,
    topics::PART_STATUS,
    topics::PART_REPORTS,
    topics::INSPECTION_PLAN,
    topics::FEATURE_RESULTS,
    topics::VERDICTS,
    topics::GAP_REPORT,
];
/// Time between two messages of data: what changes more often is told by its last value.
const PERIOD: Duration = Duration::from_millis(200);
/// Wait between two attempts to reach the broker, and for its last word.
const AGAIN: Duration = Duration::from_secs(2);
/// By which the broker learns that a connection is gone.
const KEEP_ALIVE: Duration = Duration::from_secs(10);
/// Bytes of the largest message: a birth of some thousand metrics.
const LARGEST: usize = 4 << 20;

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    The cell of this folder, to a broker on this computer:\n    \
    probecell sparkplug\n  \
    To the broker of the shop, which asks for a password:\n    \
    probecell sparkplug --cell launch-scripts/turn_mill.toml --broker broker.shop:1883 --group hall_3 --user cell --password-file mqtt.txt\n\n\
    Topics are spBv1.0/GROUP/TYPE/CELL[/machine]. The connection is not encrypted: beyond a trusted network let a broker on this\n\
    computer bridge to the other by TLS.")]
pub(crate) struct Arguments {
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

/// Publishes until SIGINT or SIGTERM.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let cell = read_cell(&arguments.cell)?;
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
    let name = cell.cell.name.clone();
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
    let bus = dashboard::buses(std::slice::from_ref(&cell), Vec::new(), 0)?;
    let bus = bus.into_iter().next().context("the cell has no bus")?;
    confined::server(std::slice::from_ref(&cell), std::slice::from_ref(&bus), &[])?;
    let edge = Edge::new(group, &cell.cell.name, env!("CARGO_PKG_VERSION"));
    let edge = Arc::new(Mutex::new(edge));
    let name = cell.cell.name.clone();
    std::thread::Builder::new()
        .name("sparkplug bus".to_owned())
        .spawn({
            let (edge, heard) = (Arc::clone(&edge), Arc::clone(&edge));
            move || -> () {
                follow(
                    &bus,
                    &name,
                    &READ,
                    move |topic, payload| take(&heard, topic, payload),
                    move |is_present| lock(&edge).present(is_present),
                )
            }
        })?;
    let end = signals::end_flag()?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    output::line(&format!(
        "Sparkplug edge node {} of group {group}, to {}",
        cell.cell.name, arguments.broker
    ));
    runtime.block_on(publish(&edge, options, &end))?;
    Ok(GOOD)
}

/// Host and port.
fn broker(text: &str) -> anyhow::Result<(String, u16)> {
    let parts = text.rsplit_once(':');
    let parts = parts.and_then(|(host, port)| Some((host.to_owned(), port.parse().ok()?)));
    let parts = parts.filter(|(host, _)| !host.is_empty());
    parts.with_context(|| format!("--broker {text}: expected HOST:PORT, such as 127.0.0.1:1883"))
}

/// Takes a message; one that cannot be decoded as the type of its topic is left out and logged.
fn take(edge: &Mutex<Edge>, topic: &str, payload: &[u8]) {
    let mut edge = lock(edge);
    let taken = match topic {
        _ if topic == topics::MACHINE_STATE.name => {
            from_cdr(payload).map(|state| edge.machine(&state))
        }
        _ if topic == topics::PART_STATUS.name => {
            from_cdr(payload).map(|status| edge.part(&status))
        }
        _ if topic == topics::PART_REPORTS.name => {
            from_cdr(payload).map(|report| edge.report(&report))
        }
        _ if topic == topics::INSPECTION_PLAN.name => from_cdr(payload).map(|plan| edge.plan(plan)),
        _ if topic == topics::FEATURE_RESULTS.name => {
            from_cdr(payload).map(|result| edge.result(result))
        }
        _ if topic == topics::VERDICTS.name => {
            from_cdr(payload).map(|verdict| edge.verdict(verdict))
        }
        _ => from_cdr(payload).map(|report| edge.gap(&report)),
    };
    if let Err(error) = taken {
        tracing::warn!(%topic, %error, "a message cannot be decoded as the type of its topic");
    }
}

fn now() -> u64 {
    milliseconds(host::now().0)
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
                output::warning(&format!("the broker: {text}; trying again"));
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
