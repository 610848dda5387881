//! A recorder killed at any moment loses at most its sync interval.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

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
fn paced_writer() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent()
        .unwrap()
        .parent()
        .unwrap()
        .join("examples/paced_writer")
}

/// Runs the writer, kills it when it tells a time of `life_ms` or later; gives the answers, those after the kill included.
fn run_and_kill(folder: &Path, life_ms: u64) -> Vec<(u64, u64)> {
    let mut writer = Command::new(paced_writer())
        .args([folder.as_os_str(), INTERVAL_MS.to_string().as_ref()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut requests = writer.stdin.take().unwrap();
    let mut answers = BufReader::new(writer.stdout.take().unwrap()).lines();
    let mut told: Vec<(u64, u64)> = Vec::new();
    let parse = |line: String| {
        let (number, time) = line.split_once(' ')?;
        Some((number.parse().ok()?, time.parse().ok()?))
    };
    requests.write_all(&[0; AHEAD]).unwrap();
    while told
        .last()
        .is_none_or(|(_, time)| *time < life_ms * 1_000_000)
    {
        told.push(parse(answers.next().unwrap().unwrap()).unwrap());
        requests.write_all(&[0]).unwrap();
    }
    // `Child::kill` is SIGKILL.
    writer.kill().unwrap();
    told.extend(answers.map_while(Result::ok).filter_map(parse));
    writer.wait().unwrap();
    told
}

#[test]
fn fifty_killed_recordings_read_and_miss_nothing_older_than_the_interval() {
    let mut random = Pcg64::seed_from_u64(9);
    let mut recorded = 0;
    let mut lost = 0;
    let mut older_than_interval = 0;
    for run in 0..50 {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        let told = run_and_kill(&path, random.random_range(0..3 * INTERVAL_MS));
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
        let (_, last) = told[told.len() - 1];
        for (number, time) in &told {
            if time + INTERVAL_MS * 1_000_000 <= last {
                older_than_interval += 1;
                assert!(
                    (*number as usize) < numbers.len(),
                    "run {run}: message {number} of {time} ns is lost, killed after {last} ns"
                );
            }
        }
        recorded += numbers.len();
        lost += told.len().saturating_sub(numbers.len());
        let whole = recover(&path, folder.path().join("whole")).unwrap();
        assert_eq!(whole.messages, numbers.len() as u64);
        assert_eq!(Bag::open(folder.path().join("whole")).unwrap().verify(), []);
    }
    assert!(
        older_than_interval > 0,
        "no run lasted longer than the interval: the test proves nothing"
    );
    println!(
        "50 kills: {recorded} messages recorded, {lost} younger than {INTERVAL_MS} ms lost, {older_than_interval} older ones all there"
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
