//! All cells, and the journal of what happened in them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::{Stamp, topics};
use probecell_msgs::{MachineState, Message, MessageType};

use super::cell::{CellState, Section};
use super::events::{Event, EventKind};

/// Cells kept; a further one is counted and not shown.
const CELLS: usize = 1000;
/// Events kept.
const EVENTS: usize = 4096;
/// A cell that has left while no part was being made is forgotten after so many seconds.
const FORGOTTEN_S: f64 = 60.0;
/// One that has left in the middle of a part is kept for a day, unless it comes back: somebody must see it.
const FORGOTTEN_MAKING_S: f64 = 86_400.0;

/// What a storage is asked for is forgotten when none has answered with it for so many seconds.
const CONFIRMED_S: f64 = 100.0;

/// What differs in the messages of cells of another version, or why they are not read: a sentence for each field, by cell and topic.
pub(crate) type Differs = BTreeMap<String, BTreeMap<String, Vec<String>>>;

/// Every cell from which a message was received, and those of which a storage has kept the last state.
#[derive(Clone, Debug, Default)]
pub struct Hall {
    cells: BTreeMap<String, CellState>,
    /// Shown for cells that are not in `cells`, and never mixed with those.
    kept: BTreeMap<String, Kept>,
    events: VecDeque<Event>,
    /// Number of the newest event.
    last_event: u64,
    /// Cells that were not taken on because there were too many.
    refused: BTreeSet<String>,
    /// Messages that the bus could not deliver to the dashboard, by topic name.
    missed: BTreeMap<String, u64>,
    /// Cells that take acts from pages.
    desks: BTreeSet<String>,
    /// Version of this program, as cells publish theirs; empty where none is compared with it.
    version: String,
}

/// What storages have kept of a cell.
#[derive(Clone, Debug)]
struct Kept {
    state: CellState,
    /// Of the newest sample of each topic.
    stamps: BTreeMap<&'static str, Stamp>,
    /// When a storage answered with any of it last.
    confirmed: Stamp,
}

/// What a storage keeps for dashboards that come later: what the tile of a cell shows. None of it asks, approves, plans, corrects
/// or commands.
pub fn kept_topics() -> [graph::Topic; 7] {
    [
        topics::MACHINE_STATE,
        topics::PART_STATUS,
        topics::PART_REPORTS,
        topics::VERDICTS,
        topics::PASS_DECISIONS,
        topics::GAP_REPORT,
        topics::RECORDING_STATUS,
    ]
}

/// Names of topics that the dashboard reads, with their types. Faults are read on any `NODE/faults`.
pub fn read_topics() -> Vec<graph::Topic> {
    let wanted = [
        topics::CELL_DESCRIPTION,
        topics::ROBOT_DESCRIPTION,
        topics::MACHINE_STATE,
        topics::JOINT_STATES,
        topics::PART_STATUS,
        topics::PART_REPORTS,
        topics::ORDERS,
        topics::INSPECTION_PLAN,
        topics::MEASUREMENT_ORDER,
        topics::PLAN_PROGRESS,
        topics::TOUCH_DEVIATIONS,
        topics::FEATURE_RESULTS,
        topics::REFERENCE_RESULTS,
        topics::VERDICTS,
        topics::PASS_DECISIONS,
        topics::CORRECTIONS,
        topics::CORRECTION_ACKNOWLEDGEMENTS,
        topics::GAP_REPORT,
        topics::RECORDING_STATUS,
        topics::LOSS_REPORTS,
        topics::SIGNALS,
    ];
    let faults = topics::ALL.iter().filter(|one| is_fault(one.name));
    wanted.into_iter().chain(faults.copied()).collect()
}

fn is_fault(name: &str) -> bool {
    name.ends_with("/faults")
}

