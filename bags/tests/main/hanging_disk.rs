//! A disk that does not answer, as a network drive whose server is gone: the recorder tells for how long, and when the disk
//! answers again all that was pushed meanwhile is recorded.

use std::io;
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use bags::{Bag, Disk, DiskFile, Recorder, RecorderOptions, SystemDisk};

use crate::topic;

/// Messages that are pushed while the disk does not answer.
const PUSHED: u64 = 1000;
/// A hundred times the flush interval.
const LONG: Duration = Duration::from_millis(200);

/// Syncs wait while it is shut.
#[derive(Clone, Debug, Default)]
struct Gate(Arc<(Mutex<bool>, Condvar)>);

impl Gate {
    fn shut(&self, shut: bool) {
        *self.0.0.lock().unwrap() = shut;
        self.0.1.notify_all();
    }

    fn pass(&self) {
        let shut = self.0.0.lock().unwrap();
        drop(self.0.1.wait_while(shut, |shut| *shut).unwrap());
    }
}

struct Hanging(Arc<dyn DiskFile>, Gate);

impl DiskFile for Hanging {
    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn sync(&self) -> io::Result<()> {
        self.1.pass();
        self.0.sync()
    }
}

impl Disk for Gate {
    fn create(&self, path: &Path, anew: bool) -> io::Result<Arc<dyn DiskFile>> {
        let file = SystemDisk.create(path, anew)?;
        Ok(Arc::new(Hanging(file, self.clone())))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        SystemDisk.rename(from, to)
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        SystemDisk.sync_folder(folder)
    }
}

#[test]
fn a_disk_that_does_not_answer_is_told_and_costs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (path, gate) = (folder.path().join("run"), Gate::default());
    let recorder = Recorder::start(RecorderOptions {
        sync_interval: Duration::from_millis(2),
        disk: Arc::new(gate.clone()),
        ..RecorderOptions::new(&path)
    })
    .unwrap();
    let channel = recorder.channel(&topic()).unwrap();
    gate.shut(true);
    for number in 0..PUSHED {
        recorder
            .push(channel, number, number, 0, vec![0; 8])
            .unwrap();
    }
    while recorder.silent_for() < LONG {
        std::thread::yield_now();
    }
    gate.shut(false);
    while recorder.durable_messages() < PUSHED {
        std::thread::yield_now();
    }
    while recorder.silent_for() >= LONG {
        std::thread::yield_now();
    }
    let statistics = recorder.stop().unwrap();
    assert_eq!((statistics.messages, statistics.missing()), (PUSHED, 0));
    assert_eq!(Bag::open(&path).unwrap().messages().count() as u64, PUSHED);
}
