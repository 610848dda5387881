//! Cells that are none, for measuring what reads many of them: `load ENDPOINT RECORDING FIRST COUNT [EVERY]`.
//!
//! Joins the router at ENDPOINT in one session as COUNT cells, `cell_FIRST` and following, each with publishers of its own, and plays on each what
//! the recording of one cell holds of topics that the dashboard reads, at its pace, over and over, every cell at another place of
//! it: state and axes at 100 Hz (or only every EVERYth of these), touches, sizes, verdicts, corrections, gap reports, in the bytes that the cell has published, with
//! the instant of the publication as stamp. It ends when its input does, and then prints how many messages it published and how late
//! they were. `tests/benches/hall.py` measures with it.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use bags::Bag;
use dashboard::state::read_topics;
use graph::{Topic, topics};
use host::bus::{Bus, BusConfig, Publisher};
use host::bus_qos;

/// Time between two rounds over the cells; axes come every 10 ms. What is due in a round goes out in few writes.
const ROUND: Duration = Duration::from_millis(5);
/// For what was published last; on busy processors a session of many publishers takes its time to end.
const CLOSING: Duration = Duration::from_secs(30);
/// Topics at the rate of the controller.
const FAST: [&str; 2] = [topics::MACHINE_STATE.name, topics::JOINT_STATES.name];
/// Where the stamp of a header stands in a message: after the encapsulation; seconds and nanoseconds, four bytes each.
const STAMP: usize = 4;

/// A message of the recording.
struct Message {
    /// Since the start of the recording.
    at: Duration,
    topic: usize,
    bytes: Vec<u8>,
}

/// What all cells play.
struct Piece {
    topics: Vec<Topic>,
    /// In order of time.
    messages: Vec<Message>,
    length: Duration,
}

impl Piece {
    fn read(path: &str, every: usize) -> anyhow::Result<Self> {
        let bag = Bag::open(path)?;
        let (begin, end) = bag.bounds().context("the recording is empty")?;
        let mut numbers = BTreeMap::new();
        let (mut topics, mut messages) = (Vec::new(), Vec::new());
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for one in bag.messages() {
            let one = one?;
            let Some((_, name)) = one.channel.topic[1..].split_once('/') else {
                continue;
            };
            let Some(topic) = topics::by_name(name).filter(is_read) else {
                continue;
            };
            if FAST.contains(&topic.name) {
                let count = counts.entry(topic.name).or_default();
                *count += 1;
                if !count.is_multiple_of(every) {
                    continue;
                }
            }
            let number = *numbers.entry(topic.name).or_insert_with(|| {
                topics.push(topic);
                topics.len() - 1
            });
            messages.push(Message {
                at: Duration::from_nanos(one.log_time - begin),
                topic: number,
                bytes: one.payload.to_vec(),
            });
        }
        ensure!(!messages.is_empty(), "{path} holds no topic of a cell");
        Ok(Self {
            topics,
            messages,
            length: Duration::from_nanos(end - begin),
        })
    }

    /// The number of the first message at or after an instant.
    fn from(&self, at: Duration) -> usize {
        self.messages.partition_point(|one| one.at < at)
    }
}

/// The dashboard reads it, always or while a page asks for it; the others stay on the hosts of their cells.
fn is_read(topic: &Topic) -> bool {
    read_topics().iter().any(|one| one.name == topic.name)
}

/// One cell.
struct Cell<'a> {
    piece: &'a Piece,
    publishers: Vec<Publisher>,
    next: usize,
    /// When the recording began, as this cell plays it.
    begun: Instant,
    published: u64,
    /// Of the latest message.
    behind: Duration,
}

impl<'a> Cell<'a> {
    /// Joins the bus, `at` some instant of the recording, and publishes what is latched there.
    fn join(piece: &'a Piece, bus: &Bus, number: usize, at: Duration) -> anyhow::Result<Self> {
        let publish = |topic: &Topic| {
            let name = format!("/cell_{number}/{}", topic.name);
            bus.publisher(&name, topic.message, bus_qos(topic.qos))
        };
        let publishers = piece.topics.iter().map(publish).collect::<Result<_, _>>()?;
        let mut cell = Self {
            piece,
            publishers,
            next: piece.from(at),
            begun: Instant::now()
                .checked_sub(at)
                .context("the machine was started less than a recording ago")?,
            published: 0,
            behind: Duration::ZERO,
        };
        for number in 0..cell.next {
            if piece.topics[piece.messages[number].topic]
                .qos
                .transient_local
            {
                cell.publish(number)?;
            }
        }
        Ok(cell)
    }

