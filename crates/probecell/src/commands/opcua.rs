//! `probecell opcua`: a running cell, or a recording, as an OPC UA server.
//!
//! ```text
//! bus or recording --> this process --> lines of JSON on standard input --> probecell-opcua --> clients
//! ```
//!
//! The server is a program of its own ([ADR 0018](../../../docs/adr/0018-opc-ua-is-a-process-of-its-own.md)). It has neither the
//! bus nor a key of the cell, and this process listens nowhere.

use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context, bail};
use bags::Bag;
use cell::Cell;
use controllers::driver::Role;
use exchange::export::opcua::Results;
use graph::topics::{self, Topic};
use probecell_msgs::{CdrError, from_cdr};
use telemetry::Update;

use super::{companion, dashboard, following::follow};
use crate::{DEFAULT_CELL, FAILED, GOOD, confined, output, signals};

/// Name of the program.
const PROGRAM: &str = "probecell-opcua";
/// The port that servers use.
const ADDRESS: &str = "127.0.0.1:4840";
/// What is read of the cell.
const READ: [Topic; 7] = [
    topics::MACHINE_STATE,
    topics::INSPECTION_PLAN,
    topics::FEATURE_RESULTS,
    topics::VERDICTS,
    topics::PASS_DECISIONS,
    topics::PART_REPORTS,
    topics::GAP_REPORT,
];

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    The cell of this folder:\n    \
    probecell opcua\n  \
    Its recordings:\n    \
    probecell opcua --bag recordings/turn_mill_1\n\n\
    The program probecell-opcua is looked for beside this one, then on PATH; it is built by `cargo build --release` in the folder\n\
    opcua. What it serves: docs/exchange.md.")]
pub(crate) struct Arguments {
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

/// Where the lines go; none once the server is to end.
type Line = Arc<Mutex<Option<ChildStdin>>>;

fn lock<T>(one: &Mutex<T>) -> MutexGuard<'_, T> {
    one.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves until SIGINT or SIGTERM, or until the server ends.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let address = arguments.listen;
    if !address.ip().is_loopback() && !arguments.unencrypted {
        bail!(
            "--listen {address}: connections are not encrypted, so only loopback is served (127.0.0.1:PORT); --unencrypted listens there nevertheless"
        );
    }
    match &arguments.bag {
        Some(path) => recording(address, path),
        None => running(address, &arguments.cell),
    }
}

fn recording(address: SocketAddr, path: &Path) -> anyhow::Result<u8> {
    let bag = Bag::open(path)?;
    let damage = bag.verify();
    let namespace = session_io::record::namespace(&bag, path)?;
    let name = namespace.trim_start_matches('/');
    let cell = session_io::embedded::cell(&bag)?;
    let mut results = Results::new(name, cell.as_ref().map(is_simulated));
    let topics = READ.map(|topic| format!("{namespace}/{}", topic.name));
    let names = topics.each_ref().map(String::as_str);
    let mut lines = Vec::new();
    for message in bag.messages_on(&names).flatten() {
        let topic = &message.channel.topic[namespace.len() + 1..];
        let told = take(&mut results, topic, &message.payload)
            .with_context(|| format!("{}: {topic}", path.display()))?;
        lines.extend(told);
    }
    let (mut server, line) = start(address)?;
    begin(&line, name, lines);
    confined::server(&[], &[], &[path.to_owned()])?;
    let status = wait(&mut server, &line)?;
    Ok(if status == GOOD {
        output::damage(&damage)
    } else {
        status
    })
}

