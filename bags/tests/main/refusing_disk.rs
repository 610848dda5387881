//! A disk that refuses: each write, each sync, each new name of a run in turn, with EIO, with ENOSPC, and after half of the
//! bytes. The recording ends with a failure that every pusher learns, the disk is not tried again, and of what the
//! recorder had stated durable nothing is missing.

use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bags::{
    Bag, Disk, DiskFile, Error, Overflow, Recorder, RecorderOptions, Sealer, SplitAt, SystemDisk,
};

use crate::topic;

/// Linux.
const ENOSPC: i32 = 28;
const EIO: i32 = 5;

/// How an operation fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Failure {
    /// Nothing is done, with this number of the system.
    Nothing(i32),
    /// Half of the bytes of a write are on the disk, then it is full; any other operation fails as a whole.
    Half,
    /// A sync fails, and what was written since the last one is gone, as on Linux (the pages count as clean).
    Dropped,
}

#[derive(Debug)]
struct State {
    /// Number of the operation that fails, from 0.
    fails: usize,
    failure: Failure,
    done: AtomicUsize,
    failed: AtomicBool,
    /// Operations after the failure that changed a file of the recording.
    after: Mutex<Vec<String>>,
}

impl State {
    /// Counts an operation; the failure where it is its turn.
    fn turn(&self, what: &str) -> Option<Failure> {
        if self.failed.load(Ordering::SeqCst) {
            self.after.lock().unwrap().push(what.to_owned());
        }
        let number = self.done.fetch_add(1, Ordering::SeqCst);
        (number == self.fails).then(|| {
            self.failed.store(true, Ordering::SeqCst);
            self.failure
        })
    }
}

#[derive(Clone, Debug)]
struct Refusing(Arc<State>);

struct RefusingFile {
    file: Arc<dyn DiskFile>,
    path: std::path::PathBuf,
    synced: AtomicUsize,
    written: AtomicUsize,
    disk: Refusing,
}

fn error(failure: Failure) -> io::Error {
    io::Error::from_raw_os_error(match failure {
        Failure::Nothing(number) => number,
        Failure::Half => ENOSPC,
        Failure::Dropped => EIO,
    })
}

impl DiskFile for RefusingFile {
    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        match self.disk.0.turn("write") {
            None => {}
            Some(Failure::Half) if bytes.len() > 1 => {
                // The system takes some; the next write is refused.
                let taken = self.file.write(&bytes[..bytes.len() / 2])?;
                self.written.fetch_add(taken, Ordering::SeqCst);
                return Ok(taken);
            }
            Some(failure) => return Err(error(failure)),
        }
        if self.disk.0.failure == Failure::Half && self.disk.0.failed.load(Ordering::SeqCst) {
            return Err(error(Failure::Half));
        }
        let written = self.file.write(bytes)?;
        self.written.fetch_add(written, Ordering::SeqCst);
        Ok(written)
    }

    fn sync(&self) -> io::Result<()> {
        if let Some(failure) = self.disk.0.turn("sync") {
            if failure == Failure::Dropped {
                let synced = self.synced.load(Ordering::SeqCst) as u64;
                let file = std::fs::OpenOptions::new().write(true).open(&self.path)?;
                file.set_len(synced)?;
            }
            return Err(error(failure));
        }
        self.file.sync()?;
        let written = self.written.load(Ordering::SeqCst);
        self.synced.store(written, Ordering::SeqCst);
        Ok(())
    }
}

impl Disk for Refusing {
    fn create(&self, path: &Path, anew: bool) -> io::Result<Arc<dyn DiskFile>> {
        if let Some(failure) = self.0.turn("create") {
            return Err(error(failure));
        }
        Ok(Arc::new(RefusingFile {
            file: SystemDisk.create(path, anew)?,
            path: path.to_owned(),
            synced: AtomicUsize::new(0),
            written: AtomicUsize::new(0),
            disk: self.clone(),
        }))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        match self.0.turn("rename") {
            Some(failure) => Err(error(failure)),
            None => SystemDisk.rename(from, to),
        }
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        match self.0.turn("sync of the folder") {
            Some(failure) => Err(error(failure)),
            None => SystemDisk.sync_folder(folder),
        }
    }
}

