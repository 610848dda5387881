//! What a power failure can leave of a recording: every prefix of its bytes that was synced at least, with any tail.
//!
//! A recording only grows, so after a power failure the disk holds what was synced, and of the rest any part: nothing, a
//! prefix, pages that were never written (zeros) before pages that were, or rubbish.

use std::path::Path;
use std::time::Duration;

use bags::{Bag, ChannelId, Overflow, Recorder, RecorderOptions};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

use crate::{kill::paced_writer, topic};

/// Syncs of the run.
const SYNCS: usize = 12;

/// A recorder and its one channel.
pub(crate) fn begun(folder: &Path, sync_interval: Duration) -> (Recorder, ChannelId) {
    let recorder = Recorder::start(RecorderOptions {
        sync_interval,
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder)
    })
    .unwrap();
    let channel = recorder.channel(&topic()).unwrap();
    (recorder, channel)
}

/// The bytes of a run, and after each sync: messages stated durable, and the size of the file. Each message waits for the
/// sync of the one before, and less is written between syncs than any buffer holds, so that nothing but a sync writes.
fn run(folder: &Path) -> (Vec<u8>, Vec<(u64, usize)>) {
    let (recorder, channel) = begun(folder, Duration::from_millis(2));
    let file = folder.join("run_0.mcap");
    let mut syncs = Vec::new();
    let mut number = 0_u64;
    for _ in 0..SYNCS {
        for _ in 0..3 {
            let payload = number.to_le_bytes().repeat(6);
            recorder
                .push(channel, number, number, number, payload)
                .unwrap();
            number += 1;
        }
        while recorder.durable_messages() < number {
            assert!(recorder.failure().is_none());
            std::thread::yield_now();
        }
        let size = std::fs::metadata(&file).unwrap().len();
        syncs.push((number, size as usize));
    }
    // The process is gone, as far as the disk knows: neither summary nor footer.
    let bytes = std::fs::read(&file).unwrap();
    drop(recorder);
    (bytes, syncs)
}

/// The first messages that can be read of a file, up to the first that cannot.
fn readable(folder: &Path, bytes: &[u8]) -> u64 {
    let file = folder.join("crashed.mcap");
    std::fs::write(&file, bytes).unwrap();
    let Ok(bag) = Bag::open(&file) else { return 0 };
    let numbers: Vec<u64> = (bag.messages().filter_map(Result::ok))
        .map(|message| u64::from(message.sequence))
        .collect();
    // What stands behind a lost page may be read as well.
    let first = numbers
        .iter()
        .zip(0..)
        .take_while(|(number, expected)| **number == *expected);
    first.count() as u64
}

#[test]
fn whatever_a_power_failure_leaves_what_was_stated_durable_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, syncs) = run(&folder.path().join("run"));
    assert_eq!(syncs[SYNCS - 1].0, 3 * SYNCS as u64);
    let mut random = Pcg64::seed_from_u64(1);
    let mut crashes = 0;
    for cut in syncs[0].1..=bytes.len() {
        let &(durable, synced) = syncs.iter().rfind(|(_, size)| *size <= cut).unwrap();
        let prefix = &bytes[..cut];
        let rubbish: Vec<u8> = (0..random.random_range(1..600))
            .map(|_| random.random())
            .collect();
        // The page that was being written is lost, the one after it is not.
        let mut holed = bytes[..(cut + 300).min(bytes.len())].to_vec();
        holed[synced..cut].fill(0);
        for left in [
            prefix.to_vec(),
            [prefix, &[0; 512]].concat(),
            [prefix, &rubbish].concat(),
            holed,
        ] {
            let there = readable(folder.path(), &left);
            assert!(
                there >= durable,
                "cut at {cut}: {durable} stated durable, {there} are there"
            );
            crashes += 1;
        }
    }
    println!(
        "{crashes} crashes of a recording of {} bytes, {SYNCS} syncs",
        bytes.len()
    );
}

/// A device that refuses: the limit of a file's size stands for a full disk, since that needs no rights. The recording ends
/// with a failure, later pushes are refused with it, and what was stated durable is there.
#[test]
#[cfg(unix)]
fn a_full_disk_ends_the_recording_with_a_failure() {
    use std::io::{BufRead, BufReader, Write};
    use std::process::{Command, Stdio};

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let mut process = Command::new("bash")
        // 1 MiB, in units of 1 KiB.
        .args(["-c", "trap '' XFSZ; ulimit -f 1024; exec \"$0\" \"$@\""])
        .arg(paced_writer())
        .arg(&path)
        .arg("5")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut requests = process.stdin.take().unwrap();
    let answers = BufReader::new(process.stdout.take().unwrap());
    // Until it ends by itself: its input never does.
    let asking = std::thread::spawn(move || while requests.write_all(&[0; 16]).is_ok() {});
    let lines: Vec<String> = answers.lines().map_while(Result::ok).collect();
    let ended = process.wait_with_output().unwrap();
    asking.join().unwrap();
    assert!(!ended.status.success());
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(
        said.contains("run_0.mcap") || said.contains("FileTooLarge"),
        "{said}"
    );
    let durable = lines
        .iter()
        .filter_map(|line| line.split(' ').nth(1)?.parse::<usize>().ok());
    let durable = durable.max().unwrap();
    let there = Bag::open(&path)
        .unwrap()
        .messages()
        .filter_map(Result::ok)
        .count();
    assert!(
        durable > 0 && there >= durable,
        "{durable} stated durable, {there} are there"
    );
}
