//! Starts a cell, supervises its processes, and stops it.
//!
//! The launcher embeds the Zenoh router, so that nothing else has to be installed or started. Each node is a process of its
//! own; one that dies is restarted after a delay that doubles each time. At the end the nodes are stopped first and the
//! recorder last, so that every message is in the bag.

use std::{
    path::{Path, PathBuf},
    process::{Child, Command},
    sync::{Arc, atomic::AtomicBool, atomic::Ordering},
    time::{Duration, Instant},
};

use anyhow::Context;
use cell::{Cell, TransportName};
use host::bus::{Bus, Router};
use rustix::process::{Pid, Signal, kill_process};

use crate::{
    FAILED, GOOD, LOSS,
    cell_bus::{CellFailure, bus_config, new_recording, router_config},
    operator::{Operator, ProcessState},
    output, signals,
};

/// Name of the process that records.
const RECORDER: &str = "recorder";
/// Supervision period.
const PERIOD: Duration = Duration::from_millis(20);
/// Delay before a dead process is restarted; it doubles each time, up to the longest.
const FIRST_DELAY: Duration = Duration::from_millis(200);
const LONGEST_DELAY: Duration = Duration::from_secs(10);
/// A process that does not end within this time is killed.
const END_TIMEOUT: Duration = Duration::from_secs(10);
/// Timeout of a cell to become ready for its first part.
const READY_TIMEOUT: Duration = Duration::from_secs(30);

/// Runs a cell until SIGINT or SIGTERM, or until one part is made.
pub(crate) fn up(file: &Path, once: bool, recorded: bool) -> anyhow::Result<u8> {
    let cell = Cell::read(file)?;
    for warning in cell.access_warnings() {
        output::remark(&format!("warning: {warning}"));
    }
    let end = signals::end_flag()?;
    let router = start_router(&cell)?;
    let bus = Bus::open(&bus_config(&cell)?, "operator", &cell.namespace())?;
    if router.is_none() && cell.bus.transport == TransportName::Zenoh {
        let endpoint = &cell.bus.router_endpoint;
        output::remark(&format!(
            "a router answers at {endpoint}: this cell uses it"
        ));
    }
    let recording = recorded.then(|| new_recording(&cell));
    let mut processes = Processes::new(file, recorded);
    if let Some(folder) = &recording {
        processes.start_recorder(folder)?;
    }
    for name in cell.node_names().into_iter().chain(cell.driver_process()) {
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
        output::line(&format!("recorded in {}", folder.display()));
    }
    outcome.map(|status| if lost && status == GOOD { LOSS } else { status })
}

fn start_router(cell: &Cell) -> anyhow::Result<Option<Router>> {
    if cell.bus.transport == TransportName::Dds {
        return Ok(None);
    }
    let config = router_config(cell)?;
    // A router may run there already: zenohd, rmw_zenoh's router, that of another cell, or one on another machine.
    if host::endpoint_answers(&cell.bus.router_endpoint) {
        return Ok(None);
    }
    Ok(Some(Router::start(&config)?))
}

fn watch(
    processes: &mut Processes,
    operator: &Operator,
    cell: &Cell,
    once: bool,
    end: &Arc<AtomicBool>,
) -> anyhow::Result<u8> {
    let mut requested = false;
    let deadline = Instant::now() + READY_TIMEOUT;
    while !end.load(Ordering::SeqCst) {
        for (name, text) in processes.supervise()? {
            operator.report_ended(&name, &text);
        }
        let states = processes.states();
        operator.publish_diagnostics(&states);
        if once && requested {
            check_cycle(&states)?;
        }
        if let Some(verdict) = operator.part_ended().filter(|_| once) {
            return Ok(if verdict.qualified { GOOD } else { FAILED });
        }
        if !requested && operator.ready() {
            if once {
                operator.request_part(&cell.cell.part)?;
            } else {
                output::line(&format!(
                    "{} is ready: probecell run PART --cell {}",
                    cell.cell.name,
                    cell.text().name
                ));
            }
            requested = true;
        } else if once && !requested && Instant::now() > deadline {
            let text = format!(
                "the cell was not ready within {} s: {}",
                READY_TIMEOUT.as_secs(),
                operator.not_ready()
            );
            return Err(CellFailure(text).into());
        }
        std::thread::sleep(PERIOD);
    }
    Ok(if once { FAILED } else { GOOD })
}

