//! The files of a recording that another program moves or removes while they are written.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bags::{Bag, Error};

use crate::crash::begun;

/// A recording with some messages on disk, and what the recorder says once `change` was done to its file.
fn changed(folder: &Path, change: impl FnOnce(&Path)) -> (u64, Error) {
    let (recorder, channel) = begun(folder, Duration::from_millis(20));
    let count = 300_u64;
    for number in 0..count {
        let payload = number.to_le_bytes().repeat(6);
        recorder
            .push(channel, number, number, number, payload)
            .unwrap();
    }
    while recorder.durable_messages() < count {
        assert!(recorder.failure().is_none());
        std::thread::yield_now();
    }
    change(&folder.join("run_0.mcap"));
    // Nothing more is written: it notices all the same.
    let failure = loop {
        if let Some(failure) = recorder.failure() {
            break failure;
        }
        std::thread::yield_now();
    };
    let refused = recorder.push(channel, count, count, count, vec![0; 8]);
    assert_eq!(refused.unwrap_err().to_string(), failure.to_string());
    (count, failure)
}

fn messages(bag: &Path) -> u64 {
    let bag = Bag::open(bag).unwrap();
    bag.messages().map(Result::unwrap).count() as u64
}

fn place() -> (tempfile::TempDir, PathBuf) {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("run");
    (place, folder)
}

#[test]
fn what_was_recorded_is_kept_where_its_folder_is_removed() {
    let (place, folder) = place();
    let (count, failure) = changed(&folder, |_| fs::remove_dir_all(&folder).unwrap());
    assert!(matches!(failure, Error::Removed { .. }), "{failure}");
    let kept = place.path().join("run_kept/run_0.mcap");
    assert!(
        failure.to_string().contains(&kept.display().to_string()),
        "{failure}"
    );
    assert_eq!(messages(&kept), count);
}

#[test]
fn what_was_recorded_is_kept_where_another_file_takes_its_place() {
    let (place, folder) = place();
    let (count, failure) = changed(&folder, |file| {
        let other = place.path().join("other");
        fs::write(&other, "no recording").unwrap();
        fs::rename(other, file).unwrap();
    });
    assert!(matches!(failure, Error::Removed { .. }), "{failure}");
    assert_eq!(messages(&place.path().join("run_kept/run_0.mcap")), count);
    assert_eq!(
        fs::read(folder.join("run_0.mcap")).unwrap(),
        b"no recording"
    );
}

#[test]
fn a_recording_that_is_moved_ends_and_is_whole_where_it_is() {
    let (place, folder) = place();
    let away = place.path().join("away");
    let (count, failure) = changed(&folder, |_| fs::rename(&folder, &away).unwrap());
    assert!(matches!(failure, Error::Moved { .. }), "{failure}");
    assert!(!place.path().join("run_kept").exists());
    assert_eq!(messages(&away.join("run_0.mcap")), count);
}
