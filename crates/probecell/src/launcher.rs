//! Starts a cell, supervises its processes, and stops it.
//!
//! The launcher embeds the Zenoh router, so that nothing else has to be installed or started, or uses the one that answers
//! at its endpoint and takes its place when it is gone. Each node is a process of its own, in a process group of its own, so
//! that Ctrl-C reaches the launcher alone; one that dies is restarted after a delay that doubles each time. At the end the
//! part that is being made is stopped and reported, then the nodes are stopped, and the recorder last, so that every message
//! is in the bag.

use std::{
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::{Child, Command},
    sync::{Arc, atomic::AtomicBool, atomic::Ordering},
    time::{Duration, Instant},
};

use anyhow::Context;
use cell::{Cell, Strangers, TransportName, keys::KeyFolder};
use host::{bus::Bus, clock::WallClock};
use rustix::process::{Pid, Signal, kill_process};

use crate::{
    FAILED, GOOD, LOSS,
    cell_bus::{CellFailure, bus_config, has_own_socket, new_recording, users},
    commands,
    external_driver::{ExternalDriver, News},
    operator::{Operator, ProcessState},
    output,
    routing::Routing,
    signals,
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
/// Time in which a session that has joined discovers the other nodes.
const DISCOVERY: Duration = Duration::from_secs(1);
/// Timeout of a cell to become ready for its first part.
const READY_TIMEOUT: Duration = Duration::from_secs(30);

/// Runs a cell until SIGINT or SIGTERM, or until one part is made. A part that is being made is stopped first, and its end
/// is recorded.
pub(crate) fn up(file: &Path, once: bool, recorded: bool, shown: bool) -> anyhow::Result<u8> {
    let cell = Cell::read(file)?;
    for warning in cell.access_warnings() {
        output::remark(&format!("warning: {warning}"));
    }
    // Made before any process asks for them.
    KeyFolder::of(&cell)?.private()?;
    let end = signals::end_flag()?;
    let mut routing = Routing::start(&cell)?;
    let bus = Bus::open(
        &bus_config(&cell, "operator")?,
        "operator",
        &cell.namespace(),
    )?;
    // Nobody else is on a bus whose router has only just been started.
    if !routing.is_own() {
        refuse_second(&bus, &cell)?;
    }
    if routing.is_foreign() {
        if users(&cell)?.is_some() {
            anyhow::bail!(
                "{}: the cell is secured, but another router answers at {}, which does not have its policy: end that one, \
                 or set bus.router_endpoint",
                cell.text().name,
                cell.bus.router_endpoint
            );
        }
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
    if shown
        && cell.bus.transport == TransportName::Zenoh
        && let Err(error) = processes.start_dashboard()
    {
        output::remark(&format!("no dashboard: {error:#}"));
    }
    for name in cell.node_names().into_iter().chain(cell.driver_process()) {
        processes.start(name)?;
    }
    let mut operator = Operator::join(bus, &cell)?;
    if !recorded {
        operator.waive_recording(&cell.namespace())?;
    }
    operator.publish_keys();
    if has_own_socket(&cell)? && cell.bus.strangers == Strangers::Write {
        let text = "bus.strangers = \"write\": any program that reaches the bus commands the cell";
        output::remark(&format!("warning: {text}"));
        operator.warn("bus_open", text);
    }
    if cell.approvals.unsigned_operators {
        let text = "approvals.unsigned_operators = true: whoever reaches the bus approves corrections in any name";
        output::remark(&format!("warning: {text}"));
        operator.warn("approvals_unsigned", text);
    }
    let outcome = watch(
        &mut processes,
        &mut operator,
        &cell,
        &mut routing,
        once,
        &end,
    );
    end_part(&mut processes, &operator);
    let lost = processes.end_all()?;
    operator.leave()?;
    routing.close()?;
    if let Some(folder) = &recording {
        output::line(&format!("recorded in {}", folder.display()));
    }
    outcome.map(|status| if lost && status == GOOD { LOSS } else { status })
}

/// A cell of this name that runs on the bus already would share every topic with this one.
fn refuse_second(bus: &Bus, cell: &Cell) -> anyhow::Result<()> {
    let own = format!("{}/operator", cell.namespace());
    let deadline = Instant::now() + DISCOVERY;
    while Instant::now() < deadline {
        let nodes = bus.graph().nodes();
        if nodes.iter().filter(|name| **name == own).count() > 1 {
            anyhow::bail!(
                "{}: cell.name = {:?}: a cell of this name runs on this bus already",
                cell.text().name,
                cell.cell.name
            );
        }
        std::thread::sleep(PERIOD);
    }
    Ok(())
}

/// Stops the part that is being made, and waits for its report.
fn end_part(processes: &mut Processes, operator: &Operator) {
    if !operator.is_making() {
        return;
    }
    if let Err(failure) = operator.stop("up, which ends") {
        output::remark(&format!(
            "the machine has not confirmed that it stands: {failure}"
        ));
    }
    let deadline = Instant::now() + END_TIMEOUT;
    while operator.is_making() && Instant::now() < deadline {
        // A process that ends now is not started again.
        if processes.supervise(false).is_err() {
            return;
        }
        std::thread::sleep(PERIOD);
    }
}

fn watch(
    processes: &mut Processes,
    operator: &mut Operator,
    cell: &Cell,
    routing: &mut Routing,
    once: bool,
    end: &Arc<AtomicBool>,
) -> anyhow::Result<u8> {
    let mut requested = false;
    let mut driver = ExternalDriver::of(cell);
    if let Some(driver) = &driver {
        output::remark(&driver.waiting());
    }
    let mut deadline = Instant::now() + READY_TIMEOUT;
    let mut wall = WallClock::read();
    while !end.load(Ordering::SeqCst) {
        for (name, text) in processes.supervise(true)? {
            operator.report_ended(&name, &text);
        }
        routing.supervise();
        if let Some(step) = wall.stepped() {
            let direction = if step > 0.0 { "forward" } else { "back" };
            let text = format!(
                "the wall clock was set {direction} by {:.1} s; stamps of this cell go on without a step",
                step.abs()
            );
            output::remark(&text);
            operator.warn("clock_set", &text);
        }
        operator.publish_keys();
        let mut states = processes.states();
        if let Some(driver) = &mut driver {
            follow(driver, operator);
            // Others start it, whenever they like.
            if !driver.is_present() {
                deadline = Instant::now() + READY_TIMEOUT;
            }
            states.push(driver.state());
        }
        operator.publish_diagnostics(&states);
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

/// Tells what has become of an external driver. When it leaves, the part that is being made ends as with the driver of this
/// project.
fn follow(driver: &mut ExternalDriver, operator: &Operator) {
    match driver.look(|| operator.graph()) {
        None => {}
        Some(News::Joined(text)) => output::remark(&text),
        Some(News::Left(text)) => {
            output::remark(&text);
            operator.report_ended(&driver.state().name, &text);
        }
        Some(News::Wrong(text)) => {
            output::remark(&text);
            operator.warn("driver_wrong", &text);
        }
    }
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
    /// It only reads: the cell does not depend on it.
    dashboard: Option<Child>,
}

impl Processes {
    fn new(file: &Path, recorded: bool) -> Self {
        Self {
            file: file.to_owned(),
            recorded,
            nodes: Vec::new(),
            recorder: None,
            dashboard: None,
        }
    }

    /// The dashboard tells its address itself, or in a sentence why it does not run; the cell runs in any case.
    fn start_dashboard(&mut self) -> anyhow::Result<()> {
        let mut command = Command::new(std::env::current_exe()?);
        command
            .args(commands::dashboard::arguments(&self.file))
            .process_group(0);
        let child = command.spawn().context("cannot start the dashboard")?;
        self.dashboard = Some(child);
        Ok(())
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
                "--clock",
                &host::clock::offset().to_string(),
                "--cell",
            ])
            .arg(&self.file)
            .process_group(0);
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
            .args([
                "record",
                "--supervised",
                "--clock",
                &host::clock::offset().to_string(),
                "--cell",
            ])
            .process_group(0)
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

    /// Finds processes that have died, and restarts nodes when their delay is over, if they are to be. Gives the name of each
    /// that has died since the last call, with a sentence.
    fn supervise(&mut self, restarted: bool) -> anyhow::Result<Vec<(String, String)>> {
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
                Some(at) if restarted && Instant::now() >= at => {
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
        if let Some(dashboard) = &mut self.dashboard {
            terminate(dashboard);
            wait_for_end(dashboard)?;
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
        let supervised = self.nodes.iter_mut().chain(&mut self.recorder);
        let children = supervised.map(|process| &mut process.child);
        for child in children.chain(&mut self.dashboard) {
            if matches!(child.try_wait(), Ok(None)) {
                // Already gone, or not ours any more: nothing is left to do in either case.
                drop(child.kill());
                drop(child.wait());
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
