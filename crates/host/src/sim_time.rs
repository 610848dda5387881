//! Simulated time: the clock of a cell whose machine is simulated, by all processes of the cell at once.
//!
//! The launcher keeps the clock ([`SimulatedClock`]); each process that acts by it is a member ([`Member`]). A member that has nothing
//! left to do reports up to which number it has published and taken each topic, and when its next timer is due. Once every member
//! rests and no message between them is under way, the clock goes to the next timer of all: conservative synchronisation (Chandy and
//! Misra, Communications of the ACM 24, 1981). So it runs as fast as the processes keep up, on any computer and under any load, and no
//! deadline is missed and no message lost for want of processor time.
//!
//! While a process is missing, or works for longer than [`PATIENCE`], the clock goes at the rate of the real one, as the watchdogs of
//! the others expect.
//!
//! Processes read the clock from a file of eight bytes (ns since 1970, little endian), which is written before any of them is told.
//! Members and the launcher talk by a Unix socket beside it: a member sends a line of JSON (its name and topics), then reports; the
//! launcher sends the instant, eight bytes, to each member that has a timer due.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, BufRead as _, BufReader, Read, Write},
    os::unix::{
        fs::{FileExt as _, OpenOptionsExt as _},
        net::{UnixListener, UnixStream},
    },
    path::{Path, PathBuf},
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use graph::Stamp;
use probecell_msgs::{rosgraph_msgs::Clock, to_cdr};
use serde::{Deserialize, Serialize};
use tracing::{debug, warn};

use crate::{
    bus::Publisher,
    clock::{self, CellClock},
};

/// How long the clock waits for a process, or for a message that is under way, before it goes on at the rate of the real one.
pub const PATIENCE: Duration = Duration::from_secs(5);
/// Step of the clock while it goes at the rate of the real one.
const STEP: Duration = Duration::from_millis(1);
/// Between two messages of the clock.
const PUBLISHED: Duration = Duration::from_millis(10);
/// Longest first line of a member, bytes.
const LONGEST: u64 = 1 << 16;
/// Instant of a timer that is not set.
const NEVER: i64 = i64::MAX;

/// Where members of the clock at `path` report.
fn socket(path: &Path) -> PathBuf {
    path.with_extension("ticks")
}

/// The connection of this process to the clock that it follows, until it joins.
static CONNECTED: Mutex<Option<UnixStream>> = Mutex::new(None);

/// Connects a process of the cell to the simulated clock that it follows, if it follows one, before it loses the right to.
///
/// # Errors
/// Nobody keeps that clock.
pub fn connect() -> io::Result<()> {
    if let Some(path) = clock::simulated() {
        let stream = UnixStream::connect(socket(path))?;
        *CONNECTED.lock().unwrap_or_else(PoisonError::into_inner) = Some(stream);
    }
    Ok(())
}

/// Follows the clock at `path`, where one runs there.
pub fn follow(path: &Path) {
    if UnixStream::connect(socket(path)).is_ok()
        && let Err(error) = CellClock::Simulated(path.to_owned()).follow()
    {
        debug!(%error, "the simulated clock of the cell");
    }
}

/// What a member says first.
#[derive(Debug, Serialize, Deserialize)]
struct Introduction {
    name: String,
    /// Topics, by names below the namespace of the cell, in the order of the numbers in its reports.
    publishes: Vec<String>,
    takes: Vec<String>,
}

/// A topic between members, as one of them takes it.
#[derive(Clone, Copy, Debug)]
struct Taken {
    topic: usize,
    /// Number of the last message that was taken.
    last: u64,
}

/// A process as the clock sees it.
struct Known {
    name: String,
    stream: UnixStream,
    publishes: Vec<usize>,
    takes: Vec<Taken>,
    /// ns; its next timer.
    wake: i64,
    works: bool,
}

/// What the clock waits for.
#[derive(Debug, PartialEq, Eq)]
enum Waits {
    /// A process that is not there: the clock goes at the rate of the real one meanwhile.
    ForProcesses,
    /// Work, or a message under way.
    ForWork,
    /// The instant (ns) to which it may go next.
    Until(i64),
}

#[derive(Default)]
struct State {
    /// ns since 1970.
    now: i64,
    /// Times the real time; none: as fast as the processes keep up.
    speed: Option<f64>,
    /// Real and simulated instant from which the speed counts.
    base: Option<(Instant, i64)>,
    /// Number of processes of the cell.
    expected: usize,
    members: BTreeMap<u64, Known>,
    joined: u64,
    topics: BTreeMap<String, usize>,
    /// Number of the last message published on each topic.
    published: Vec<u64>,
    /// Since when the clock waits for work.
    held: Option<Instant>,
    ended: bool,
}

