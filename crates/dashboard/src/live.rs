//! The bus: feeds the hall with what cells publish, and finds out which of them are there.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use graph::{Stamp, topics};
use host::bus::{
    BusConfig, BusError, EntityKind, Graph, Observed, Observer, OnKept, OnMissed, OnObserved,
    Watched,
};
use tokio::sync::watch;

use crate::acts::Acts;
use crate::heard::Heard;
use crate::observed::{Callbacks, FAST, fast, observed};
use crate::state::{Hall, kept_topics, machine_state, read_topics, split};
use crate::versions::Versions;

/// How often presence is looked at. It is well below the 3 s in which a cell that was killed must be seen as stale.
pub(crate) const PRESENCE: Duration = Duration::from_millis(500);
/// How long the axes of a cell are read after a page of it has asked for them.
const WANTED: Duration = Duration::from_secs(30);
/// How often storages are asked for what they have kept, beside once when a router is reached.
const ASKED: Duration = Duration::from_secs(30);
/// How long the first request waits until the cells of others are read as well.
const JOINING: Duration = Duration::from_secs(2);
/// Wait between two attempts to reach a router.
const AGAIN: Duration = Duration::from_secs(1);

/// The hall as threads share it, and a signal for each change that a page shows at once.
pub(crate) struct Live {
    hall: Mutex<Hall>,
    changed: watch::Sender<u64>,
    /// Routers that answer, by endpoint.
    routers: Mutex<BTreeMap<String, bool>>,
    /// Cells whose axes a page shows, and when it said so last.
    wanted: Mutex<BTreeMap<String, Instant>>,
    /// The cell that is read from the start, the others when somebody looks; without one all are from the start.
    first: Option<String>,
    /// Somebody has looked.
    looked: AtomicBool,
    /// Every cell is read, and something is known of each.
    everything: watch::Sender<bool>,
    /// Takes the operators' keys.
    acts: Arc<Acts>,
    /// Messages that arrived.
    pub(crate) received: AtomicU64,
}

impl Live {
    pub(crate) fn new(acts: Arc<Acts>, first: Option<String>, version: String) -> Arc<Self> {
        let mut hall = Hall::of_version(version);
        hall.set_desks(acts.cells());
        Arc::new(Self {
            wanted: Mutex::default(),
            looked: AtomicBool::new(first.is_none()),
            everything: watch::Sender::new(first.is_none()),
            first,
            acts,
            hall: Mutex::new(hall),
            changed: watch::Sender::new(0),
            routers: Mutex::default(),
            received: AtomicU64::new(0),
        })
    }

    /// The hall, locked: for as long as a page takes to be written at the most.
    pub(crate) fn hall(&self) -> MutexGuard<'_, Hall> {
        lock(&self.hall)
    }

    /// Wakes at each event.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.changed.subscribe()
    }

    /// What is wrong with the connection to the bus, in a sentence; empty when nothing is.
    pub(crate) fn trouble(&self) -> String {
        let routers = lock(&self.routers);
        let silent: Vec<&str> = (routers.iter())
            .filter(|(_, up)| !**up)
            .map(|(endpoint, _)| endpoint.as_str())
            .collect();
        if silent.is_empty() {
            String::new()
        } else {
            format!(
                "No router answers at {}, or its cell is secured and admits no stranger (--cell CELL.toml joins with its passwords): \
                 cells behind it are not seen.",
                silent.join(", ")
            )
        }
    }

    /// Somebody looks: from now on every cell is read. The first who does waits until something is known of each.
    pub(crate) async fn look(&self) {
        if self.looked.swap(true, Ordering::Relaxed) {
            return;
        }
        let mut everything = self.everything.subscribe();
        // Where no router answers the page says so.
        drop(tokio::time::timeout(JOINING, everything.wait_for(|all| *all)).await);
    }

    /// A page shows the axes of this cell: they are read for a while.
    pub(crate) fn want_axes(&self, cell: &str) {
        lock(&self.wanted).insert(cell.to_owned(), Instant::now());
    }

    /// Cells whose axes some page shows.
    fn wanted(&self) -> BTreeSet<String> {
        let mut wanted = lock(&self.wanted);
        wanted.retain(|_, last| last.elapsed() < WANTED);
        wanted.keys().cloned().collect()
    }

    fn set_router(&self, endpoint: &str, up: bool) {
        let changed = lock(&self.routers).insert(endpoint.to_owned(), up) != Some(up);
        if changed {
            self.changed.send_modify(|number| *number += 1);
        }
    }

    /// Changes the hall, and wakes the pages where that is an event.
    fn change(&self, change: impl FnOnce(&mut Hall)) {
        let mut hall = self.hall();
        let before = hall.last_event();
        change(&mut hall);
        let after = hall.last_event();
        drop(hall);
        if before != after {
            self.changed.send_replace(after);
        }
    }

    /// Whoever waits in [`Live::look`] goes on when something is known of each of these cells.
    fn tell_whether_all_are_read(&self, present: &BTreeSet<String>) {
        let hall = self.hall();
        let all = present.iter().all(|cell| hall.cell(cell).is_some());
        drop(hall);
        self.everything.send_if_modified(|told| {
            let changed = all && !*told;
            *told |= all;
            changed
        });
    }

    fn take(&self, topic: &str, payload: &[u8]) {
        self.received.fetch_add(1, Ordering::Relaxed);
        if let Some((cell, name)) = split(topic)
            && name == topics::OPERATOR_KEYS.name
        {
            self.acts.take_keys(cell, payload);
            return;
        }
        self.change(|hall| hall.apply(topic, payload, host::now()));
    }
}

