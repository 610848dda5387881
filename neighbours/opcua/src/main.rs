//! `probecell-opcua`: a running cell, or a recording, as an OPC UA server. `probecell opcua` starts it.
//!
//! ```text
//! probecell stream --> lines --> results::Results --> update::Update --> space::Space --> nodes and their values --> clients
//!
//!   objects: the nodes of the cell
//!   model: types of DI, Machinery, Machinery Result and our own
//!   structures: values of these types
//!   manager: reads, methods; every write is refused
//! ```
//!
//! It has neither the bus nor a key of the cell, opens no file once it has started, and connects to nobody
//! ([ADR 0018](../../../docs/adr/0018-opc-ua-is-a-process-of-its-own.md)).

mod event;
mod manager;
mod model;
mod objects;
mod results;
mod space;
mod structures;
mod update;

use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Parser;
use confinement::{Rights, Sockets, confine};
use opcua::server::{Server, ServerBuilder, ServerHandle};
use probecell_msgs::CdrError;
use terminal::cell_stream::{Cell, DEFAULT_CELL, Line, Message, Source, Stream};
use tracing_subscriber::EnvFilter;

use manager::CellManager;
use results::Results;
use space::Space;
use update::Update;

/// The port that servers use.
const ADDRESS: &str = "127.0.0.1:4840";
/// What is read of the cell.
const TOPICS: [&str; 7] = [
    "machine_state",
    "inspection_plan",
    "feature_results",
    "verdicts",
    "pass_decisions",
    "part_reports",
    "gap_report",
];
/// How often it is looked whether this process is to end.
const PERIOD: Duration = Duration::from_millis(200);
/// What the stack says of certificates, which are not used, is left out.
const LOG: &str =
    "error,opcua_crypto=off,opcua_core::comms::secure_channel=off,opcua_server::server=off";

/// ms after which a request for news is answered by a fault; clients that hear it ask again.
const PUBLISH_TIMEOUT: u64 = 3_600_000;

/// Serve a running cell, or a recording, as an OPC UA server, read only.
#[derive(Parser)]
#[command(
    version,
    name = "probecell-opcua",
    bin_name = "probecell opcua",
    after_help = "Examples:\n  \
    The cell of this folder:\n    \
    probecell opcua\n  \
    Its recordings:\n    \
    probecell opcua --bag recordings/turn_mill_1\n\n\
    What it serves: docs/exchange.md."
)]
struct Arguments {
    /// Cell file.
    #[arg(long, default_value = DEFAULT_CELL)]
    cell: PathBuf,
    /// Serve this recording instead: a folder or an .mcap file.
    #[arg(long, conflicts_with = "cell")]
    bag: Option<PathBuf>,
    /// Address to listen on; port 0 takes a free one.
    #[arg(long, default_value = ADDRESS)]
    listen: SocketAddr,
    /// Listen beyond loopback although connections are neither encrypted nor signed: anyone who reaches the address can read results,
    /// and anyone in between can alter them. The stack's encryption is not offered, since its RSA leaks keys by timing
    /// (RUSTSEC-2023-0071).
    #[arg(long)]
    unencrypted: bool,
}

fn main() -> ExitCode {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(LOG));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    terminal::exit("probecell", run(Arguments::parse()))
}

