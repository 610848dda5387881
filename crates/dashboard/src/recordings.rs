//! Recordings in folders: listed, opened, and played up to an instant into the reducer that shows live cells.
//!
//! Names come from addresses, hence from anybody: a name is looked up in the list of what the folders hold and never made
//! into a path; links are not followed. Bounds: 500 recordings listed, four of them open with at most 24 states each.

use std::collections::{BTreeMap, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use bags::{Bag, Damage, DamageKind, Position};
use graph::{Stamp, topics};

use crate::history::Summary;
use crate::state::{EventKind, Hall, is_read};
use crate::view::Listed;

/// Recordings listed, the newest.
const LISTED: usize = 500;
/// Recordings that stay open.
const OPEN: usize = 4;
/// States kept of each, evenly spread over its messages.
const STATES: usize = 24;
/// How long recordings are read for one page of a machine, and of the list.
const READING: Duration = Duration::from_secs(20);
const LISTING: Duration = Duration::from_millis(700);
/// A recording that is being written is read again when it has grown by this factor.
const GROWN: f64 = 1.1;
/// A recording is written at least so often.
const WRITTEN: Duration = Duration::from_secs(10);
/// Marks on the timeline.
const MARKS: usize = 400;

/// What went wrong, in a sentence.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RecordingError {
    #[error("there is no recording {0}")]
    Unknown(String),
    #[error("{0} cannot be read: {1}")]
    Unreadable(String, Box<bags::Error>),
}

/// The recordings of some folders.
pub(crate) struct Recordings {
    folders: Vec<PathBuf>,
    open: Mutex<VecDeque<Arc<Opened>>>,
    /// What recordings say of their machines, by path and what was listed of it then.
    told: Mutex<BTreeMap<PathBuf, (Listed, Told)>>,
}

/// Machines of a recording, by name.
type Told = Vec<(String, Summary)>;

/// A recording in the list.
pub(crate) struct Recorded {
    pub(crate) listed: Listed,
    /// Its machines by name; none where it was not read yet or cannot be.
    pub(crate) cells: Option<Told>,
}

/// A recording that was opened, with states on the way through it.
pub(crate) struct Opened {
    pub(crate) listed: Listed,
    path: PathBuf,
    bag: Bag,
    /// States on the way, in order of time.
    states: Vec<State>,
    /// What happened, s from the beginning.
    pub(crate) marks: Vec<(f64, String)>,
}

/// The hall after some of the messages of a recording.
struct State {
    /// Log time of the last message taken, ns.
    taken: u64,
    hall: Hall,
    /// Where the messages go on.
    position: Position,
}

impl Recordings {
    pub(crate) fn new(folders: Vec<PathBuf>) -> Self {
        Self {
            folders,
            open: Mutex::default(),
            told: Mutex::default(),
        }
    }

    pub(crate) fn folder_count(&self) -> usize {
        self.folders.len()
    }

    /// Names and paths, newest first by name of the folder's time stamp and else by name.
    fn found(&self) -> Vec<(String, PathBuf)> {
        let mut found = Vec::new();
        for folder in &self.folders {
            let Ok(entries) = fs::read_dir(folder) else {
                continue;
            };
            for entry in entries.flatten() {
                // Of the entry itself: a link is neither a file nor a folder.
                let Ok(kind) = entry.file_type() else {
                    continue;
                };
                let (name, path) = (
                    entry.file_name().to_string_lossy().into_owned(),
                    entry.path(),
                );
                let is_bag = if kind.is_dir() {
                    !mcap_files(&path).is_empty()
                } else {
                    kind.is_file() && is_mcap(&path)
                };
                if is_bag && is_plain(&name) {
                    let modified = entry.metadata().and_then(|one| one.modified()).ok();
                    found.push((modified, name, path));
                }
            }
        }
        found.sort_by(|a, b| (&b.0, &a.1).cmp(&(&a.0, &b.1)));
        let mut names = std::collections::BTreeSet::new();
        found
            .into_iter()
            .filter(|(_, name, _)| names.insert(name.clone()))
            .take(LISTED)
            .map(|(_, name, path)| (name, path))
            .collect()
    }

    /// All, newest first.
    pub(crate) fn list(&self) -> Vec<Recorded> {
        let mut all = self.read_for(LISTING);
        all.sort_by_key(|one| std::cmp::Reverse(one.listed.bounds.map(|(begin, _)| begin)));
        all
    }

    /// Path of a recording.
    pub(crate) fn path(&self, name: &str) -> Result<PathBuf, RecordingError> {
        let found = self.found().into_iter().find(|(known, _)| known == name);
        found
            .map(|(_, path)| path)
            .ok_or_else(|| RecordingError::Unknown(name.to_owned()))
    }