/// Without this node the part under way is lost, and its end is never reported.
fn check_cycle(states: &[ProcessState]) -> anyhow::Result<()> {
    let mut states = states.iter();
    let cycle = states.find(|state| state.name == "cycle");
    if cycle.is_some_and(|cycle| !cycle.running || cycle.starts > 1) {
        let text = "cycle ended while the part was made; the part is lost".to_owned();
        return Err(CellFailure(text).into());
    }
    Ok(())
}

struct Supervised {
    name: String,
    child: Child,
    starts: u32,
    delay: Duration,
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
            delay: FIRST_DELAY,
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
            delay: FIRST_DELAY,
            restart_at: None,
        });
        Ok(())
    }

    /// Finds processes that have died, and restarts nodes when their delay is over. Gives the name of each that has died since
    /// the last call, with a sentence.
    fn supervise(&mut self) -> anyhow::Result<Vec<(String, String)>> {
        let mut ended = Vec::new();
        for index in 0..self.nodes.len() {
            let node = &mut self.nodes[index];
            match node.restart_at {
                None => {
                    if let Some(status) = node.child.try_wait()? {
                        // A wrong setting stays wrong at the next attempt.
                        if status.code() == Some(i32::from(crate::BAD_INPUT)) {
                            return Err(CellFailure(format!(
                                "{} cannot run: see the error above",
                                node.name
                            ))
                            .into());
                        }
                        let text = format!("{} ended ({status}); restarting it", node.name);
                        output::remark(&text);
                        ended.push((node.name.clone(), text));
                        node.restart_at = Some(Instant::now() + node.delay);
                        node.delay = (node.delay * 2).min(LONGEST_DELAY);
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
            return Err(CellFailure(format!(
                "the recorder ended ({status}): the cell is stopped, for it must not run unrecorded"
            ))
            .into());
        }
        Ok(ended)
    }

    /// The state of each process.
    fn states(&self) -> Vec<ProcessState> {
        let all = self.nodes.iter().chain(&self.recorder);
        all.map(|process| ProcessState {
            name: process.name.clone(),
            running: process.restart_at.is_none(),
            starts: process.starts,
        })
        .collect()
    }

    /// Stops the nodes, then the recorder. True when the recorder lost something.
    fn end_all(&mut self) -> anyhow::Result<bool> {
        for node in &mut self.nodes {
            terminate(&mut node.child);
        }
        for node in &mut self.nodes {
            wait_for_end(&mut node.child)?;
        }
        let Some(recorder) = &mut self.recorder else {
            return Ok(false);
        };
        terminate(&mut recorder.child);
        let code = wait_for_end(&mut recorder.child)?;
        Ok(code != Some(0))
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        for process in self.nodes.iter_mut().chain(&mut self.recorder) {
            if matches!(process.child.try_wait(), Ok(None)) {
                // Already gone, or not ours any more: nothing is left to do in either case.
                drop(process.child.kill());
                drop(process.child.wait());
            }
        }
    }
}

fn terminate(child: &mut Child) {
    if matches!(child.try_wait(), Ok(None))
        && let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw)
    {
        // It may have ended between the two lines; then there is nothing to signal.
        kill_process(pid, Signal::TERM).unwrap_or_default();
    }
}

fn wait_for_end(child: &mut Child) -> anyhow::Result<Option<i32>> {
    let deadline = Instant::now() + END_TIMEOUT;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status.code());
        }
        if Instant::now() > deadline {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(PERIOD);
    }
}