/// Serves until SIGINT or SIGTERM, or until the stream of a running cell ends.
fn run(arguments: Arguments) -> anyhow::Result<u8> {
    let listen = arguments.listen;
    if !listen.ip().is_loopback() && !arguments.unencrypted {
        bail!(
            "--listen {listen}: connections are not encrypted, so only loopback is served (127.0.0.1:PORT); --unencrypted listens there nevertheless"
        );
    }
    let recording = arguments.bag.as_ref();
    let path = recording.unwrap_or(&arguments.cell).clone();
    let source = match recording {
        Some(bag) => Source::Recording(bag.clone()),
        None => Source::Running(arguments.cell),
    };
    let (cell, mut stream) = match Stream::start(&source, &TOPICS)? {
        Ok(started) => started,
        Err(status) => return Ok(status),
    };
    let mut results = Results::new(&cell.name, cell.is_simulated);
    // What there is already clients find.
    let mut before = Vec::new();
    loop {
        match stream.next()? {
            Some(Line::Complete {}) => break,
            Some(Line::Message(message)) => {
                let told = take(&mut results, &message);
                before.extend(
                    told.with_context(|| format!("{}: {}", path.display(), message.topic))?,
                );
            }
            Some(Line::Cell(_) | Line::Present(_)) => {}
            None => return Ok(stream.status()),
        }
    }
    let of_recording = recording.map(|_| stream.status());
    let cannot = || format!("cannot listen on {listen}");
    let listener = TcpListener::bind(listen).with_context(cannot)?;
    let address = listener.local_addr().with_context(cannot)?;
    listener.set_nonblocking(true).with_context(cannot)?;
    confine(&Rights::default().with_sockets(Sockets {
        tcp: true,
        listens: true,
        ports: Some(Vec::new()),
        ..Sockets::default()
    }))?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()?;
    // Building the server begins tasks.
    let entered = runtime.enter();
    let (server, handle) = server(&cell, address)?;
    drop(entered);
    let manager = handle.node_managers().get_of_type::<CellManager>();
    let manager = manager.context("the server has no nodes")?;
    let mut space = Space::new(manager, handle.subscriptions().clone());
    for update in before {
        space.take(update);
    }
    let end = terminal::end_flag()?;
    let serving = runtime.spawn(async move {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let served = server.run_with(listener).await;
        served.map_err(anyhow::Error::msg)
    });
    terminal::line(&format!(
        "OPC UA server of cell {}: opc.tcp://{address}/",
        cell.name
    ));
    let following = match of_recording {
        Some(_) => None,
        None => Some(stream.follow(Arc::clone(&end), move |line| {
            for update in changes(&mut results, line) {
                space.take(update);
            }
        })?),
    };
    runtime.block_on(until(&end));
    handle.cancel();
    runtime.block_on(serving)??;
    match following {
        Some(following) => following.status(),
        None => Ok(of_recording.unwrap_or_default()),
    }
}

async fn until(end: &AtomicBool) {
    while !end.load(Ordering::SeqCst) {
        tokio::time::sleep(PERIOD).await;
    }
}

/// What a line of a running cell changes; a message that cannot be decoded as the type of its topic is left out and said.
fn changes(results: &mut Results, line: Line) -> Vec<Update> {
    match line {
        Line::Message(message) => take(results, &message).unwrap_or_else(|error| {
            let topic = &message.topic;
            terminal::warning(&format!(
                "a message of {topic} cannot be decoded as the type of its topic: {error}"
            ));
            Vec::new()
        }),
        Line::Present(present) => {
            let change = results.present(present.at, present.is_present);
            change.into_iter().collect()
        }
        Line::Cell(_) | Line::Complete {} => Vec::new(),
    }
}

/// What a message changes.
fn take(results: &mut Results, message: &Message) -> Result<Vec<Update>, CdrError> {
    let one = match message.topic.as_str() {
        "machine_state" => results.machine(&message.decode()?),
        "inspection_plan" => {
            results.plan(message.decode()?);
            None
        }
        "feature_results" => results.result(message.decode()?),
        "verdicts" => results.verdict(message.decode()?),
        "pass_decisions" => results.decision(&message.decode()?),
        "gap_report" => Some(Results::gap(&message.decode()?)),
        "part_reports" => return Ok(results.report(&message.decode()?)),
        _ => None,
    };
    Ok(one.into_iter().collect())
}

/// No endpoint but one without security, for anonymous users. Nothing asks for a key, so that none is made or read.
fn server(cell: &Cell, address: SocketAddr) -> anyhow::Result<(Server, ServerHandle)> {
    ServerBuilder::new_anonymous(format!("probecell {}", cell.name))
        .application_uri(format!("urn:probecell:opcua:{}", cell.name))
        .product_uri("urn:probecell")
        .create_sample_keypair(false)
        .pki_dir("/nonexistent")
        // Longer than a client waits for a sign of life of a quiet subscription.
        .publish_timeout_default_ms(PUBLISH_TIMEOUT)
        .host(address.ip().to_string())
        .port(address.port())
        .with_node_manager(manager::builder(cell.clone()))
        .build()
        .map_err(anyhow::Error::msg)
}
