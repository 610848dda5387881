//! A sealed recording tells every later change, and how far it was sealed when its recorder was killed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

use bags::{
    Bag, Channel, Overflow, Qos, Recorder, RecorderOptions, Sealed, Sealer, SplitAt, verify_seals,
};
use probecell_msgs::{Message, builtin_interfaces::Time, std_msgs, to_cdr};
use signatures::{Act, Kind, PublicKey, SecretKey};

fn key() -> SecretKey {
    SecretKey::from_seed([1; 32])
}

fn act(cell: PublicKey, seal: &[u8]) -> Act<'static> {
    Act {
        cell,
        kind: Kind::Recording,
        by: "",
        at: Time::default(),
        shown: "",
        subject: seal.to_vec(),
    }
}

fn sealer(key: SecretKey) -> Sealer {
    Sealer::new(move |seal| key.sign(&act(key.public(), seal)))
}

fn verified(folder: &Path) -> Sealed {
    // Thousands of changed recordings hold the same seals: each signature is verified once.
    type Known = BTreeMap<(Vec<u8>, Vec<u8>), bool>;
    static KNOWN: Mutex<Known> = Mutex::new(BTreeMap::new());
    let key = key().public();
    let signed = |seal: &[u8], signature: &[u8]| {
        let mut known = KNOWN.lock().expect("no panic");
        let asked = (seal.to_vec(), signature.to_vec());
        *known
            .entry(asked)
            .or_insert_with(|| key.verifies(&act(key, seal), signature))
    };
    verify_seals(folder, &signed)
        .expect("readable")
        .expect("seals")
}

fn options(folder: &Path) -> RecorderOptions {
    RecorderOptions {
        overflow: Overflow::Block,
        sealer: Some(sealer(key())),
        ..RecorderOptions::new(folder)
    }
}

/// Records texts, one a millisecond.
fn record(options: RecorderOptions, texts: &[&str]) -> PathBuf {
    let folder = options.folder.clone();
    let recorder = Recorder::start(options).expect("a recording");
    let topic = Channel::of("/cell/words", std_msgs::String::TYPE, Qos::default());
    let channel = recorder.channel(&topic).expect("a channel");
    recorder
        .attach("cell.toml", "application/toml", 1, b"[cell]".to_vec())
        .expect("attached");
    for (number, text) in texts.iter().enumerate() {
        let time = 1_000_000 * (1 + number as u64);
        let data = (*text).to_owned();
        let payload = to_cdr(&std_msgs::String { data });
        recorder
            .push(channel, number as u64, time, time, payload)
            .expect("taken");
    }
    recorder.stop().expect("a whole recording");
    folder
}

const TEXTS: [&str; 4] = ["rough", "measure", "finish", "measure"];

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("a file").path()).collect();
    files.sort();
    files
}

#[test]
fn every_byte_that_is_changed_in_any_file_is_found() {
    let scratch = tempfile::tempdir().expect("a folder");
    let folder = record(options(&scratch.path().join("run")), &TEXTS);
    let whole = verified(&folder);
    assert!(
        whole.ended && whole.changes.is_empty() && whole.unsealed.is_empty(),
        "{whole:?}"
    );
    let mut tried = 0;
    for file in files(&folder) {
        let original = fs::read(&file).expect("a file");
        for at in 0..original.len() {
            let mut changed = original.clone();
            changed[at] ^= 0x20;
            fs::write(&file, &changed).expect("written");
            let told = verified(&folder);
            let name = file.display();
            assert!(
                !told.changes.is_empty() || !told.ended,
                "{name} byte {at}: {told:?}"
            );
            // Only the last line feed of the seals could have been lost by a recorder that was killed.
            let cut = name.to_string().ends_with("seals.txt") && at + 1 == original.len();
            assert!(
                cut || !told.changes.is_empty(),
                "{name} byte {at}: {told:?}"
            );
            tried += 1;
        }
        fs::write(&file, &original).expect("written");
    }
    assert!(tried > 2000, "{tried}");
    assert_eq!(verified(&folder), whole);
}

/// Whoever has the software but not the key writes the file anew.
#[test]
fn a_message_that_is_dropped_added_moved_or_changed_is_found() {
    let scratch = tempfile::tempdir().expect("a folder");
    let folder = record(options(&scratch.path().join("run")), &TEXTS);
    let bag = folder.join("run_0.mcap");
    let [a, b, c, d] = TEXTS;
    for (index, texts) in [
        vec![a, b, c],
        vec![a, b, c, d, d],
        vec![b, a, c, d],
        vec![a, b, c, "x"],
    ]
    .into_iter()
    .enumerate()
    {
        let forged = scratch.path().join(format!("forged_{index}")).join("run");
        let forged = record(
            RecorderOptions {
                sealer: None,
                ..options(&forged)
            },
            &texts,
        );
        fs::copy(forged.join("run_0.mcap"), &bag).expect("copied");
        assert_eq!(
            Bag::open(&folder).expect("a bag").verify(),
            [],
            "sound in itself"
        );
        assert_ne!(verified(&folder).changes, [""; 0], "{texts:?}");
        // Sealed again with another key, nothing of it counts.
        let other = scratch.path().join(format!("other_{index}")).join("run");
        let again = RecorderOptions {
            sealer: Some(sealer(SecretKey::from_seed([2; 32]))),
            ..options(&other)
        };
        let told = verified(&record(again, &texts));
        assert_eq!((told.seals, told.ended), (0, false));
        assert_ne!(told.changes, [""; 0]);
    }
}