impl State {
    fn topic(&mut self, name: &str) -> usize {
        let next = self.topics.len();
        let index = *self.topics.entry(name.to_owned()).or_insert(next);
        self.published.resize(self.topics.len(), 0);
        index
    }

    fn waits(&self) -> Waits {
        if self.members.len() < self.expected {
            return Waits::ForProcesses;
        }
        let under_way = |one: &Taken| one.last < self.published[one.topic];
        let busy = |member: &Known| member.works || member.takes.iter().any(under_way);
        if self.members.values().any(busy) {
            return Waits::ForWork;
        }
        let next = self.members.values().map(|member| member.wake).min();
        Waits::Until(next.unwrap_or(NEVER).max(self.now))
    }

    /// The latest instant that the speed allows, ns.
    fn limit(&mut self) -> i64 {
        let Some(speed) = self.speed else {
            return NEVER - 1;
        };
        let (begun, from) = *self.base.get_or_insert((Instant::now(), self.now));
        from.saturating_add((begun.elapsed().as_secs_f64() * speed * 1e9) as i64)
    }

    /// Real time until the speed allows the instant.
    fn until(&mut self, instant: i64) -> Duration {
        let ahead = instant.saturating_sub(self.limit()).max(0) as f64 * 1e-9;
        Duration::from_secs_f64((ahead / self.speed.unwrap_or(1.0)).clamp(0.0, 1.0))
    }
}

/// The place of a clock that is to begin.
pub struct ClockPlace {
    path: PathBuf,
    file: File,
    listener: UnixListener,
}

/// The clock of a cell. It ends with this value.
pub struct SimulatedClock {
    shared: Arc<Shared>,
    path: PathBuf,
}

struct Shared {
    file: File,
    state: Mutex<State>,
    changed: Condvar,
}

impl ClockPlace {
    /// Makes the file at `path`, whose folder is the user's alone, and the socket beside it.
    ///
    /// # Errors
    /// What the system says; [`io::ErrorKind::AddrInUse`] where a clock runs there.
    pub fn make(path: &Path) -> io::Result<Self> {
        if UnixStream::connect(socket(path)).is_ok() {
            return Err(io::ErrorKind::AddrInUse.into());
        }
        for left in [path.to_owned(), socket(path)] {
            match fs::remove_file(left) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        let mut options = File::options();
        let options = options.write(true).create_new(true).mode(0o600);
        let file = options.open(path)?;
        file.write_all_at(&clock::now().0.to_le_bytes(), 0)?;
        let listener = UnixListener::bind(socket(path))?;
        Ok(Self {
            path: path.to_owned(),
            file,
            listener,
        })
    }

    /// Begins, at the instant of the wall clock. `speed`: times the real time; none: as fast as the `expected` processes keep up.
    ///
    /// # Errors
    /// What the system says of threads.
    pub fn start(self, speed: Option<f64>, expected: usize) -> io::Result<SimulatedClock> {
        let now = clock::now().0;
        let listener = self.listener;
        let shared = Arc::new(Shared {
            file: self.file,
            state: Mutex::new(State {
                now,
                speed,
                expected,
                ..State::default()
            }),
            changed: Condvar::new(),
        });
        let (joining, pacing) = (Arc::clone(&shared), Arc::clone(&shared));
        let named = |name: &str| thread::Builder::new().name(name.to_owned());
        named("members of the clock").spawn(move || joining.admit(&listener))?;
        named("pace of the clock").spawn(move || pacing.pace())?;
        Ok(SimulatedClock {
            shared,
            path: self.path,
        })
    }
}

impl SimulatedClock {
    /// Publishes the clock (`rosgraph_msgs/Clock`), as viewers and nodes of ROS 2 with `use_sim_time` follow it, a hundred times a
    /// second of real time, until this value ends.
    ///
    /// # Errors
    /// What the system says of a thread.
    pub fn publish(&self, publisher: Publisher) -> io::Result<()> {
        let shared = Arc::clone(&self.shared);
        let publish = move || {
            let mut last = 0;
            loop {
                let now = {
                    let state = shared.lock();
                    if state.ended {
                        break;
                    }
                    Stamp(state.now)
                };
                if now.0 != last {
                    last = now.0;
                    let message = Clock { clock: now.time() };
                    if let Err(error) = publisher.publish(to_cdr(&message), now.0) {
                        debug!(%error, "the clock");
                    }
                }
                thread::sleep(PUBLISHED);
            }
        };
        thread::Builder::new()
            .name("clock".to_owned())
            .spawn(publish)?;
        Ok(())
    }

