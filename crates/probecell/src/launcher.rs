//! Starts a cell, watches its processes, and ends it.
//!
//! The launcher carries the Zenoh router inside itself, so that nothing else has to be installed or started. Each node
//! is a process of its own; one that dies is started again, after a pause that grows. At the end the nodes leave first
//! and the recorder last, so that everything that was said is in the bag.

use std::{
    path::{Path, PathBuf},
    process::{Child, Command},
    sync::{Arc, atomic::AtomicBool, atomic::Ordering},
    time::{Duration, Instant},
};

use anyhow::Context;
use cell::{Cell, Source, TransportName};
use host::bus::{Bus, BusConfig, Router, RouterConfig, Transport};
use rustix::process::{Pid, Signal, kill_process};

use crate::{FAILED, GOOD, LOSS, operator::Operator, report, signals};

/// Name of the process that drives LinuxCNC.
pub(crate) const LINUXCNC: &str = "linuxcnc";
/// Name of the process that records.
const RECORDER: &str = "recorder";
/// Between two looks at the processes.
const LOOK: Duration = Duration::from_millis(20);
/// First pause before a dead process is started again; it doubles each time, up to the last.
const FIRST_PAUSE: Duration = Duration::from_millis(200);
const LAST_PAUSE: Duration = Duration::from_secs(10);
/// A process that does not end within this time is killed.
const END_PATIENCE: Duration = Duration::from_secs(10);
/// How long a cell may take to be ready for its first part.
const READY_PATIENCE: Duration = Duration::from_secs(30);

/// Something of the running cell failed, as against a wrong input.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Failed(pub(crate) String);

/// How a process of the cell joins the bus.
pub(crate) fn bus_config(cell: &Cell) -> anyhow::Result<BusConfig> {
    Ok(BusConfig {
        transport: match cell.bus.transport {
            TransportName::Zenoh => Transport::Zenoh,
            TransportName::Dds => Transport::Dds,
        },
        domain_id: cell.bus.domain_id,
        endpoints: vec![cell.bus.router_endpoint.clone()],
        listen: cell.bus.listen.clone(),
        zenoh: session_settings(cell)?,
        ..BusConfig::default()
    })
}

/// What the cell file says of every session. Where the router controls access, nothing goes past it: sessions are clients
/// then, which link to nobody but the router.
fn session_settings(cell: &Cell) -> anyhow::Result<serde_json::Value> {
    let mut settings = zenoh_settings(cell.bus.zenoh.as_ref())?;
    let router = zenoh_settings(cell.bus.router_zenoh.as_ref())?;
    if router.get("access_control").is_some() && settings.get("mode").is_none() {
        settings["mode"] = "client".into();
    }
    Ok(settings)
}

fn zenoh_settings(table: Option<&impl serde::Serialize>) -> anyhow::Result<serde_json::Value> {
    Ok(table
        .map(serde_json::to_value)
        .transpose()?
        .unwrap_or_else(|| serde_json::json!({})))
}

/// The folder of the next recording: the cell's name and the time, in the cell's folder of recordings.
pub(crate) fn new_recording(cell: &Cell) -> PathBuf {
    let stamp = host::now().0 / 1_000_000;
    cell.recorder
        .folder
        .join(format!("{}_{stamp}", cell.cell.name))
}

/// Runs a cell until it is told to end, or until one part is made.
pub(crate) fn up(file: &Path, once: bool, recorded: bool) -> anyhow::Result<u8> {
    let cell = Cell::read(file)?;
    let end = signals::end_flag()?;
    let router = start_router(&cell)?;
    let bus = Bus::open(&bus_config(&cell)?, "operator", &cell.namespace())?;
    if router.is_none() && cell.bus.transport == TransportName::Zenoh {
        let endpoint = &cell.bus.router_endpoint;
        report::remark(&format!(
            "a router answers at {endpoint}: this cell joins it"
        ));
    }
    let recording = recorded.then(|| new_recording(&cell));
    let mut processes = Processes::new(file, recorded);
    if let Some(folder) = &recording {
        processes.start_recorder(folder)?;
    }
    for name in process_names(&cell) {
        processes.start(name)?;
    }
    let operator = Operator::join(bus, &cell)?;
    let outcome = watch(&mut processes, &operator, &cell, once, &end);
    let lost = processes.end_all()?;
    operator.leave()?;
    if let Some(router) = router {
        router.close()?;
    }
    if let Some(folder) = &recording {
        report::line(&format!("recorded in {}", folder.display()));
    }
    outcome.map(|status| if lost && status == GOOD { LOSS } else { status })
}