    /// File number `index` of a recording.
    pub(crate) fn file(&self, name: &str, index: usize) -> Result<PathBuf, RecordingError> {
        let path = self.path(name)?;
        mcap_files(&path)
            .into_iter()
            .nth(index)
            .ok_or_else(|| RecordingError::Unknown(name.to_owned()))
    }

    /// Opens a recording, or gives the one that is open. One that has grown since is opened again.
    pub(crate) fn open(&self, name: &str) -> Result<Arc<Opened>, RecordingError> {
        let path = self.path(name)?;
        let (listed, bag) = listed(name.to_owned(), &path);
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = open
            .iter()
            .find(|one| one.path == path && one.listed == listed)
        {
            return Ok(Arc::clone(known));
        }
        let bag =
            bag.map_err(|error| RecordingError::Unreadable(name.to_owned(), Box::new(error)))?;
        open.retain(|one| one.path != path);
        if open.len() == OPEN {
            open.pop_front();
        }
        let opened = Arc::new(Opened::read(listed, path, bag));
        open.push_back(Arc::clone(&opened));
        Ok(opened)
    }
}

impl Recordings {
    /// All recordings with what they say of their machines, as far as they can be read in a time; what was read is kept for as
    /// long as the recording stays as it is.
    fn read_for(&self, time: Duration) -> Vec<Recorded> {
        let begun = Instant::now();
        let lock = || self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let found = self.found();
        let mut all = Vec::with_capacity(found.len());
        for (name, path) in &found {
            let (listed, bag) = listed(name.clone(), path);
            let known = lock()
                .get(path)
                .filter(|(known, _)| is_still(known, &listed))
                .map(|(_, told)| told.clone());
            let cells = match (known, bag) {
                (Some(told), _) => Some(told),
                (None, Ok(bag)) if begun.elapsed() < time => {
                    let told = told_by(&bag, &listed);
                    lock().insert(path.clone(), (listed.clone(), told.clone()));
                    Some(told)
                }
                _ => None,
            };
            all.push(Recorded { listed, cells });
        }
        lock().retain(|path, _| found.iter().any(|(_, known)| known == path));
        all
    }

    /// Machines and what their recordings say of them, in the order of time; and how many recordings have not been read yet. One
    /// call reads for [`READING`].
    pub(crate) fn machines(&self) -> (BTreeMap<String, Vec<Summary>>, usize) {
        let all = self.read_for(READING);
        let unread = all
            .iter()
            .filter(|one| one.cells.is_none() && one.listed.bounds.is_some());
        let unread = unread.count();
        let mut machines: BTreeMap<String, Vec<Summary>> = BTreeMap::new();
        for (name, summary) in all.into_iter().filter_map(|one| one.cells).flatten() {
            machines.entry(name).or_default().push(summary);
        }
        for sessions in machines.values_mut() {
            sessions.sort_by(|a, b| (a.begin, &a.recording).cmp(&(b.begin, &b.recording)));
        }
        (machines, unread)
    }
}

/// What was read of a recording still holds.
fn is_still(known: &Listed, now: &Listed) -> bool {
    let grows = now.under_way && (now.bytes as f64) < known.bytes as f64 * GROWN;
    known == now || grows
}

/// Machines of a recording.
fn told_by(bag: &Bag, listed: &Listed) -> Told {
    let hall = at_end(bag);
    let begin = listed.bounds.map_or(Stamp(0), |(begin, _)| begin);
    let cells = hall.cells();
    cells
        .map(|cell| {
            let summary = Summary::of(cell, &listed.name, begin);
            (cell.name.clone(), summary)
        })
        .collect()
}

/// The state at the end of a recording.
fn at_end(bag: &Bag) -> Hall {
    let topics = wanted(bag);
    // Positions of axes and signals are most of the messages, and say nothing of its parts.
    let left_out = [topics::JOINT_STATES.name, topics::SIGNALS.name];
    let topics = topics
        .iter()
        .filter(|one| !left_out.iter().any(|name| one.ends_with(name)));
    let topics: Vec<&str> = topics.map(String::as_str).collect();
    let mut hall = Hall::default();
    for message in bag.messages_on(&topics).flatten() {
        let at = Stamp(message.log_time as i64);
        hall.apply(&message.channel.topic, &message.payload, at);
    }
    hall
}