#[test]
fn a_file_that_is_gone_added_or_cut_off_is_found_at_every_length() {
    let scratch = tempfile::tempdir().expect("a folder");
    let split = SplitAt {
        bytes: None,
        duration: Some(Duration::from_millis(2)),
    };
    let folder = record(
        RecorderOptions {
            split,
            ..options(&scratch.path().join("run"))
        },
        &TEXTS,
    );
    let whole = verified(&folder);
    assert!(whole.ended && whole.changes.is_empty(), "{whole:?}");
    assert!(files(&folder).len() >= 4, "{:?}", files(&folder));
    for file in files(&folder) {
        let original = fs::read(&file).expect("a file");
        for length in 0..original.len() {
            fs::write(&file, &original[..length]).expect("written");
            let told = verified(&folder);
            assert!(
                !told.changes.is_empty() || !told.ended,
                "{} {length}",
                file.display()
            );
        }
        fs::write(&file, [&original[..], b"\n"].concat()).expect("written");
        assert!(
            !verified(&folder).changes.is_empty(),
            "{} longer",
            file.display()
        );
        fs::write(&file, &original).expect("written");
    }
    let first = folder.join("run_0.mcap");
    let original = fs::read(&first).expect("a file");
    fs::remove_file(&first).expect("removed");
    assert_eq!(verified(&folder).changes, ["run_0.mcap is gone"]);
    fs::write(&first, &original).expect("written");
    fs::write(folder.join("run_9.mcap"), &original).expect("written");
    assert!(verified(&folder).changes[0].starts_with("run_9.mcap: "));
    fs::remove_file(folder.join("run_9.mcap")).expect("removed");
    // Lines of the seals in another order, or one of them missing.
    let seals = folder.join("seals.txt");
    let text = fs::read_to_string(&seals).expect("seals");
    let lines: Vec<&str> = text.lines().collect();
    for at in 0..lines.len() - 1 {
        let mut swapped = lines.clone();
        swapped.swap(at, at + 1);
        let mut fewer = lines.clone();
        fewer.remove(at);
        for changed in [swapped, fewer] {
            fs::write(&seals, changed.join("\n") + "\n").expect("written");
            assert_ne!(verified(&folder).changes, [""; 0], "line {at}");
        }
    }
}

/// The state that a killed recorder leaves: some seals, and more bytes than they cover.
#[test]
fn what_a_killed_recorder_had_sealed_is_told_from_what_it_had_not() {
    let scratch = tempfile::tempdir().expect("a folder");
    let folder = scratch.path().join("run");
    let often = RecorderOptions {
        sync_interval: Duration::from_millis(2),
        ..options(&folder)
    };
    let recorder = Recorder::start(often).expect("a recording");
    let topic = Channel::of("/cell/words", std_msgs::String::TYPE, Qos::default());
    let channel = recorder.channel(&topic).expect("a channel");
    let say = |number: u64, data: &str| {
        let payload = to_cdr(&std_msgs::String {
            data: data.to_owned(),
        });
        recorder
            .push(channel, number, number, number, payload)
            .expect("taken");
    };
    say(1, "sealed");
    while recorder.durable_messages() < 1 {
        std::thread::yield_now();
    }
    let seals = fs::read(folder.join("seals.txt")).expect("seals");
    say(2, "not sealed yet");
    recorder.stop().expect("a whole recording");
    fs::write(folder.join("seals.txt"), &seals).expect("written");
    let told = verified(&folder);
    assert!(!told.ended && told.changes.is_empty(), "{told:?}");
    assert!(
        told.seals >= 1 && told.unsealed["run_0.mcap"] > 0,
        "{told:?}"
    );
    // What was sealed cannot be changed even so.
    let bag = folder.join("run_0.mcap");
    let mut content = fs::read(&bag).expect("a bag");
    content[9] ^= 1;
    fs::write(&bag, content).expect("written");
    assert!(
        verified(&folder).changes[0].starts_with("run_0.mcap was changed between byte 0 and byte ")
    );
}

#[test]
fn a_recording_without_seals_is_said_to_have_none() {
    let scratch = tempfile::tempdir().expect("a folder");
    let plain = RecorderOptions {
        sealer: None,
        ..options(&scratch.path().join("run"))
    };
    let folder = record(plain, &TEXTS);
    assert_eq!(verify_seals(&folder, &|_, _| true).expect("readable"), None);
    let file = folder.join("run_0.mcap");
    assert_eq!(verify_seals(&file, &|_, _| true).expect("readable"), None);
}