/// The router that a cell carries inside itself.
pub(crate) fn router_config(cell: &Cell) -> anyhow::Result<RouterConfig> {
    Ok(RouterConfig {
        listen: vec![cell.bus.router_endpoint.clone()],
        connect: cell.bus.join.clone(),
        zenoh: zenoh_settings(cell.bus.router_zenoh.as_ref())?,
    })
}

fn start_router(cell: &Cell) -> anyhow::Result<Option<Router>> {
    if cell.bus.transport == TransportName::Dds {
        return Ok(None);
    }
    let config = router_config(cell)?;
    // Somebody may route there already: zenohd, rmw_zenoh's router, another cell, or a router on another machine.
    if host::endpoint_answers(&cell.bus.router_endpoint) {
        return Ok(None);
    }
    Ok(Some(Router::start(&config)?))
}

fn process_names(cell: &Cell) -> Vec<&'static str> {
    let mut names = cell.node_names();
    if cell.driver.source == Source::Linuxcnc {
        names.push(LINUXCNC);
    }
    names
}

fn watch(
    processes: &mut Processes,
    operator: &Operator,
    cell: &Cell,
    once: bool,
    end: &Arc<AtomicBool>,
) -> anyhow::Result<u8> {
    let mut asked = false;
    let deadline = Instant::now() + READY_PATIENCE;
    while !end.load(Ordering::SeqCst) {
        for (name, text) in processes.look()? {
            operator.tell_ended(&name, &text);
        }
        let states = processes.states();
        operator.tell_processes(&states);
        if once && asked {
            check_cycle(&states)?;
        }
        if let Some(verdict) = operator.part_ended().filter(|_| once) {
            return Ok(if verdict.qualified { GOOD } else { FAILED });
        }
        if !asked && operator.ready() {
            if once {
                operator.ask_for_part(&cell.cell.part)?;
            } else {
                report::line(&format!(
                    "{} is ready: probecell run PART --cell {}",
                    cell.cell.name,
                    cell.text().name
                ));
            }
            asked = true;
        } else if once && !asked && Instant::now() > deadline {
            let text = format!(
                "the cell was not ready within {} s: {}",
                READY_PATIENCE.as_secs(),
                operator.not_ready()
            );
            return Err(Failed(text).into());
        }
        std::thread::sleep(LOOK);
    }
    Ok(if once { FAILED } else { GOOD })
}

/// With this node the part under way is lost, and nobody is left who would report its end.
fn check_cycle(states: &[(String, bool, u32)]) -> anyhow::Result<()> {
    match states
        .iter()
        .find(|(name, runs, starts)| name == "cycle" && (!runs || *starts > 1))
    {
        Some((name, ..)) => Err(Failed(format!(
            "{name} ended while the part was made, and the part with it"
        ))
        .into()),
        None => Ok(()),
    }
}

struct Supervised {
    name: String,
    child: Child,
    starts: u32,
    pause: Duration,
    restart_at: Option<Instant>,
}

/// The processes of a cell.
struct Processes {
    file: PathBuf,
    recorded: bool,
    nodes: Vec<Supervised>,
    recorder: Option<Supervised>,
}

impl Processes {
    fn new(file: &Path, recorded: bool) -> Self {
        Self {
            file: file.to_owned(),
            recorded,
            nodes: Vec::new(),
            recorder: None,
        }
    }

    fn start(&mut self, name: &str) -> anyhow::Result<()> {
        let child = self.spawn_node(name, 0)?;
        let name = name.to_owned();
        self.nodes.push(Supervised {
            name,
            child,
            starts: 1,
            pause: FIRST_PAUSE,
            restart_at: None,
        });
        Ok(())
    }