    /// Ends it; it stands still from now on.
    pub fn end(&self) {
        if std::mem::replace(&mut self.shared.lock().ended, true) {
            return;
        }
        self.shared.changed.notify_all();
        for path in [socket(&self.path), self.path.clone()] {
            // Not to be removed by this process: the next one replaces it.
            drop(fs::remove_file(path));
        }
    }

    /// A process that is no member is about to publish its next message on a topic: until the members have taken it the clock stands.
    pub fn publishing(&self, topic: &str) {
        let mut state = self.shared.lock();
        let topic = state.topic(topic);
        state.published[topic] += 1;
    }
}

impl Drop for SimulatedClock {
    fn drop(&mut self) {
        self.end();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn admit(self: &Arc<Self>, listener: &UnixListener) {
        for stream in listener.incoming() {
            if self.lock().ended {
                return;
            }
            let shared = Arc::clone(self);
            let of_member = thread::Builder::new().name("member of the clock".to_owned());
            let begun = stream.and_then(|stream| {
                of_member.spawn(move || {
                    if let Err(error) = shared.follow(stream) {
                        debug!(%error, "a member of the simulated clock");
                    }
                })
            });
            if let Err(error) = begun {
                warn!("a process cannot follow the simulated clock: {error}");
                thread::sleep(STEP);
            }
        }
    }

    /// Takes the reports of a member until it ends.
    fn follow(&self, stream: UnixStream) -> io::Result<()> {
        let mut reader = BufReader::new(stream.try_clone()?);
        let mut line = String::new();
        reader.by_ref().take(LONGEST).read_line(&mut line)?;
        let introduction: Introduction = serde_json::from_str(&line)?;
        let numbers = introduction.publishes.len() + introduction.takes.len();
        let id = self.join(stream, introduction);
        let mut report = vec![0; 8 * (1 + numbers)];
        let mut ended = reader.read_exact(&mut report);
        while ended.is_ok() {
            self.rest(id, &report);
            ended = reader.read_exact(&mut report);
        }
        let mut state = self.lock();
        if let Some(gone) = state.members.remove(&id) {
            // A process that succeeds it counts anew.
            for topic in gone.publishes {
                state.published[topic] = 0;
            }
        }
        state.base = None;
        self.changed.notify_all();
        ended
    }

    fn join(&self, stream: UnixStream, introduction: Introduction) -> u64 {
        let mut state = self.lock();
        let publishes = introduction.publishes.iter();
        let publishes = publishes.map(|name| state.topic(name)).collect();
        let takes = introduction.takes.iter().map(|name| {
            let topic = state.topic(name);
            // What was published before it came may never reach it.
            let last = state.published[topic];
            Taken { topic, last }
        });
        let takes = takes.collect();
        let id = state.joined;
        state.joined += 1;
        let member = Known {
            name: introduction.name,
            stream,
            publishes,
            takes,
            wake: NEVER,
            works: true,
        };
        state.members.insert(id, member);
        (state.base, state.held) = (None, None);
        id
    }

    /// Takes the report of a member that rests, and goes on where that was all there was to do.
    fn rest(&self, id: u64, report: &[u8]) {
        let numbers = report.as_chunks::<8>().0;
        let Some((wake, numbers)) = numbers.split_first() else {
            return;
        };
        let mut state = self.lock();
        let state = &mut *state;
        let Some(member) = state.members.get_mut(&id) else {
            return;
        };
        member.works = false;
        member.wake = i64::from_le_bytes(*wake);
        let (published, taken) = numbers.split_at(member.publishes.len());
        for (topic, number) in member.publishes.iter().zip(published) {
            state.published[*topic] = u64::from_le_bytes(*number);
        }
        for (one, number) in member.takes.iter_mut().zip(taken) {
            // None yet of those that come after it has joined.
            if *number != [0; 8] {
                one.last = u64::from_le_bytes(*number);
            }
        }
        self.advance(state);
    }

    /// Goes to the next timer, if nobody works and the speed allows it.
    fn advance(&self, state: &mut State) {
        match state.waits() {
            Waits::ForProcesses | Waits::ForWork => {}
            Waits::Until(NEVER) => state.held = None,
            Waits::Until(next) => {
                state.held = None;
                if next <= state.limit() {
                    self.go(state, next);
                } else {
                    self.changed.notify_all();
                }
            }
        }
    }

    /// Sets the clock, and wakes those that have a timer due.
    fn go(&self, state: &mut State, instant: i64) {
        state.now = instant;
        if let Err(error) = self.file.write_all_at(&instant.to_le_bytes(), 0) {
            warn!("the simulated clock cannot be written: {error}");
        }
        let due = (state.members.values_mut()).filter(|member| member.wake <= instant);
        for member in due {
            member.works = true;
            // Due once: the next report says when again.
            member.wake = NEVER;
            if let Err(error) = member.stream.write_all(&instant.to_le_bytes()) {
                debug!(%error, "{} has left the clock", member.name);
            }
        }
    }

    /// Paces the clock where a speed is wanted, and keeps it going where a process is missing or does not answer.
    fn pace(&self) {
        let mut state = self.lock();
        let mut seen = Instant::now();
        while !state.ended {
            let passed = seen.elapsed();
            seen = Instant::now();
            let wait = match state.waits() {
                Waits::ForProcesses => {
                    self.go_by(&mut state, passed);
                    STEP
                }
                Waits::ForWork => {
                    let since = *state.held.get_or_insert(seen);
                    let left = PATIENCE.saturating_sub(since.elapsed());
                    if left.is_zero() {
                        give_up(&mut state);
                        self.go_by(&mut state, passed);
                        STEP
                    } else {
                        left.min(PATIENCE / 10)
                    }
                }
                Waits::Until(NEVER) => PATIENCE,
                Waits::Until(next) => {
                    let wait = state.until(next);
                    if wait.is_zero() {
                        self.advance(&mut state);
                    }
                    wait.max(Duration::from_micros(10))
                }
            };
            (state, _) =
                (self.changed.wait_timeout(state, wait)).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn go_by(&self, state: &mut State, passed: Duration) {
        let step = passed.min(10 * STEP).as_nanos() as i64;
        state.base = None;
        let instant = state.now.saturating_add(step);
        self.go(state, instant);
    }
}

/// Messages that did not come in [`PATIENCE`] are waited for no longer.
fn give_up(state: &mut State) {
    for member in state.members.values_mut().filter(|member| !member.works) {
        for one in &mut member.takes {
            let published = state.published[one.topic];
            if one.last < published {
                warn!("{} has not received message {published}", member.name);
                one.last = published;
            }
        }
    }
}

/// A process that acts by the simulated clock of its cell.
pub struct Member {
    stream: UnixStream,
    report: Vec<u8>,
    /// The launcher has woken it since its last report.
    woken: Arc<AtomicBool>,
}

impl Member {
    /// Joins the clock to which this process has connected; none where it follows the clock of the system. `on_wake` is called on a
    /// thread of its own when a timer is due.
    ///
    /// # Errors
    /// What the system says of socket and thread.
    pub fn join(
        name: &str,
        publishes: Vec<String>,
        takes: Vec<String>,
        on_wake: impl Fn() -> bool + Send + 'static,
    ) -> io::Result<Option<Self>> {
        let connected = CONNECTED
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        let Some(mut stream) = connected else {
            return Ok(None);
        };
        let introduction = Introduction {
            name: name.to_owned(),
            publishes,
            takes,
        };
        let mut line = serde_json::to_vec(&introduction)?;
        line.push(b'\n');
        stream.write_all(&line)?;
        let woken = Arc::new(AtomicBool::new(true));
        let (mut ticks, is_woken) = (stream.try_clone()?, Arc::clone(&woken));
        thread::Builder::new()
            .name("simulated clock".to_owned())
            .spawn(move || {
                let mut instant = [0; 8];
                while ticks.read_exact(&mut instant).is_ok() {
                    is_woken.store(true, Ordering::Release);
                    if !on_wake() {
                        break;
                    }
                }
            })?;
        Ok(Some(Self {
            stream,
            report: Vec::new(),
            woken,
        }))
    }

    /// Reports that this process has nothing to do before `wake` or the next message; `published` and `taken` are the numbers of the
    /// last message of each of its topics.
    ///
    /// # Errors
    /// The launcher has ended.
    pub fn rest(
        &mut self,
        wake: Option<Stamp>,
        published: impl IntoIterator<Item = u64>,
        taken: impl IntoIterator<Item = u64>,
    ) -> io::Result<()> {
        let wake = wake.map_or(NEVER, |stamp| stamp.0).to_le_bytes();
        let numbers = published.into_iter().chain(taken).map(u64::to_le_bytes);
        let report: Vec<u8> = std::iter::once(wake).chain(numbers).flatten().collect();
        let woken = self.woken.swap(false, Ordering::AcqRel);
        if woken || report != self.report {
            self.stream.write_all(&report)?;
            self.report = report;
        }
        Ok(())
    }
}
