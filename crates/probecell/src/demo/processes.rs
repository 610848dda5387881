//! The processes of the hall, each in a process group of its own, so that Ctrl-C reaches the demo alone. What each prints goes to a
//! log in the folder of the demo.

use std::{
    fs::File,
    io::{BufRead, BufReader, Write},
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, channel},
    },
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, bail};

use crate::{
    cell_bus::CellFailure,
    signals::{terminate, wait_for_end},
};

/// Timeout of everything that is waited for, as of `diagnose --refine`: a machine that does nothing any more.
pub(super) const TIMEOUT: Duration = Duration::from_secs(900);
/// A process that does not end within this time is killed: a cell stops its part, then its nodes, then the recorder.
const END_TIMEOUT: Duration = Duration::from_secs(60);

type Shared = Arc<Mutex<Child>>;

/// The processes that run.
pub(super) struct Processes {
    folder: PathBuf,
    program: PathBuf,
    /// `None` once they have been ended.
    all: Mutex<Option<Vec<Shared>>>,
}

/// One of them.
pub(super) struct Process {
    name: String,
    log: PathBuf,
    child: Shared,
    lines: Receiver<String>,
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Processes {
    /// None yet; `folder` is where they run.
    pub(super) fn new(folder: &Path) -> anyhow::Result<Self> {
        Ok(Self {
            folder: folder.to_owned(),
            program: std::env::current_exe()?,
            all: Mutex::new(Some(Vec::new())),
        })
    }

    /// Starts this program with these words; `log`: name of its log.
    pub(super) fn start(&self, words: &[&str], log: &str) -> anyhow::Result<Process> {
        let log = self.folder.join(format!("{log}.log"));
        let mut file = File::options().create(true).append(true).open(&log)?;
        let mut all = lock(&self.all);
        let Some(running) = all.as_mut() else {
            bail!(CellFailure("the demo ends".to_owned()));
        };
        let mut child = Command::new(&self.program)
            .args(words)
            .current_dir(&self.folder)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(file.try_clone()?)
            .process_group(0)
            .spawn()
            .with_context(|| format!("cannot start {}", words.join(" ")))?;
        let printed = child.stdout.take().context("a process without output")?;
        let child = Arc::new(Mutex::new(child));
        running.push(Arc::clone(&child));
        drop(all);
        let (sender, lines) = channel();
        thread::spawn(move || {
            for line in BufReader::new(printed).lines().map_while(Result::ok) {
                // A log that cannot be written ends nothing, and nobody may be waiting for this line.
                drop(writeln!(file, "{line}"));
                drop(sender.send(line));
            }
        });
        Ok(Process {
            name: words.join(" "),
            log,
            child,
            lines,
        })
    }

    /// Ends all that still run, the last one first. None starts after this.
    pub(super) fn end_all(&self) {
        let all = lock(&self.all).take().unwrap_or_default();
        for child in all.iter().rev() {
            // One that cannot be waited for is not a child any more.
            drop(end(&mut lock(child)));
        }
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        self.end_all();
    }
}

impl Process {
    /// The next line it prints that contains a word.
    pub(super) fn line(&self, word: &str) -> anyhow::Result<String> {
        let deadline = Instant::now() + TIMEOUT;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.lines.recv_timeout(left) {
                Ok(line) if line.contains(word) => return Ok(line),
                Ok(_) => {}
                Err(_) => bail!(CellFailure(format!(
                    "{} did not print {word:?}: see {}",
                    self.name,
                    self.log.display()
                ))),
            }
        }
    }

    /// Waits for its own end; gives its exit status.
    pub(super) fn wait(&self) -> anyhow::Result<Option<i32>> {
        while self.lines.recv_timeout(TIMEOUT).is_ok() {}
        wait_for_end(&mut lock(&self.child), END_TIMEOUT)
    }

    /// Ends it.
    pub(super) fn end(&self) -> anyhow::Result<()> {
        end(&mut lock(&self.child))
    }
}

fn end(child: &mut Child) -> anyhow::Result<()> {
    terminate(child);
    wait_for_end(child, END_TIMEOUT)?;
    Ok(())
}