    fn spawn_node(&self, name: &str, incarnation: u32) -> anyhow::Result<Child> {
        let mut command = Command::new(std::env::current_exe()?);
        command
            .args([
                "node",
                name,
                "--supervised",
                "--incarnation",
                &incarnation.to_string(),
                "--cell",
            ])
            .arg(&self.file);
        if !self.recorded {
            command.arg("--no-record");
        }
        command
            .spawn()
            .with_context(|| format!("cannot start the process of {name}"))
    }

    fn start_recorder(&mut self, folder: &Path) -> anyhow::Result<()> {
        let mut command = Command::new(std::env::current_exe()?);
        command
            .args(["record", "--supervised", "--cell"])
            .arg(&self.file)
            .arg("--folder")
            .arg(folder);
        let child = command.spawn().context("cannot start the recorder")?;
        let name = RECORDER.to_owned();
        self.recorder = Some(Supervised {
            name,
            child,
            starts: 1,
            pause: FIRST_PAUSE,
            restart_at: None,
        });
        Ok(())
    }

    /// Finds processes that have died, and starts nodes again when their pause is over. Gives the name of each that has
    /// died since the last look, and what is to be said of it.
    fn look(&mut self) -> anyhow::Result<Vec<(String, String)>> {
        let mut ended = Vec::new();
        for index in 0..self.nodes.len() {
            let node = &mut self.nodes[index];
            match node.restart_at {
                None => {
                    if let Some(status) = node.child.try_wait()? {
                        // A wrong setting does not get better by trying again.
                        if status.code() == Some(i32::from(crate::BAD_INPUT)) {
                            return Err(
                                Failed(format!("{} cannot run: see above", node.name)).into()
                            );
                        }
                        let text = format!("{} ended ({status}); it is started again", node.name);
                        report::remark(&text);
                        ended.push((node.name.clone(), text));
                        node.restart_at = Some(Instant::now() + node.pause);
                        node.pause = (node.pause * 2).min(LAST_PAUSE);
                    }
                }
                Some(at) if Instant::now() >= at => {
                    let (name, starts) = (node.name.clone(), node.starts);
                    let child = self.spawn_node(&name, starts)?;
                    let node = &mut self.nodes[index];
                    node.child = child;
                    node.starts += 1;
                    node.restart_at = None;
                }
                Some(_) => {}
            }
        }
        if let Some(recorder) = &mut self.recorder
            && let Some(status) = recorder.child.try_wait()?
        {
            return Err(Failed(format!(
                "the recorder ended ({status}): a cell does not run unrecorded"
            ))
            .into());
        }
        Ok(ended)
    }

    /// Name, whether it runs, and starts, of each process.
    fn states(&self) -> Vec<(String, bool, u32)> {
        let all = self.nodes.iter().chain(&self.recorder);
        all.map(|one| (one.name.clone(), one.restart_at.is_none(), one.starts))
            .collect()
    }

    /// Ends the nodes, then the recorder. True when the recorder lost something.
    fn end_all(&mut self) -> anyhow::Result<bool> {
        for node in &mut self.nodes {
            ask_to_end(&mut node.child);
        }
        for node in &mut self.nodes {
            wait_for_end(&mut node.child)?;
        }
        let Some(recorder) = &mut self.recorder else {
            return Ok(false);
        };
        ask_to_end(&mut recorder.child);
        let code = wait_for_end(&mut recorder.child)?;
        Ok(code != Some(0))
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        for one in self.nodes.iter_mut().chain(&mut self.recorder) {
            if matches!(one.child.try_wait(), Ok(None)) {
                // Already gone, or not ours any more: nothing is left to do in either case.
                drop(one.child.kill());
                drop(one.child.wait());
            }
        }
    }
}

fn ask_to_end(child: &mut Child) {
    if matches!(child.try_wait(), Ok(None))
        && let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw)
    {
        // It may have ended between the two lines; then there is nobody to ask.
        kill_process(pid, Signal::TERM).unwrap_or_default();
    }
}

fn wait_for_end(child: &mut Child) -> anyhow::Result<Option<i32>> {
    let deadline = Instant::now() + END_PATIENCE;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status.code());
        }
        if Instant::now() > deadline {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
}