/// The key by which names are sorted: `cell_9` before `cell_10`.
pub(crate) fn by_name(name: &str) -> (Vec<(String, u64)>, String) {
    let is_number = char::is_ascii_digit;
    let mut key = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let begin = rest.find(|one| is_number(&one)).unwrap_or(rest.len());
        let (text, tail) = rest.split_at(begin);
        let end = tail.find(|one| !is_number(&one)).unwrap_or(tail.len());
        let (digits, tail) = tail.split_at(end);
        let number = match digits {
            "" => 0,
            digits => digits.parse().unwrap_or(u64::MAX),
        };
        key.push((text.to_owned(), number));
        rest = tail;
    }
    (key, name.to_owned())
}

/// Name of the cell, and of the topic below it.
pub(crate) fn split(topic: &str) -> Option<(&str, &str)> {
    let topic = topic.trim_start_matches('/');
    let mut cut = topic.rfind('/')?;
    if is_fault(topic) {
        cut = topic[..cut].rfind('/')?;
    }
    Some((&topic[..cut], &topic[cut + 1..]))
}

/// The dashboard reads this topic with a message of this ROS name.
pub(crate) fn is_read(topic: &str, message: &str) -> bool {
    split(topic).is_some_and(|(_, name)| {
        let known: Option<&MessageType> = topics::by_name(name).map(|one| one.message);
        known.is_some_and(|known| known.name == message)
            && read_topics().iter().any(|one| one.name == name)
    })
}

impl Hall {
    /// An empty hall, seen by a program of this version.
    pub(crate) fn of_version(version: String) -> Self {
        Self {
            version,
            ..Self::default()
        }
    }

    /// Takes the bytes (CDR) of a message on `topic` (absolute), received at `at`. A cell exists from its first message of
    /// `machine_state` or of anything else that the dashboard reads.
    pub fn apply(&mut self, topic: &str, bytes: &[u8], at: Stamp) {
        let Some((cell, name)) = split(topic) else {
            return;
        };
        let Some(state) = self.known(cell, at) else {
            return;
        };
        let came_back = state.left.is_some();
        let happened = state.take(name, bytes, at);
        if name == topics::CELL_DESCRIPTION.name
            && let Some(state) = self.cells.get_mut(cell)
        {
            let is_said = !self.version.is_empty() && !state.version.is_empty();
            state.says_another = is_said && state.version != self.version;
        }
        if came_back {
            self.happened(cell, at, EventKind::Cell, "came back".to_owned());
        }
        if let Some((kind, text)) = happened {
            self.happened(cell, at, kind, text);
        }
    }

    /// The cell of that name, which appears; none where there are too many.
    fn known(&mut self, cell: &str, at: Stamp) -> Option<&mut CellState> {
        if !self.cells.contains_key(cell) {
            if self.cells.len() >= CELLS {
                if self.refused.len() < CELLS {
                    self.refused.insert(cell.to_owned());
                }
                return None;
            }
            self.cells.insert(cell.to_owned(), CellState::new(cell));
            self.happened(cell, at, EventKind::Cell, "appeared".to_owned());
        }
        self.cells.get_mut(cell)
    }

    /// Takes what differs in the messages of cells that another version of the program runs, or why they are not read. Nothing
    /// differs in those of all others.
    pub(crate) fn set_differs(&mut self, mut differs: Differs, at: Stamp) {
        let named: Vec<String> = differs.keys().cloned().collect();
        for cell in &named {
            self.known(cell, at);
        }
        let mut begins = Vec::new();
        for (name, cell) in &mut self.cells {
            let differs = differs.remove(name).unwrap_or_default();
            if cell.differs != differs {
                if cell.other_version().is_none() {
                    begins.push(name.clone());
                }
                cell.differs = differs;
                cell.changed(&[Section::State]);
            }
        }
        for name in begins {
            let text = "runs another version of probecell".to_owned();
            self.happened(&name, at, EventKind::Cell, text);
        }
    }

