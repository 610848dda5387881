//! Members of a simulated clock that speak its protocol by themselves, over a bus of channels.

use std::{
    collections::BTreeMap,
    fs,
    io::{Read as _, Write as _},
    os::unix::net::UnixStream,
    path::{Path, PathBuf},
    sync::{
        Arc, Barrier,
        mpsc::{Receiver, Sender, channel},
    },
    thread,
    time::{Duration, Instant},
};

use host::sim_time::{ClockPlace, SimulatedClock};
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

const MS: i64 = 1_000_000;
const NEVER: i64 = i64::MAX;

/// A clock in a folder of its own.
fn begun(speed: Option<f64>, members: usize) -> (tempfile::TempDir, PathBuf, SimulatedClock) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cell.clock");
    let clock = ClockPlace::make(&path)
        .expect("a place")
        .start(speed, members);
    (folder, path, clock.expect("a clock"))
}

fn read(path: &Path) -> i64 {
    i64::from_le_bytes(
        fs::read(path)
            .expect("eight bytes")
            .try_into()
            .expect("eight bytes"),
    )
}

fn joined(path: &Path, name: &str, publishes: &[&str], takes: &[&str]) -> UnixStream {
    let mut stream = UnixStream::connect(path.with_extension("ticks")).expect("a socket");
    let line = serde_json::json!({ "name": name, "publishes": publishes, "takes": takes });
    stream
        .write_all(format!("{line}\n").as_bytes())
        .expect("a line");
    stream
}

fn rest(mut stream: &UnixStream, wake: i64, numbers: &[u64]) {
    let numbers = numbers.iter().flat_map(|number| number.to_le_bytes());
    let report: Vec<u8> = wake.to_le_bytes().into_iter().chain(numbers).collect();
    stream.write_all(&report).expect("a report");
}

fn tick(mut stream: &UnixStream) -> i64 {
    let mut instant = [0; 8];
    stream.read_exact(&mut instant).expect("a tick");
    i64::from_le_bytes(instant)
}

/// What a member of the drawn system receives.
enum Event {
    Tick(i64),
    /// Of which member, number, instant of publication.
    Message(usize, u64, i64),
}

/// A member that publishes to all others at drawn instants and answers some messages, until it has published enough.
fn act(
    own: usize,
    path: &Path,
    events: &Receiver<Event>,
    others: &BTreeMap<usize, Sender<Event>>,
    ticks: Sender<Event>,
    done: &Barrier,
) -> usize {
    const PUBLISHED: u64 = 400;
    let mut random = Pcg64Mcg::seed_from_u64(own as u64);
    let names: Vec<String> = others.keys().map(|other| format!("of {other}")).collect();
    let takes: Vec<&str> = names.iter().map(String::as_str).collect();
    let stream = joined(
        path,
        &format!("member {own}"),
        &[&format!("of {own}")],
        &takes,
    );
    let reader = stream.try_clone().expect("a stream");
    thread::spawn(move || {
        let mut instant = [0; 8];
        while (&reader).read_exact(&mut instant).is_ok()
            && ticks.send(Event::Tick(i64::from_le_bytes(instant))).is_ok()
        {}
    });
    let mut taken: BTreeMap<usize, u64> = others.keys().map(|other| (*other, 0)).collect();
    // Until all have come the clock goes as the real one.
    let (mut wake, mut published, mut heard) = (read(path) + 60_000 * MS, 0, 0);
    loop {
        let numbers: Vec<u64> = std::iter::once(published)
            .chain(taken.values().copied())
            .collect();
        rest(&stream, wake, &numbers);
        let publishes = match events
            .recv_timeout(Duration::from_secs(60))
            .expect("an event")
        {
            Event::Tick(instant) => {
                // Twice where it crossed a report.
                let due = instant >= wake;
                assert!(!due || instant == wake, "{instant} for {wake}");
                due
            }
            Event::Message(other, number, stamp) => {
                assert_eq!(taken.insert(other, number), Some(number - 1));
                assert_eq!(read(path), stamp, "the clock went on under a message");
                heard += 1;
                random.random_bool(0.2)
            }
        };
        if publishes && published < PUBLISHED {
            published += 1;
            let now = read(path);
            for other in others.values() {
                for _ in 0..random.random_range(0..3) {
                    thread::yield_now();
                }
                other
                    .send(Event::Message(own, published, now))
                    .expect("a member");
            }
        }
        if wake <= read(path) {
            wake = read(path) + random.random_range(1..5 * MS);
        }
        if heard == (PUBLISHED as usize) * others.len() && published == PUBLISHED {
            let numbers: Vec<u64> = std::iter::once(published)
                .chain(taken.values().copied())
                .collect();
            rest(&stream, NEVER, &numbers);
            // Where one is missing the clock goes on.
            done.wait();
            return heard;
        }
    }
}

#[test]
fn the_clock_stands_while_a_message_is_under_way_and_wakes_each_at_its_own_instant() {
    const MEMBERS: usize = 4;
    let (_folder, path, _clock) = begun(None, MEMBERS);
    let channels: Vec<_> = (0..MEMBERS).map(|_| channel()).collect();
    let senders: BTreeMap<usize, Sender<Event>> = channels
        .iter()
        .map(|(sender, _)| sender.clone())
        .enumerate()
        .collect();
    let done = Arc::new(Barrier::new(MEMBERS));
    let members: Vec<_> = (channels.into_iter().enumerate())
        .map(|(own, (ticks, events))| {
            let (path, mut others, done) = (path.clone(), senders.clone(), Arc::clone(&done));
            others.remove(&own);
            thread::spawn(move || act(own, &path, &events, &others, ticks, &done))
        })
        .collect();
    for member in members {
        assert_eq!(member.join().unwrap(), 400 * (MEMBERS - 1));
    }
}

#[test]
fn while_a_process_is_missing_the_clock_goes_as_the_real_one() {
    let (_folder, path, _clock) = begun(None, 2);
    let alone = joined(&path, "one of two", &[], &[]);
    let (begun, from) = (Instant::now(), read(&path));
    rest(&alone, from + 50 * MS, &[]);
    let instant = tick(&alone);
    assert!(instant >= from + 50 * MS, "{}", instant - from);
    assert!(
        begun.elapsed() > Duration::from_millis(40),
        "{:?}",
        begun.elapsed()
    );
}

#[test]
fn the_clock_is_no_faster_than_is_wanted() {
    let (_folder, path, clock) = begun(Some(2.0), 1);
    let member = joined(&path, "the only one", &["x"], &[]);
    rest(&member, NEVER, &[0]);
    let (begun, from) = (Instant::now(), read(&path));
    for step in 1..=20 {
        rest(&member, from + step * 10 * MS, &[0]);
        assert_eq!(tick(&member), from + step * 10 * MS);
    }
    assert!(
        begun.elapsed() > Duration::from_millis(90),
        "{:?}",
        begun.elapsed()
    );
    clock.end();
    assert!(!path.exists() && !path.with_extension("ticks").exists());
}

#[test]
fn where_a_clock_runs_no_other_begins() {
    let (_folder, path, _clock) = begun(None, 1);
    let error = ClockPlace::make(&path).err().unwrap();
    assert_eq!(error.kind(), std::io::ErrorKind::AddrInUse);
}