fn running(address: SocketAddr, path: &Path) -> anyhow::Result<u8> {
    let cell = Cell::read(path)?;
    let bus = dashboard::buses(std::slice::from_ref(&cell), Vec::new(), 0)?;
    let bus = bus.into_iter().next().context("the cell has no bus")?;
    let (mut server, line) = start(address)?;
    confined::server(std::slice::from_ref(&cell), std::slice::from_ref(&bus), &[])?;
    let name = cell.cell.name.clone();
    begin(&line, &name, Vec::new());
    let results = Arc::new(Mutex::new(Results::new(&name, Some(is_simulated(&cell)))));
    std::thread::Builder::new()
        .name("opcua bus".to_owned())
        .spawn({
            let line = Arc::clone(&line);
            move || -> () {
                let (heard, heard_line) = (Arc::clone(&results), Arc::clone(&line));
                follow(
                    &bus,
                    &name,
                    &READ,
                    move |topic, payload| {
                        let mut results = lock(&heard);
                        match take(&mut results, topic, payload) {
                            Ok(told) => tell(&heard_line, told),
                            Err(error) => {
                                tracing::warn!(%topic, %error, "a message cannot be decoded as the type of its topic");
                            }
                        }
                    },
                    move |is_present| {
                        let mut results = lock(&results);
                        tell(&line, results.present(host::now().0, is_present));
                    },
                )
            }
        })?;
    wait(&mut server, &line)
}

/// Whether nothing moves that is made of metal.
fn is_simulated(cell: &Cell) -> bool {
    matches!(cell.driver_role(), Role::Node(_))
}

/// What a message changes.
fn take(results: &mut Results, topic: &str, payload: &[u8]) -> Result<Vec<Update>, CdrError> {
    let one = match topic {
        _ if topic == topics::MACHINE_STATE.name => results.machine(&from_cdr(payload)?),
        _ if topic == topics::INSPECTION_PLAN.name => {
            results.plan(from_cdr(payload)?);
            None
        }
        _ if topic == topics::FEATURE_RESULTS.name => results.result(from_cdr(payload)?),
        _ if topic == topics::VERDICTS.name => results.verdict(from_cdr(payload)?),
        _ if topic == topics::PASS_DECISIONS.name => results.decision(&from_cdr(payload)?),
        _ if topic == topics::GAP_REPORT.name => Some(results.gap(&from_cdr(payload)?)),
        _ => return Ok(results.report(&from_cdr(payload)?)),
    };
    Ok(one.into_iter().collect())
}

fn start(address: SocketAddr) -> anyhow::Result<(Child, Line)> {
    let mut command = Command::new(companion::program(PROGRAM));
    command.arg("--listen").arg(address.to_string());
    let server = command.stdin(Stdio::piped()).spawn();
    let mut server = server.map_err(|error| companion::not_started(PROGRAM, "opcua", error))?;
    let line = Arc::new(Mutex::new(server.stdin.take()));
    Ok((server, line))
}

/// Whose results, what there is already, and that it is to listen.
fn begin(line: &Line, name: &str, told: Vec<Update>) {
    let cell = Update::Cell(telemetry::Cell {
        name: name.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
    });
    tell(
        line,
        std::iter::once(cell).chain(told).chain([Update::Listen]),
    );
}

/// Hands lines to the server. One that has ended is noticed by who waits for it.
fn tell(line: &Line, told: impl IntoIterator<Item = Update>) {
    let mut line = lock(line);
    for update in told {
        if let Some(pipe) = line.as_mut()
            && pipe.write_all(telemetry::line(&update).as_bytes()).is_err()
        {
            *line = None;
        }
    }
}

/// Waits for the server, which ends with its standard input: at SIGINT and SIGTERM.
fn wait(server: &mut Child, line: &Line) -> anyhow::Result<u8> {
    let is_asked = Arc::new(AtomicBool::new(false));
    signals::on_end({
        let (line, is_asked) = (Arc::clone(line), Arc::clone(&is_asked));
        move || {
            is_asked.store(true, Ordering::SeqCst);
            *lock(&line) = None;
        }
    })?;
    let status = server.wait()?;
    if is_asked.load(Ordering::SeqCst) {
        return Ok(GOOD);
    }
    let status = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(status.unwrap_or(FAILED))
}