impl Opened {
    fn read(listed: Listed, path: PathBuf, bag: Bag) -> Self {
        let topics = wanted(&bag);
        let topics: Vec<&str> = topics.iter().map(String::as_str).collect();
        let total: u64 = (bag.channels().iter().zip(bag.counts()))
            .filter(|(channel, _)| topics.contains(&channel.topic.as_str()))
            .map(|(_, count)| count)
            .sum();
        let every = (total as usize / STATES).max(1);
        let mut hall = Hall::default();
        let mut messages = bag.messages_on(&topics);
        let state = |taken, hall: &Hall, position| State {
            taken,
            hall: hall.clone(),
            position,
        };
        let mut states = vec![state(0, &hall, messages.position())];
        let mut number = 0_usize;
        while let Some(message) = messages.next() {
            // What is damaged has been reported.
            let Ok(message) = message else { continue };
            let at = message.log_time;
            hall.apply(&message.channel.topic, &message.payload, Stamp(at as i64));
            number += 1;
            if number.is_multiple_of(every) && states.len() < STATES {
                states.push(state(at, &hall, messages.position()));
            }
        }
        drop(messages);
        let begin = listed.bounds.map_or(Stamp(0), |(begin, _)| begin);
        let (events, _) = hall.events_since(0, None);
        let marks = events
            .filter(|one| !matches!(one.kind, EventKind::Touch))
            .map(|one| (one.at.since_s(begin), one.text.clone()))
            .take(MARKS)
            .collect();
        Self {
            listed,
            path,
            bag,
            states,
            marks,
        }
    }

    /// The hall as it was at the instant `at`: every message received until then has been taken.
    pub(crate) fn at(&self, at: Stamp) -> Hall {
        let at = u64::try_from(at.0).unwrap_or(0);
        let topics = wanted(&self.bag);
        let topics: Vec<&str> = topics.iter().map(String::as_str).collect();
        // The last state before the instant; messages of its own instant may be on both sides of it.
        let next = self.states.partition_point(|state| state.taken < at);
        let state = &self.states[next.saturating_sub(1)];
        let mut hall = state.hall.clone();
        let rest = self.bag.messages_after(&topics, state.position.clone());
        for message in rest.flatten().take_while(|one| one.log_time <= at) {
            hall.apply(
                &message.channel.topic,
                &message.payload,
                Stamp(message.log_time as i64),
            );
        }
        hall
    }
}

/// Topics of the recording that the dashboard reads.
fn wanted(bag: &Bag) -> Vec<String> {
    let channels = bag.channels().iter();
    channels
        .filter(|one| is_read(&one.topic, &one.type_name))
        .map(|one| one.topic.clone())
        .collect()
}

fn listed(name: String, path: &Path) -> (Listed, Result<Bag, bags::Error>) {
    let files = mcap_files(path);
    let bytes = files
        .iter()
        .filter_map(|file| fs::metadata(file).ok())
        .map(|one| one.len())
        .sum();
    let names = files
        .iter()
        .filter_map(|file| file.file_name())
        .map(|one| one.to_string_lossy().into_owned())
        .collect();
    let bag = Bag::open(path);
    let under_way = (bag.as_ref()).is_ok_and(|bag| bag.damage().iter().any(is_written));
    let (bounds, trouble) = match &bag {
        Ok(bag) => {
            let mut damage = bag.damage();
            damage.retain(|one| !is_written(one));
            let damage: Vec<String> = damage.iter().map(ToString::to_string).collect();
            (
                bag.bounds()
                    .map(|(a, b)| (Stamp(a as i64), Stamp(b as i64))),
                damage.join("; "),
            )
        }
        Err(error) => (None, error.to_string()),
    };
    (
        Listed {
            name,
            bounds,
            bytes,
            under_way,
            trouble,
            files: names,
        },
        bag,
    )
}

/// A file without an end that was written to just now is no damaged one.
fn is_written(damage: &Damage) -> bool {
    let modified = fs::metadata(&damage.file).and_then(|one| one.modified());
    let age = modified.ok().and_then(|at| at.elapsed().ok());
    damage.kind == DamageKind::Truncated && age.is_some_and(|age| age < WRITTEN)
}

/// Letters that stand in an address as they are.
fn is_plain(name: &str) -> bool {
    !name.starts_with('.')
        && name
            .chars()
            .all(|one| one.is_ascii_alphanumeric() || "._-+".contains(one))
}

fn is_mcap(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "mcap")
}

/// The files of a recording, sorted; a link is none.
fn mcap_files(path: &Path) -> Vec<PathBuf> {
    if is_mcap(path) && path.is_file() {
        return vec![path.to_owned()];
    }
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    let files = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
    let mut files: Vec<PathBuf> = files
        .map(|entry| entry.path())
        .filter(|path| is_mcap(path))
        .collect();
    files.sort();
    files
}
