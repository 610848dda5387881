//! The event stream of a page: the parts of it that have changed, as HTML.
//!
//! Each client has one bounded memory: a hash of each part as it was sent. Parts are written when its connection has room
//! again, from the state as it is then, hence a slow client skips states and holds nobody up. The identifier of each event is
//! `EPOCH-NUMBER`, with the newest event of the hall that the part shows; a page that comes back with it is told how many
//! events it missed, of which kinds, and how many are not held any more.

use std::collections::{BTreeMap, VecDeque, hash_map::DefaultHasher};
use std::hash::{Hash, Hasher};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use futures::Stream;
use futures::stream::unfold;
use hyper::body::Bytes;
use serde_json::json;

use crate::live::Live;
use crate::state::{EventKind, Section};
use crate::view::{
    Choice, View, legend, order_of, section, section_id, strip_length, sums, tile, tile_id,
};

/// Shortest time between two rounds of one client: changes that come closer are sent together.
const ROUND: Duration = Duration::from_millis(80);
/// The same of the hall, where events of many cells come all the time.
const HALL_ROUND: Duration = Duration::from_millis(200);
/// Longest time between two rounds: axes, ages and elapsed times go on without events.
const IDLE: Duration = Duration::from_millis(500);
/// Streams at once.
pub(crate) const CLIENTS: usize = 256;

/// What a page shows.
#[derive(Clone, Debug)]
pub(crate) enum Shown {
    /// The hall, or some cells of it.
    Hall(Choice),
    /// A cell by name, seen from somewhere.
    Cell(String, View),
}

/// Counts the clients that are connected.
#[derive(Clone, Default)]
pub(crate) struct Clients(Arc<AtomicUsize>);

/// A place among the clients, free again when dropped.
pub(crate) struct Seat(Arc<AtomicUsize>);

impl Clients {
    /// Takes a place; none when `most` are taken.
    pub(crate) fn take(&self, most: usize) -> Option<Seat> {
        let seat = Seat(Arc::clone(&self.0));
        (self.0.fetch_add(1, Ordering::SeqCst) < most).then_some(seat)
    }