/// A panic of another thread leaves a hall behind that is whole: each message changes it in one step.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a [`host::bus::Storage`] keeps of each cell for dashboards that come later, and what they ask it for.
pub fn kept() -> Vec<Observed> {
    kept_topics().map(observed).into()
}

/// What is read of every cell by one subscription for all: all but what comes at the rate of the controller.
fn read_of_all() -> Vec<Observed> {
    let read = read_topics().into_iter().chain([topics::OPERATOR_KEYS]);
    let read = read.filter(|topic| FAST.iter().all(|fast| fast.name != topic.name));
    read.map(observed).collect()
}

/// The cells of which one such topic is read.
pub(crate) struct OfCells {
    topic: Observed,
    read: BTreeMap<String, Watched>,
}

impl OfCells {
    pub(crate) fn new(topic: graph::Topic) -> Self {
        Self::of(fast(topic))
    }

    fn of(topic: Observed) -> Self {
        Self {
            topic,
            read: BTreeMap::new(),
        }
    }

    /// Reads it of these cells, and of no others.
    pub(crate) fn follow(&mut self, observer: &Observer, cells: &BTreeSet<String>, on: &Callbacks) {
        self.read.retain(|cell, _| cells.contains(cell));
        for cell in cells {
            if let Entry::Vacant(place) = self.read.entry(cell.clone()) {
                match observer.watch(cell, &self.topic, &on.0, &on.1) {
                    Ok(watched) => drop(place.insert(watched)),
                    Err(error) => {
                        tracing::warn!(%error, cell, "{} cannot be read", self.topic.name);
                    }
                }
            }
        }
    }
}

/// Reads one router for as long as the process runs, on a thread of its own.
pub(crate) fn read(live: Arc<Live>, config: BusConfig) -> std::io::Result<()> {
    std::thread::Builder::new()
        .name("dashboard bus".to_owned())
        .spawn(move || run(&live, &config))
        .map(drop)
}

/// A reader of a router, as soon as that answers; `silent` is called whenever it does not.
pub(crate) fn join(
    config: &BusConfig,
    observed: &[Observed],
    on: &Callbacks,
    silent: impl Fn(),
) -> Observer {
    joined(|| Observer::open(config, observed, &on.0, &on.1), silent)
}

fn joined(open: impl Fn() -> Result<Observer, BusError>, silent: impl Fn()) -> Observer {
    loop {
        match open() {
            Ok(observer) => return observer,
            Err(error) => {
                tracing::debug!(%error, "no router yet");
                silent();
                std::thread::sleep(AGAIN);
            }
        }
    }
}

