//! A recorder killed at any moment loses nothing that it stated to be durable.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use bags::{Bag, recover};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

const INTERVAL_MS: u64 = 200;

/// Requests sent ahead of the answers, so that the kill meets the writer at work.
const AHEAD: usize = 32;

/// Cargo builds examples beside the tests: `target/<profile>/deps/<test>` and `target/<profile>/examples/<name>`.
pub(crate) fn paced_writer() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent()
        .unwrap()
        .parent()
        .unwrap()
        .join("examples/paced_writer")
}

/// What the writer states after a push.
struct Pushed {
    /// Messages that its recorder states to be on disk.
    durable: usize,
    /// Instant of the push, ns since the writer's start.
    instant: u64,
}

fn parse(line: &str) -> Option<Pushed> {
    let mut fields = line.split(' ').skip(1);
    Some(Pushed {
        durable: fields.next()?.parse().ok()?,
        instant: fields.next()?.parse().ok()?,
    })
}

/// Runs the writer and kills it once it has run for `life_ms` and states `durable` messages on disk; its statements,
/// those read after the kill included.
fn run_and_kill(folder: &Path, life_ms: u64, durable: usize) -> Vec<Pushed> {
    let mut writer = Command::new(paced_writer())
        .args([folder.as_os_str(), INTERVAL_MS.to_string().as_ref()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut requests = writer.stdin.take().unwrap();
    let mut answers = BufReader::new(writer.stdout.take().unwrap()).lines();
    let mut pushed: Vec<Pushed> = Vec::new();
    requests.write_all(&[0; AHEAD]).unwrap();
    while pushed
        .last()
        .is_none_or(|last| last.instant < life_ms * 1_000_000 || last.durable < durable)
    {
        pushed.push(parse(&answers.next().unwrap().unwrap()).unwrap());
        requests.write_all(&[0]).unwrap();
    }
    // `Child::kill` is SIGKILL.
    writer.kill().unwrap();
    pushed.extend(
        answers
            .map_while(Result::ok)
            .filter_map(|line| parse(&line)),
    );
    writer.wait().unwrap();
    pushed
}

#[test]
fn killed_recordings_are_readable_and_hold_what_was_stated_durable() {
    let kills = shared_data::share(10, 50);
    let mut random = Pcg64::seed_from_u64(9);
    let mut recorded = 0;
    let mut lost = 0;
    let mut oldest_lost = 0;
    for run in 0..kills {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        // Every fifth run may die before the first sync; the others die after it.
        let pushed = run_and_kill(
            &path,
            random.random_range(0..3 * INTERVAL_MS),
            usize::from(run % 5 != 0),
        );
        let bag = Bag::open(&path).unwrap();
        let numbers: Vec<u64> = bag
            .messages()
            .filter_map(Result::ok)
            .map(|message| u64::from(message.sequence))
            .collect();
        assert!(
            numbers.iter().copied().eq(0..numbers.len() as u64),
            "run {run}: a gap before the end"
        );
        let last = &pushed[pushed.len() - 1];
        assert!(
            last.durable <= numbers.len(),
            "run {run}: {} messages were stated durable, {} are there",
            last.durable,
            numbers.len()
        );
        if let Some(first_lost) = pushed.get(numbers.len()) {
            oldest_lost = oldest_lost.max(last.instant - first_lost.instant);
        }
        recorded += numbers.len();
        lost += pushed.len().saturating_sub(numbers.len());
        let whole = recover(&path, folder.path().join("whole"), None).unwrap();
        assert_eq!(whole.messages, numbers.len() as u64);
        assert_eq!(Bag::open(folder.path().join("whole")).unwrap().verify(), []);
    }
    println!(
        "{kills} kills: {recorded} messages recorded, {lost} lost, the oldest of them {} ms old (sync interval {INTERVAL_MS} ms)",
        oldest_lost / 1_000_000
    );
}

#[test]
fn an_ended_recording_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let mut writer = Command::new(paced_writer())
        .arg(&path)
        .arg("100000")
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    writer.stdin.take().unwrap().write_all(&[0; 5000]).unwrap();
    assert!(writer.wait().unwrap().success());
    let bag = Bag::open(&path).unwrap();
    assert_eq!(bag.verify(), []);
    assert_eq!(bag.messages().count(), 5000);
}
