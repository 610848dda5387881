//! `probecell stream`: what a running cell publishes, or what a recording holds, as lines of JSON ([`terminal::cell_stream`]) on standard output:
//! for programs that hand it on and need neither the bus nor a key of the cell.

use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use anyhow::Context;
use bags::Bag;
use cell::Cell;
use controllers::driver::Role;
use graph::Topic;
use host::bus::{BusConfig, EntityKind, Observed, Observer, OnMissed, OnObserved, Watched};
use host::bus_qos;
use terminal::cell_stream::{Line, Message, Present};

use super::dashboard;
use crate::{DEFAULT_CELL, GOOD, confined, output, ros_arguments::read_cell, signals};

/// How often it is said whether the cell is on the bus.
const PERIOD: Duration = Duration::from_millis(200);
/// Wait between two attempts to reach the router.
const AGAIN: Duration = Duration::from_secs(1);

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = after_help())]
pub(crate) struct Arguments {
    /// Topics, without the name of the cell.
    #[arg(required = true, value_name = "TOPIC")]
    topics: Vec<String>,
    /// Cell file.
    #[arg(long, default_value = DEFAULT_CELL)]
    cell: PathBuf,
    /// Read this recording instead: a folder or an .mcap file.
    #[arg(long, conflicts_with = "cell")]
    bag: Option<PathBuf>,
}

/// Examples, and the topics there are.
fn after_help() -> String {
    let examples = "Examples:\n  \
        Sizes and verdicts of the cell of this folder:\n    \
        probecell stream feature_results verdicts\n  \
        Those of a recording:\n    \
        probecell stream --bag recordings/turn_mill_1 feature_results verdicts > sizes.jsonl\n\n\
        What the lines are: docs/exchange.md. Topics:";
    let mut lines = vec![examples.to_owned()];
    for topic in graph::topics::ALL {
        match lines.last_mut() {
            Some(line) if line.starts_with("  ") && line.len() + topic.name.len() < 100 => {
                line.push(' ');
                line.push_str(topic.name);
            }
            _ => lines.push(format!("  {}", topic.name)),
        }
    }
    lines.join("\n")
}

/// Writes lines until standard output is closed; of a running cell also until SIGINT or SIGTERM.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let topics = arguments.topics.iter().map(|name| {
        graph::topics::by_name(name).with_context(|| {
            format!("{name} is not a topic of a cell: `probecell stream --help` lists them")
        })
    });
    let mut topics = topics.collect::<anyhow::Result<Vec<Topic>>>()?;
    topics.sort_by_key(|topic| topic.name);
    topics.dedup_by_key(|topic| topic.name);
    match &arguments.bag {
        Some(path) => recording(path, &topics),
        None => running(&arguments.cell, topics),
    }
}

/// Writes a line; a reader that has closed the pipe ends this program.
fn say(line: &Line) {
    output::bytes(format!("{line}\n").as_bytes());
}

/// The first line.
fn say_cell(name: &str, cell: Option<&Cell>) {
    say(&Line::Cell(terminal::cell_stream::Cell {
        name: name.to_owned(),
        version: crate::VERSION.to_owned(),
        is_simulated: cell.map(is_simulated),
    }));
}

/// Whether nothing moves that is made of metal.
fn is_simulated(cell: &Cell) -> bool {
    matches!(cell.driver_role(), Role::Node(_))
}

fn say_message(topic: &str, message_type: &str, payload: &[u8]) {
    say(&Line::Message(Message {
        topic: topic.to_owned(),
        message_type: message_type.to_owned(),
        cdr: payload.to_vec(),
    }));
}

fn recording(path: &Path, topics: &[Topic]) -> anyhow::Result<u8> {
    confined::reader(path)?;
    let bag = Bag::open(path)?;
    let damage = bag.verify();
    let namespace = session_io::record::namespace(&bag, path)?;
    let cell = session_io::embedded::cell(&bag)?;
    say_cell(namespace.trim_start_matches('/'), cell.as_ref());
    let names: Vec<String> = topics
        .iter()
        .map(|topic| format!("{namespace}/{}", topic.name))
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    for message in bag.messages_on(&names).flatten() {
        let channel = &message.channel;
        let topic = &channel.topic[namespace.len() + 1..];
        say_message(topic, &channel.type_name, &message.payload);
    }
    say(&Line::Complete {});
    Ok(output::damage(&damage))
}

fn running(path: &Path, topics: Vec<Topic>) -> anyhow::Result<u8> {
    let cell = read_cell(path)?;
    let bus = dashboard::buses(std::slice::from_ref(&cell), Vec::new(), 0)?;
    let bus = bus.into_iter().next().context("the cell has no bus")?;
    confined::server(std::slice::from_ref(&cell), std::slice::from_ref(&bus), &[])?;
    signals::on_end(|| std::process::exit(i32::from(GOOD)))?;
    let name = cell.cell.name.clone();
    say_cell(&name, Some(&cell));
    say(&Line::Complete {});
    let (sender, reached) = mpsc::channel();
    std::thread::Builder::new().name("bus".to_owned()).spawn({
        let name = name.clone();
        move || {
            // The receiver lives as long as the process.
            drop(sender.send(follow(&bus, &name, &topics)));
        }
    })?;
    let mut followed = None;
    loop {
        followed = followed.or_else(|| reached.try_recv().ok());
        let observer = followed.as_ref().map(|(observer, _)| observer);
        say(&Line::Present(Present {
            is_present: observer.is_some_and(|observer| is_present(observer, &name)),
            at: host::now().0,
        }));
        std::thread::sleep(PERIOD);
    }
}

/// Writes every message on these topics of the cell for as long as what it gives is kept. A router that does not answer is tried
/// again.
fn follow(bus: &BusConfig, cell: &str, topics: &[Topic]) -> (Observer, Vec<Watched>) {
    let on_missed: OnMissed = Arc::new(|topic, _, count| {
        tracing::warn!(%topic, count, "messages of the cell were missed");
    });
    let nothing: OnObserved = Arc::new(|_, _| {});
    let observer = loop {
        match Observer::open(bus, &[], &nothing, &on_missed) {
            Ok(observer) => break observer,
            Err(error) => {
                tracing::debug!(%error, "no router yet");
                std::thread::sleep(AGAIN);
            }
        }
    };
    let mut watched = Vec::new();
    for topic in topics {
        let observed = Observed {
            name: topic.name.to_owned(),
            ty: topic.message.into(),
            qos: bus_qos(topic.qos),
        };
        let (name, message_type) = (topic.name, topic.message.name);
        let on_sample: OnObserved =
            Arc::new(move |_, received| say_message(name, message_type, &received.payload));
        match observer.watch(cell, &observed, &on_sample, &on_missed) {
            Ok(one) => watched.push(one),
            Err(error) => tracing::error!(topic = topic.name, %error, "a topic cannot be read"),
        }
    }
    (observer, watched)
}

/// Whether somebody publishes the state of the cell's machine.
fn is_present(observer: &Observer, cell: &str) -> bool {
    let topic = format!("/{cell}/{}", graph::topics::MACHINE_STATE.name);
    let graph = observer.graph();
    let mut publishers = graph
        .entities()
        .iter()
        .filter(|one| one.kind == EntityKind::Publisher);
    publishers.any(|one| {
        one.channel
            .as_ref()
            .is_some_and(|channel| channel.name == topic)
    })
}