    /// Takes a message that a storage kept, with the stamp of its arrival there, received at `now`. It shows only while nothing
    /// is known of the cell from itself, and makes no event: it is past.
    pub fn apply_kept(&mut self, topic: &str, bytes: &[u8], at: Stamp, now: Stamp) {
        let known = split(topic).and_then(|(cell, name)| {
            let topic = kept_topics().into_iter().find(|one| one.name == name)?;
            Some((cell, topic.name))
        });
        let Some((cell, name)) = known else {
            return;
        };
        if !self.kept.contains_key(cell) && self.kept.len() >= CELLS {
            return;
        }
        let kept = self.kept.entry(cell.to_owned()).or_insert_with(|| Kept {
            state: CellState::of_kept(cell),
            stamps: BTreeMap::new(),
            confirmed: now,
        });
        kept.confirmed = now;
        if kept.stamps.get(name).is_none_or(|newest| *newest < at) {
            kept.stamps.insert(name, at);
            let before = kept.state.heard;
            kept.state.take(name, bytes, at);
            let (first, last) = before.unwrap_or((at, at));
            kept.state.heard = Some((first.min(at), last.max(at)));
        }
    }

    /// Takes which cells have a process on the bus that publishes the state of a machine, at the instant `now`; forgets
    /// cells that left long ago.
    pub fn set_present(&mut self, present: &BTreeSet<String>, now: Stamp) {
        let mut left = Vec::new();
        for (name, cell) in &mut self.cells {
            // A cell whose announcement is slower than its messages has not left.
            if !present.contains(name) && cell.left.is_none() && cell.is_stale(now) {
                cell.left = Some(now);
                left.push(name.clone());
            }
        }
        for name in left {
            self.happened(&name, now, EventKind::Cell, "left the bus".to_owned());
        }
        self.cells.retain(|_, cell| {
            let kept = if cell.is_making() {
                FORGOTTEN_MAKING_S
            } else {
                FORGOTTEN_S
            };
            cell.left.is_none_or(|left| now.since_s(left) < kept)
        });
        (self.kept).retain(|_, one| now.since_s(one.confirmed) < CONFIRMED_S);
    }

    /// Counts messages that the bus could not deliver to the dashboard. `cell` is empty where it is not known.
    pub fn missed(&mut self, cell: &str, name: &str, count: u64, at: Stamp) {
        *self.missed.entry(name.to_owned()).or_default() += count;
        let text = format!("{count} messages of {name} did not reach the dashboard");
        self.happened(cell, at, EventKind::Loss, text);
    }

    fn happened(&mut self, cell: &str, at: Stamp, kind: EventKind, text: String) {
        self.last_event += 1;
        if let Some(state) = self.cells.get_mut(cell) {
            state.last_event = self.last_event;
        }
        if self.events.len() == EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(Event {
            number: self.last_event,
            at,
            cell: cell.to_owned(),
            kind,
            text,
        });
    }

    /// The cell of that name: as it is known from itself, else as it was kept.
    pub fn cell(&self, name: &str) -> Option<&CellState> {
        let kept = || self.kept.get(name).map(|one| &one.state);
        self.cells.get(name).or_else(kept)
    }

    /// Cells by name, then those that were kept.
    pub fn cells(&self) -> impl Iterator<Item = &CellState> {
        let kept = self.kept.iter();
        let kept = kept.filter(|(name, _)| !self.cells.contains_key(*name));
        self.cells.values().chain(kept.map(|(_, one)| &one.state))
    }

    /// Cells, those that need a person first, then by name.
    pub fn by_attention(&self, now: Stamp) -> Vec<&CellState> {
        let mut cells: Vec<_> = self
            .cells()
            .map(|one| (one.attention(now).0, !one.is_stale(now), one))
            .collect();
        // Of those to be looked at a silent one stands first.
        cells.sort_by_cached_key(|one| (one.0, one.1, by_name(&one.2.name)));
        cells.into_iter().map(|(.., cell)| cell).collect()
    }