/// Reads the cell that is read from the start, until somebody looks; dropping the answer ends it.
///
/// Where cells of one host have a dashboard each and nobody looks at most of them, what these cost would otherwise grow with the
/// square of the cells.
fn read_first(
    live: &Live,
    config: &BusConfig,
    cell: &str,
    on: &Callbacks,
) -> (Vec<OfCells>, Observer) {
    let endpoint = config.endpoints.join(", ");
    let silent = || live.set_router(&endpoint, false);
    let observer = joined(|| Observer::open_in(config, cell), silent);
    let mut read: Vec<OfCells> = read_of_all().into_iter().map(OfCells::of).collect();
    read.push(OfCells::new(topics::MACHINE_STATE));
    let this = BTreeSet::from([cell.to_owned()]);
    for topic in &mut read {
        topic.follow(&observer, &this, on);
    }
    while !live.looked.load(Ordering::Relaxed) {
        live.set_router(&endpoint, observer.is_connected());
        let present = present(&observer.graph());
        live.change(|hall| hall.set_present(&present, host::now()));
        std::thread::sleep(PRESENCE);
    }
    (read, observer)
}

fn run(live: &Arc<Live>, config: &BusConfig) {
    let endpoint = config.endpoints.join(", ");
    let heard = Arc::new(Mutex::new(Heard::default()));
    let on = callbacks(live, &heard);
    if live.first.is_none() {
        lock(&heard).freeze();
    }
    let first = (live.first.as_deref()).map(|cell| read_first(live, config, cell, &on));
    let observer = join(config, &read_of_all(), &on, || {
        live.set_router(&endpoint, false);
    });
    drop(first);
    lock(&heard).freeze();
    if let Err(error) = observer.await_graph() {
        tracing::warn!(%error, "cells may be found late");
    }
    let on_kept: OnKept = Arc::new({
        let live = Arc::clone(live);
        move |topic, payload, at_ns| {
            (live.hall()).apply_kept(topic, payload, Stamp(at_ns), host::now());
        }
    });
    let mut asked: Option<Instant> = None;
    let mut states = OfCells::new(topics::MACHINE_STATE);
    let mut axes = OfCells::new(topics::JOINT_STATES);
    let mut versions = Versions::default();
    loop {
        let connected = observer.is_connected();
        live.set_router(&endpoint, connected);
        if !connected {
            asked = None;
        } else if asked.is_none_or(|last| last.elapsed() >= ASKED) {
            asked = Some(Instant::now());
            if let Err(error) = observer.ask_kept(&kept(), &on_kept) {
                tracing::warn!(%error, "storages are not asked");
            }
        }
        let graph = observer.graph();
        let present = present(&graph);
        states.follow(&observer, &present, &on);
        axes.follow(&observer, &live.wanted(), &on);
        live.change(|hall| hall.set_present(&present, host::now()));
        live.tell_whether_all_are_read(&present);
        let differs = versions.follow(&observer, &graph, &present, &on);
        live.change(|hall| hall.set_differs(differs, host::now()));
        std::thread::sleep(PRESENCE);
    }
}

fn callbacks(live: &Arc<Live>, heard: &Arc<Mutex<Heard>>) -> Callbacks {
    let on_sample: OnObserved = Arc::new({
        let (live, heard) = (Arc::clone(live), Arc::clone(heard));
        move |topic, received| {
            if lock(&heard).is_new(received.publisher, received.sequence) {
                live.take(topic, &received.payload);
            }
        }
    });
    let on_missed: OnMissed = Arc::new({
        let live = Arc::clone(live);
        move |name, _session, count| {
            live.change(|hall| hall.missed("", name, count, host::now()));
        }
    });
    (on_sample, on_missed)
}

/// Names of the cells whose machine somebody publishes the state of.
pub(crate) fn present(graph: &Graph) -> BTreeSet<String> {
    let ty = machine_state();
    let publishers = graph
        .entities()
        .iter()
        .filter(|one| one.kind == EntityKind::Publisher);
    let channels = publishers.filter_map(|one| one.channel.as_ref());
    let of_machines = channels.filter(|one| one.ty.dds_name() == ty.dds_name);
    of_machines
        .filter_map(|one| split(&one.name))
        .map(|(cell, _)| cell.to_owned())
        .collect()
}