    fn publish(&mut self, number: usize) -> anyhow::Result<()> {
        let message = &self.piece.messages[number];
        let mut bytes = message.bytes.clone();
        let now = host::now();
        let definition = self.piece.topics[message.topic].message.definition;
        let is_stamped = definition
            .lines()
            .find(|line| !line.is_empty() && !line.starts_with('#'))
            .is_some_and(|line| line.starts_with("std_msgs/Header "));
        if is_stamped {
            let (seconds, rest) = (
                now.0.div_euclid(1_000_000_000),
                now.0.rem_euclid(1_000_000_000),
            );
            bytes[STAMP..STAMP + 4].copy_from_slice(&(seconds as i32).to_le_bytes());
            bytes[STAMP + 4..STAMP + 8].copy_from_slice(&(rest as u32).to_le_bytes());
        }
        self.publishers[message.topic].publish(bytes, now.0)?;
        self.published += 1;
        Ok(())
    }

    /// Publishes what is due.
    fn play(&mut self) -> anyhow::Result<()> {
        loop {
            let due = self.begun + self.piece.messages[self.next].at;
            let Some(behind) = Instant::now().checked_duration_since(due) else {
                return Ok(());
            };
            self.behind = behind;
            self.publish(self.next)?;
            self.next += 1;
            if self.next == self.piece.messages.len() {
                self.next = 0;
                self.begun += self.piece.length;
            }
        }
    }
}

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, recording, first, count, every @ ..] = words.as_slice() else {
        anyhow::bail!("load ENDPOINT RECORDING FIRST COUNT [EVERY]");
    };
    let (first, count): (usize, u32) = (first.parse()?, count.parse()?);
    let every: NonZeroUsize = every.first().map_or("1", String::as_str).parse()?;
    let piece = Piece::read(recording, every.get())?;
    let config = BusConfig {
        endpoints: vec![endpoint.clone()],
        // As the processes of a cell: sessions that link to one another tell each other all that they announce.
        listen: Vec::new(),
        zenoh: serde_json::json!({ "mode": "client" }),
        graph: host::bus::Followed::OwnTopics,
        ..BusConfig::default()
    };
    let bus = Bus::open(&config, &format!("load_{first}"), "/load")?;
    let mut cells = (0..count)
        .map(|one| {
            let at = piece.length * one / count;
            Cell::join(&piece, &bus, first + one as usize, at)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let ended = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&ended);
    std::thread::spawn(move || {
        // Whatever ends the input ends this.
        drop(std::io::stdin().read_to_end(&mut Vec::new()));
        seen.store(true, Ordering::Relaxed);
    });
    let mut out = std::io::stdout().lock();
    writeln!(out, "ready")?;
    // Joining has taken a while: time begins now.
    let begun = Instant::now();
    for (one, cell) in cells.iter_mut().enumerate() {
        let at = piece.length * one as u32 / count;
        cell.begun = begun.checked_sub(at).context("the clock began too late")?;
        cell.published = 0;
    }
    let mut worst = Duration::ZERO;
    while !ended.load(Ordering::Relaxed) {
        let round = Instant::now();
        for cell in &mut cells {
            cell.play()?;
            worst = worst.max(cell.behind);
        }
        std::thread::sleep(ROUND.saturating_sub(round.elapsed()));
    }
    let published: u64 = cells.iter().map(|one| one.published).sum();
    let seconds = begun.elapsed().as_secs_f64();
    writeln!(
        out,
        "{published} messages in {seconds:.1} s, {:.1} s late at the most, {:.1} s at the end",
        worst.as_secs_f64(),
        cells
            .iter()
            .map(|one| one.behind)
            .max()
            .unwrap_or_default()
            .as_secs_f64()
    )?;
    drop(cells);
    bus.close(CLOSING)?;
    Ok(())
}