/// A recording of several files, sealed, on a disk that refuses one operation: what was stated durable, and how it ended.
fn record(folder: &Path, disk: &Refusing) -> (u64, Result<(), Error>) {
    let recorder = Recorder::start(RecorderOptions {
        sync_interval: Duration::from_millis(2),
        overflow: Overflow::Block,
        split: SplitAt {
            bytes: Some(1500),
            ..SplitAt::default()
        },
        compress: false,
        chunk_bytes: 300,
        sealer: Some(Sealer::new(|bytes: &[u8]| {
            bytes[..bytes.len().min(64)].to_vec()
        })),
        disk: Arc::new(disk.clone()),
        ..RecorderOptions::new(folder)
    });
    let recorder = match recorder {
        Ok(recorder) => recorder,
        Err(refused) => return (0, Err(refused)),
    };
    let channel = match recorder.channel(&topic()) {
        Ok(channel) => channel,
        Err(refused) => return (0, Err(refused)),
    };
    let mut number = 0_u64;
    'batches: for _ in 0..8 {
        for _ in 0..6 {
            let payload = number.to_le_bytes().repeat(6);
            if recorder
                .push(channel, number, number, number, payload)
                .is_err()
            {
                break 'batches;
            }
            number += 1;
        }
        while recorder.durable_messages() < number {
            if recorder.failure().is_some() {
                break 'batches;
            }
            std::thread::yield_now();
        }
    }
    let durable = recorder.durable_messages();
    if let Some(failure) = recorder.failure() {
        // Every pusher learns of it, as often as it asks.
        for _ in 0..2 {
            let again = recorder.push(channel, 0, 0, 0, vec![0]).unwrap_err();
            assert_eq!(again.to_string(), failure.to_string());
        }
        assert_eq!(recorder.durable_messages(), durable);
    }
    (durable, recorder.stop().map(|_| ()))
}

/// Messages of a recording, whole or not.
fn readable(folder: &Path) -> u64 {
    let Ok(bag) = Bag::open(folder) else { return 0 };
    let numbers: Vec<u64> = (bag.messages().filter_map(Result::ok))
        .map(|message| u64::from(message.sequence))
        .collect();
    let first = (numbers.iter().zip(0..)).take_while(|(number, expected)| **number == *expected);
    first.count() as u64
}

#[test]
fn each_refusal_ends_the_recording_and_nothing_that_was_stated_durable_is_missing() {
    let mut points = 0;
    for failure in [
        Failure::Nothing(EIO),
        Failure::Nothing(ENOSPC),
        Failure::Half,
        Failure::Dropped,
    ] {
        let mut fails = 0;
        loop {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("run");
            let disk = Refusing(Arc::new(State {
                fails,
                failure,
                done: AtomicUsize::new(0),
                failed: AtomicBool::new(false),
                after: Mutex::new(Vec::new()),
            }));
            let (durable, ended) = record(&path, &disk);
            if !disk.0.failed.load(Ordering::SeqCst) {
                // The run has fewer operations than that.
                assert!(ended.is_ok() && durable == 48, "{ended:?}");
                break;
            }
            let operation = format!("operation {fails} with {failure:?}");
            assert!(ended.is_err(), "{operation} has no consequence");
            let there = readable(&path);
            assert!(
                there >= durable,
                "{operation}: {durable} stated durable, {there} are there"
            );
            let after = disk.0.after.lock().unwrap().clone();
            // The system may take half of a write without an error: the rest is tried, once.
            let allowed = usize::from(failure == Failure::Half);
            assert!(after.len() <= allowed, "{operation}: then {after:?}");
            points += 1;
            fails += 1;
        }
    }
    println!("{points} refusals");
    assert!(points > 200, "{points}");
}