    /// Number of the newest event.
    pub fn last_event(&self) -> u64 {
        self.last_event
    }

    /// Events of a cell, or of all, that are newer than `number`, and how many of all are not held any more.
    pub fn events_since<'a>(
        &'a self,
        number: u64,
        cell: Option<&'a str>,
    ) -> (impl DoubleEndedIterator<Item = &'a Event>, u64) {
        let oldest = self
            .events
            .front()
            .map_or(self.last_event + 1, |one| one.number);
        let lost = oldest.saturating_sub(number + 1);
        let held = self.events.iter().filter(move |one| {
            one.number > number && cell.is_none_or(|cell| cell == one.cell || one.cell.is_empty())
        });
        (held, lost)
    }

    /// Cells that were not taken on because there were too many.
    pub fn refused(&self) -> usize {
        self.refused.len()
    }

    /// Takes which cells take acts from pages.
    pub(crate) fn set_desks(&mut self, cells: BTreeSet<String>) {
        self.desks = cells;
    }

    /// Acts can be done to this cell from a page.
    pub(crate) fn takes_acts(&self, cell: &str) -> bool {
        self.desks.contains(cell)
    }

    /// Messages that did not reach the dashboard.
    pub fn missed_total(&self) -> u64 {
        self.missed.values().sum()
    }
}

/// The type that makes a namespace a cell.
pub(crate) fn machine_state() -> &'static MessageType {
    <MachineState as Message>::TYPE
}

#[cfg(test)]
mod tests {
    use probecell_msgs::{std_msgs, to_cdr};

    use super::*;

    #[test]
    fn names_are_sorted_by_the_numbers_in_them() {
        let sorted = [
            "9",
            "lathe_1/b",
            "mill",
            "mill9",
            "mill10",
            "mill10a",
            "mill_2",
        ];
        let mut names = sorted;
        names.reverse();
        names.sort_by_cached_key(|one| by_name(one));
        assert_eq!(names, sorted);
    }

    fn says(hall: &mut Hall, version: &str) {
        let data = format!("# public key of the cell: 00\n{version}[cell]\n");
        let message = to_cdr(&std_msgs::String { data });
        hall.apply("/lathe/cell_description", &message, Stamp(0));
    }

    fn other(hall: &Hall) -> Option<&str> {
        hall.cell("lathe").and_then(CellState::other_version)
    }

    #[test]
    fn a_cell_of_another_version_is_named_until_it_is_none_any_more() {
        let mut hall = Hall::of_version("0.2.0 (abc)".to_owned());
        says(&mut hall, "");
        assert_eq!(other(&hall), None);
        says(&mut hall, "# program: probecell 0.1.0 (def)\n");
        assert_eq!(other(&hall), Some("0.1.0 (def)"));
        says(&mut hall, "# program: probecell 0.2.0 (abc)\n");
        assert_eq!(other(&hall), None);
    }

    #[test]
    fn messages_that_differ_show_a_version_that_is_not_said() {
        let mut hall = Hall::of_version("0.2.0 (abc)".to_owned());
        let with = |names: &[&str]| {
            let new = |name: &&str| ((*name).to_owned(), vec!["share is new".to_owned()]);
            Differs::from([("lathe".to_owned(), names.iter().map(new).collect())])
        };
        hall.set_differs(with(&["plan_progress", "verdicts"]), Stamp(0));
        hall.set_differs(with(&["plan_progress"]), Stamp(0));
        assert_eq!(other(&hall), Some("another version"));
        assert_eq!(hall.events_since(0, None).0.count(), 2); // it appeared, and runs another version
        says(&mut hall, "# program: probecell 0.2.0 (abc)\n");
        assert_eq!(other(&hall), Some("another version"));
        hall.set_differs(Differs::new(), Stamp(1));
        assert_eq!(other(&hall), None);
    }
}
