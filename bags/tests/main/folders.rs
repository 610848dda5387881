//! Folders that are no recording of MCAP splits: the message says what they are and what makes them readable.

use std::path::Path;

use bags::{Bag, Channel, Qos, Recorder, RecorderOptions};

fn record(folder: &Path, start: u64) {
    let recorder = Recorder::start(RecorderOptions::new(folder)).unwrap();
    let channel = Channel::new("/a", "std_msgs/msg/Bool", "bool data\n", "", Qos::default());
    let channel = recorder.channel(&channel).unwrap();
    for number in 0..10u64 {
        let time = (start + number) * 1_000_000_000;
        recorder
            .push(channel, number, time, time, vec![0, 1, 0, 0, 1])
            .unwrap();
    }
    recorder.stop().unwrap();
}

/// Files of recordings that begin at these seconds, under these names, without `metadata.yaml`.
fn folder(files: &[(&str, u64)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, start) in files {
        let run = folder.path().join("run");
        record(&run, *start);
        std::fs::rename(run.join("run_0.mcap"), folder.path().join(name)).unwrap();
        std::fs::remove_dir_all(run).unwrap();
    }
    folder
}

fn refusal(folder: &Path) -> String {
    Bag::open(folder).unwrap_err().to_string()
}

#[test]
fn parts_of_one_recording_are_read_as_one() {
    let parts = folder(&[
        ("run_0.mcap", 100),
        ("run_1.mcap", 111),
        ("run_2.mcap", 122),
    ]);
    assert_eq!(Bag::open(parts.path()).unwrap().messages().count(), 30);
}

#[test]
fn several_recordings_are_not_read_as_one() {
    let named = folder(&[("left.mcap", 100), ("right.mcap", 100)]);
    let said = refusal(named.path());
    assert!(said.contains("holds 2 recordings"), "{said}");
    assert!(
        said.contains("left.mcap with 10 messages, right.mcap with 10 messages"),
        "{said}"
    );
    // The day stands where the number of a part would.
    let days = folder(&[("2026-03-02.mcap", 1000), ("2026-03-03.mcap", 61_000)]);
    assert!(refusal(days.path()).contains("holds 2 recordings"));
}

#[test]
fn a_folder_of_recordings_names_them() {
    let all = tempfile::tempdir().unwrap();
    for name in ["monday", "tuesday"] {
        record(&all.path().join(name), 100);
    }
    let said = refusal(all.path());
    assert!(
        said.contains("holds 2 recordings, name one of them (monday, tuesday)"),
        "{said}"
    );
}

#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_not_opened() {
    let parts = folder(&[("run_0.mcap", 100)]);
    let pipe = parts.path().join("run_1.mcap");
    assert!(
        std::process::Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .unwrap()
            .success()
    );
    assert_eq!(Bag::open(parts.path()).unwrap().messages().count(), 10);
    assert!(refusal(&pipe).contains("neither a file nor a folder"));
}

#[test]
fn files_in_other_forms_are_named_with_the_command_that_converts() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("run_0.db3");
    std::fs::write(&database, b"SQLite format 3\0and so on").unwrap();
    for path in [folder.path(), &database] {
        let said = refusal(path);
        assert!(said.contains("sqlite3"), "{said}");
        assert!(
            said.contains("mcap convert") && said.contains("run_0.mcap`"),
            "{said}"
        );
    }
    std::fs::remove_file(database).unwrap();
    let text = "rosbag2_bagfile_information:\n  compression_mode: FILE\n  compression_format: zstd\n  \
                relative_file_paths:\n    - run_0.mcap.zstd\n";
    std::fs::write(folder.path().join("metadata.yaml"), text).unwrap();
    let packed = folder.path().join("run_0.mcap.zstd");
    std::fs::write(&packed, [0x28, 0xb5, 0x2f, 0xfd, 0, 0]).unwrap();
    let said = refusal(folder.path());
    assert!(
        said.contains("zstd -d") && said.contains("run_0.mcap`"),
        "{said}"
    );
    // Unpacked, the folder is read though it still names the packed file.
    std::fs::remove_file(packed).unwrap();
    record(&folder.path().join("run"), 100);
    std::fs::rename(
        folder.path().join("run/run_0.mcap"),
        folder.path().join("run_0.mcap"),
    )
    .unwrap();
    let bag = Bag::open(folder.path()).unwrap();
    assert_eq!((bag.messages().count(), bag.damage()), (10, Vec::new()));
}

#[test]
fn messages_compressed_one_by_one_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    record(&run, 100);
    let text = std::fs::read_to_string(run.join("metadata.yaml")).unwrap();
    let text = text
        .replace("compression_mode: \"\"", "compression_mode: \"MESSAGE\"")
        .replace("compression_format: \"\"", "compression_format: \"zstd\"");
    std::fs::write(run.join("metadata.yaml"), text).unwrap();
    let said = refusal(&run);
    assert!(
        said.contains("each message is compressed by zstd"),
        "{said}"
    );
    assert!(said.contains("ros2 bag convert"), "{said}");
}