    pub(crate) fn count(&self) -> usize {
        self.0.load(Ordering::SeqCst)
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

struct Client {
    live: Arc<Live>,
    epoch: u64,
    shown: Shown,
    /// Hash of each part as it was sent.
    sent: BTreeMap<String, u64>,
    /// Newest event of each cell as it was written.
    tiles: BTreeMap<String, u64>,
    /// When all tiles were written last.
    whole: Option<Instant>,
    /// Order of the tiles as it was sent.
    order: Vec<String>,
    /// Revision of each section as it was written last.
    written: BTreeMap<Section, u64>,
    waiting: VecDeque<Bytes>,
    changes: tokio::sync::watch::Receiver<u64>,
    begun: bool,
    _seat: Seat,
}

/// The stream of one client. `seen` is the identifier of the last event that its page has.
pub(crate) fn stream(
    live: Arc<Live>,
    epoch: u64,
    shown: Shown,
    seen: Option<&str>,
    seat: Seat,
) -> impl Stream<Item = io::Result<Bytes>> + use<> {
    let changes = live.changes();
    let mut client = Client {
        live,
        epoch,
        shown,
        sent: BTreeMap::new(),
        tiles: BTreeMap::new(),
        whole: None,
        order: Vec::new(),
        written: BTreeMap::new(),
        waiting: VecDeque::new(),
        changes,
        begun: false,
        _seat: seat,
    };
    if let Some(seen) = seen {
        let told = client.missed(seen);
        client.waiting.push_back(told);
    }
    unfold(client, |mut client| async move {
        loop {
            if let Some(event) = client.waiting.pop_front() {
                return Some((Ok(event), client));
            }
            if client.begun {
                client.wait().await;
            }
            client.begun = true;
            client.changes.mark_unchanged();
            client.round();
        }
    })
}

fn identifier(epoch: u64, number: u64) -> String {
    format!("{epoch:x}-{number}")
}

/// An event as HTML has it (server-sent events): JSON is one line.
fn event(name: &str, id: &str, told: &serde_json::Value) -> Bytes {
    Bytes::from(format!("event: {name}\nid: {id}\ndata: {told}\n\n"))
}

/// Identifier of the state that a page which is written now shows.
pub(crate) fn seen_now(live: &Live, epoch: u64) -> String {
    identifier(epoch, live.hall().last_event())
}

impl Client {
    /// Until something has happened that the page shows, or for [`IDLE`]; at least one round.
    async fn wait(&mut self) {
        let round = match self.shown {
            Shown::Hall(_) => HALL_ROUND,
            Shown::Cell(..) => ROUND,
        };
        tokio::time::sleep(round).await;
        let end = tokio::time::Instant::now() + IDLE.saturating_sub(round);
        // The sender lives as long as the server.
        while let Ok(Ok(())) = tokio::time::timeout_at(end, self.changes.changed()).await {
            if self.is_concerned() {
                return;
            }
        }
    }

    /// An event has happened that the page has not been shown: of all cells, or of its own.
    fn is_concerned(&self) -> bool {
        let Shown::Cell(name, _) = &self.shown else {
            return true;
        };
        let hall = self.live.hall();
        let newest = hall.cell(name).map(|cell| cell.last_event);
        newest != self.tiles.get(name).copied()
    }

    /// What a page missed since the event `seen`.
    fn missed(&self, seen: &str) -> Bytes {
        let hall = self.live.hall();
        let now = identifier(self.epoch, hall.last_event());
        let number = seen
            .split_once('-')
            .filter(|(epoch, _)| *epoch == format!("{:x}", self.epoch))
            .and_then(|(_, number)| number.parse().ok());
        let Some(number) = number else {
            return event("restarted", &now, &json!({}));
        };
        let cell = match &self.shown {
            Shown::Hall(_) => None,
            Shown::Cell(name, _) => Some(name.as_str()),
        };
        let (events, lost) = hall.events_since(number, cell);
        let mut kinds = BTreeMap::<EventKind, usize>::new();
        for event in events {
            *kinds.entry(event.kind).or_default() += 1;
        }
        let words: Vec<String> = kinds
            .iter()
            .map(|(kind, count)| {
                let (one, several) = kind.words();
                format!("{count} {}", if *count == 1 { one } else { several })
            })
            .collect();
        let total: usize = kinds.values().sum();
        let told = json!({ "events": total, "kinds": words, "lost": lost });
        event("caught-up", &now, &told)
    }

    /// Writes what has changed since the last round.
    fn round(&mut self) {
        let live = Arc::clone(&self.live);
        let hall = live.hall();
        let now = host::now();
        let id = identifier(self.epoch, hall.last_event());
        let mut parts: Vec<(String, String)> = Vec::new();
        match &self.shown {
            Shown::Hall(choice) => {
                // Ages, temperatures and lines of programs change all the time: they wait for the next round of all tiles.
                let all = self.whole.is_none_or(|last| last.elapsed() >= IDLE);
                if all {
                    self.whole = Some(Instant::now());
                    self.tiles.retain(|name, _| hall.cell(name).is_some());
                }
                let length = strip_length(&hall, now);
                for cell in choice.cells(&hall, now) {
                    let known = self.tiles.insert(cell.name.clone(), cell.last_event);
                    if all || known != Some(cell.last_event) {
                        parts.push((tile_id(&cell.name), tile(cell, now, length).into_string()));
                    }
                }
                parts.push((
                    "sums".to_owned(),
                    format!("<p id=\"sums\">{}</p>", sums(&hall, now).into_string()),
                ));
                parts.push(("legend".to_owned(), legend(length).into_string()));
                let order = order_of(&hall, now, choice);
                if order != self.order {
                    self.waiting.push_back(event("order", &id, &json!(order)));
                    self.sent.retain(|part, _| {
                        ["sums", "legend"].contains(&part.as_str()) || order.contains(part)
                    });
                    self.order = order;
                }
            }
            Shown::Cell(name, view) => match hall.cell(name) {
                Some(cell) => {
                    live.want_axes(name);
                    self.tiles.insert(name.clone(), cell.last_event);
                    let path = format!("/cell/{name}");
                    for one in Section::ALL {
                        // Those that are much work change with messages only, not with time.
                        let still = matches!(
                            one,
                            Section::Part
                                | Section::Sizes
                                | Section::Runs
                                | Section::Why
                                | Section::Gap
                        );
                        let revision = cell.revisions.get(&one).copied().unwrap_or_default();
                        if self.written.insert(one, revision) == Some(revision) && still {
                            continue;
                        }
                        let id = section_id(one).to_owned();
                        parts.push((
                            id,
                            section(one, cell, &hall, now, *view, &path).into_string(),
                        ));
                    }
                }
                None if self.sent.is_empty() => {}
                None => {
                    self.tiles.clear();
                    self.sent.clear();
                    self.written.clear();
                    self.waiting.push_back(event("gone", &id, &json!({})));
                }
            },
        }
        drop(hall);
        let trouble = live.trouble();
        parts.push((
            "bus".to_owned(),
            maud::html! { p.mark #bus hidden[trouble.is_empty()] { (trouble) } }.into_string(),
        ));
        for (part, html) in parts {
            let mut hasher = DefaultHasher::new();
            html.hash(&mut hasher);
            let hash = hasher.finish();
            if self.sent.insert(part.clone(), hash) != Some(hash) {
                let told = json!({ "id": part, "html": html });
                self.waiting.push_back(event("part", &id, &told));
            }
        }
        if self.waiting.is_empty() {
            // Shows the page that the connection lives.
            self.waiting.push_back(event("beat", &id, &json!({})));
        }
    }
}
