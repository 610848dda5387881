//! `probecell-opcua`: what a cell measures as an OPC UA server, which reads it as lines of JSON ([`feed`]) on standard input.
//! `probecell opcua` starts it.
//!
//! ```text
//! standard input --> space::Space --> nodes and their values --> server --> clients
//!                       objects: the nodes of the cell
//!                       model: types of DI, Machinery, Machinery Result and our own
//!                       structures: values of these types
//!                       manager: reads, methods; every write is refused
//! ```
//!
//! It ends when standard input does. It reads and writes no file, and connects to nobody.

mod event;
mod manager;
mod model;
mod objects;
mod space;
mod structures;

use std::io::{BufRead, StdinLock, Write};
use std::net::{SocketAddr, TcpListener};
use std::process::ExitCode;

use clap::Parser;
use confinement::{Rights, Sockets, confine};
use opcua::server::{ServerBuilder, ServerHandle};
use telemetry::{Cell, Update};
use tracing_subscriber::EnvFilter;

use manager::CellManager;
use space::Space;

/// Wrong input.
const BAD_INPUT: u8 = 2;
/// What the stack says of certificates, which are not used, is left out.
const LOG: &str =
    "error,opcua_crypto=off,opcua_core::comms::secure_channel=off,opcua_server::server=off";

/// ms after which a request for news is answered by a fault; clients that hear it ask again.
const PUBLISH_TIMEOUT: u64 = 3_600_000;

/// Serves what a cell measures to clients of OPC UA: `probecell opcua` starts it.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Address to listen on; port 0 takes a free one.
    #[arg(long)]
    listen: SocketAddr,
}

fn main() -> ExitCode {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(LOG));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(text) => {
            #[expect(clippy::print_stderr, reason = "the one sentence of a failure")]
            {
                eprintln!("probecell-opcua: {text}");
            }
            ExitCode::from(BAD_INPUT)
        }
    }
}

/// What was told before clients may come: the cell, and what there is already; `None`: standard input has ended.
fn begin(input: &mut StdinLock<'_>) -> Result<Option<(Cell, Vec<Update>)>, String> {
    let (mut cell, mut before) = (Cell::default(), Vec::new());
    let mut line = String::new();
    while input
        .read_line(&mut line)
        .map_err(|error| error.to_string())?
        != 0
    {
        match read(&line)? {
            Update::Cell(one) => cell = one,
            Update::Listen => return Ok(Some((cell, before))),
            update => before.push(update),
        }
        line.clear();
    }
    Ok(None)
}

fn read(line: &str) -> Result<Update, String> {
    telemetry::read(line)
        .map_err(|error| format!("a line of standard input is not an update: {error}"))
}

fn run(arguments: &Arguments) -> Result<(), String> {
    let mut input = std::io::stdin().lock();
    let Some((cell, before)) = begin(&mut input)? else {
        return Ok(());
    };
    let failed = |error: std::io::Error| format!("cannot listen on {}: {error}", arguments.listen);
    let listener = TcpListener::bind(arguments.listen).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let sockets = Sockets {
        tcp: true,
        listens: true,
        ..Sockets::default()
    };
    confine(&Rights::default().with_sockets(sockets)).map_err(|error| error.to_string())?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(failed)?;
    // Building the server begins tasks.
    let entered = runtime.enter();
    let (server, handle) = server(&cell, address)?;
    drop(entered);
    let manager = handle.node_managers().get_of_type::<CellManager>();
    let manager = manager.ok_or("the server has no nodes")?;
    let mut space = Space::new(manager, handle.subscriptions().clone());
    for update in before {
        space.take(update);
    }
    let serving = runtime.spawn(async move {
        let listener = tokio::net::TcpListener::from_std(listener);
        server
            .run_with(listener.map_err(|error| error.to_string())?)
            .await
    });
    say(&format!(
        "OPC UA server of cell {}: opc.tcp://{address}/",
        cell.name
    ));
    let read = updates(&mut input, &mut space);
    end(&handle);
    let served = runtime
        .block_on(serving)
        .map_err(|error| error.to_string())?;
    read.and(served)
}

/// Takes lines until there are no more.
fn updates(input: &mut StdinLock<'_>, space: &mut Space) -> Result<(), String> {
    let mut line = String::new();
    while input
        .read_line(&mut line)
        .map_err(|error| error.to_string())?
        != 0
    {
        space.take(read(&line)?);
        line.clear();
    }
    Ok(())
}

fn end(handle: &ServerHandle) {
    handle.cancel();
}

fn say(text: &str) {
    // Who started it may not listen.
    drop(writeln!(std::io::stdout().lock(), "{text}"));
}

/// No endpoint but one without security, for anonymous users. Nothing asks for a key, so that none is made or read.
fn server(
    cell: &Cell,
    address: SocketAddr,
) -> Result<(opcua::server::Server, ServerHandle), String> {
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
}
