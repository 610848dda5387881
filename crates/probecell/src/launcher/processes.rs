//! The processes of a cell: how each is started, restarted after it has died, and ended.

use std::{
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus},
    time::{Duration, Instant},
};

use anyhow::Context;
use host::clock::CellClock;

use crate::{
    cell_bus::CellFailure,
    commands,
    operator::ProcessState,
    output, ros_arguments,
    signals::{terminate, wait_for_end},
};

/// Supervision period.
pub(super) const PERIOD: Duration = Duration::from_millis(20);
/// A process that does not end within this time is killed.
pub(super) const END_TIMEOUT: Duration = Duration::from_secs(10);
/// Name of the process that records.
const RECORDER: &str = "recorder";
/// Name of the process that serves the pages.
const DASHBOARD: &str = "dashboard";
/// Delay before a dead process is restarted; it doubles each time, up to the longest.
const FIRST_DELAY: Duration = Duration::from_millis(200);
const LONGEST_DELAY: Duration = Duration::from_secs(10);

/// A process, and its restarts.
struct Supervised {
    name: String,
    child: Child,
    starts: u32,
    delay: Duration,
    restart_at: Option<Instant>,
}

impl Supervised {
    fn new(name: &str, child: Child) -> Self {
        Self {
            name: name.to_owned(),
            child,
            starts: 1,
            delay: FIRST_DELAY,
            restart_at: None,
        }
    }

    /// How it has ended since the last call; it is to be started again after a delay.
    fn ended(&mut self) -> anyhow::Result<Option<ExitStatus>> {
        if self.restart_at.is_some() {
            return Ok(None);
        }
        let Some(status) = self.child.try_wait()? else {
            return Ok(None);
        };
        self.restart_at = Some(Instant::now() + self.delay);
        self.delay = (self.delay * 2).min(LONGEST_DELAY);
        Ok(Some(status))
    }

    fn is_due(&self) -> bool {
        self.restart_at.is_some_and(|at| Instant::now() >= at)
    }

    fn restarted(&mut self, child: Child) {
        self.child = child;
        self.starts += 1;
        self.restart_at = None;
    }

    /// The sentence that says how it ended.
    fn end_text(&self, status: ExitStatus) -> String {
        format!("{} ended ({status}); restarting it", self.name)
    }
}

/// A setting that is wrong stays so at the next attempt.
fn is_of_input(status: ExitStatus) -> bool {
    status.code() == Some(i32::from(crate::BAD_INPUT))
}

/// The processes of a cell.
pub(super) struct Processes {
    file: PathBuf,
    recorded: bool,
    nodes: Vec<Supervised>,
    recorder: Option<Supervised>,
    /// It only reads: the cell does not depend on it.
    dashboard: Option<Supervised>,
}

impl Processes {
    pub(super) fn new(file: &Path, recorded: bool) -> Self {
        Self {
            file: file.to_owned(),
            recorded,
            nodes: Vec::new(),
            recorder: None,
            dashboard: None,
        }
    }

    /// The dashboard prints its address itself, or why it does not run; the cell runs in any case.
    pub(super) fn start_dashboard(&mut self) -> anyhow::Result<()> {
        let child = self.spawn_dashboard()?;
        self.dashboard = Some(Supervised::new(DASHBOARD, child));
        Ok(())
    }

    fn spawn_dashboard(&self) -> anyhow::Result<Child> {
        let mut command = Command::new(std::env::current_exe()?);
        command
            .args(commands::dashboard::arguments(&self.file))
            .args(ros_arguments::words())
            .process_group(0);
        command.spawn().context("cannot start the dashboard")
    }

    pub(super) fn start(&mut self, name: &str) -> anyhow::Result<()> {
        let child = self.spawn_node(name, 0)?;
        self.nodes.push(Supervised::new(name, child));
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
                &CellClock::of_this_process().to_string(),
                "--cell",
            ])
            .arg(&self.file)
            .process_group(0);
        if !self.recorded {
            command.arg("--no-record");
        }
        command
            .args(ros_arguments::words())
            .spawn()
            .with_context(|| format!("cannot start the process of {name}"))
    }

    pub(super) fn start_recorder(&mut self, folder: &Path) -> anyhow::Result<()> {
        let mut command = Command::new(std::env::current_exe()?);
        command
            .args([
                "record",
                "--supervised",
                "--clock",
                &CellClock::of_this_process().to_string(),
                "--cell",
            ])
            .process_group(0)
            .arg(&self.file)
            .arg("--folder")
            .arg(folder)
            .args(ros_arguments::words());
        let child = command.spawn().context("cannot start the recorder")?;
        self.recorder = Some(Supervised::new(RECORDER, child));
        Ok(())
    }

    /// Finds processes that have died, and restarts nodes when their delay is over, if they are to be. Gives the name of each
    /// that has died since the last call, with a sentence.
    pub(super) fn supervise(&mut self, restarted: bool) -> anyhow::Result<Vec<(String, String)>> {
        let mut ended = Vec::new();
        for index in 0..self.nodes.len() {
            let node = &mut self.nodes[index];
            if let Some(status) = node.ended()? {
                if is_of_input(status) {
                    let text = format!("{} cannot run: see the error above", node.name);
                    return Err(CellFailure(text).into());
                }
                let text = node.end_text(status);
                output::warning(&text);
                ended.push((node.name.clone(), text));
            } else if restarted && node.is_due() {
                let (name, starts) = (node.name.clone(), node.starts);
                let child = self.spawn_node(&name, starts)?;
                self.nodes[index].restarted(child);
            }
        }
        self.supervise_dashboard(restarted)?;
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

    /// Pages are not of the cell: their end stops no part, and where they cannot be served the cell goes on without.
    fn supervise_dashboard(&mut self, restarted: bool) -> anyhow::Result<()> {
        let Some(dashboard) = &mut self.dashboard else {
            return Ok(());
        };
        if let Some(status) = dashboard.ended()? {
            if is_of_input(status) {
                self.dashboard = None;
            } else {
                output::warning(&dashboard.end_text(status));
            }
        } else if restarted && dashboard.is_due() {
            let child = self.spawn_dashboard()?;
            if let Some(dashboard) = &mut self.dashboard {
                dashboard.restarted(child);
            }
        }
        Ok(())
    }

    /// The state of each process.
    pub(super) fn states(&self) -> Vec<ProcessState> {
        let beside = self.recorder.iter().chain(&self.dashboard);
        let all = self.nodes.iter().chain(beside);
        all.map(|process| ProcessState {
            name: process.name.clone(),
            running: process.restart_at.is_none(),
            starts: process.starts,
        })
        .collect()
    }

    /// Stops the nodes, then the recorder. True when the recorder lost something.
    pub(super) fn end_all(&mut self) -> anyhow::Result<bool> {
        for node in &mut self.nodes {
            terminate(&mut node.child);
        }
        for node in &mut self.nodes {
            wait_for_end(&mut node.child, END_TIMEOUT)?;
        }
        if let Some(dashboard) = &mut self.dashboard {
            terminate(&mut dashboard.child);
            wait_for_end(&mut dashboard.child, END_TIMEOUT)?;
        }
        let Some(recorder) = &mut self.recorder else {
            return Ok(false);
        };
        terminate(&mut recorder.child);
        let code = wait_for_end(&mut recorder.child, END_TIMEOUT)?;
        Ok(code != Some(0))
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        let beside = self.recorder.iter_mut().chain(&mut self.dashboard);
        for child in (self.nodes.iter_mut().chain(beside)).map(|process| &mut process.child) {
            if matches!(child.try_wait(), Ok(None)) {
                // Already gone, or not ours any more: nothing is left to do in either case.
                drop(child.kill());
                drop(child.wait());
            }
        }
    }
}
