//! Cut-off and damaged files: every whole chunk is given, nothing panics, nothing hangs.

use std::path::{Path, PathBuf};

use bags::{Bag, Channel, DamageKind, Overflow, Qos, Recorder, RecorderOptions, recover};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// A recording of `count` messages, about 20 to a chunk; its bytes and numbers.
fn sample_of(count: u32, folder: &Path) -> (Vec<u8>, Vec<u32>) {
    let options = RecorderOptions {
        chunk_bytes: 2000,
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder.join("run"))
    };
    let recorder = Recorder::start(options).unwrap();
    let mut random = Pcg64::seed_from_u64(5);
    recorder
        .attach("cell.toml", "application/toml", 0, vec![b'x'; 300])
        .unwrap();
    for number in 0..count {
        let topic = format!("/cell/t{}", number % 3);
        let channel = Channel::new(
            topic,
            "std_msgs/msg/String",
            "string data\n",
            "",
            Qos::default(),
        );
        let channel = recorder.channel(&channel).unwrap();
        let payload: Vec<u8> = (0..80).map(|_| random.random_range(0..16u8)).collect();
        recorder
            .push(
                channel,
                u64::from(number),
                u64::from(number) * 10,
                0,
                payload,
            )
            .unwrap();
    }
    let statistics = recorder.stop().unwrap();
    (
        std::fs::read(&statistics.files[0]).unwrap(),
        (0..count).collect(),
    )
}

fn sample(folder: &Path) -> (Vec<u8>, Vec<u32>) {
    sample_of(600, folder)
}

/// Chunk records of a file by an independent walk: end offset and messages so far.
fn chunk_ends(bytes: &[u8]) -> Vec<(usize, usize)> {
    let mut at = 8;
    let mut ends = Vec::new();
    let mut messages = 0;
    while at + 9 <= bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        let end = at + 9 + length;
        if bytes[at] == mcap::records::op::CHUNK {
            let Ok(mcap::records::Record::Chunk { header, data }) =
                mcap::parse_record(bytes[at], &bytes[at + 9..end])
            else {
                panic!("the sample holds an unreadable chunk")
            };
            let records = mcap::read::ChunkReader::new(header, &data).unwrap();
            messages += records
                .filter(|record| matches!(record, Ok(mcap::records::Record::Message { .. })))
                .count();
            ends.push((end, messages));
        }
        if bytes[at] == mcap::records::op::DATA_END {
            break;
        }
        at = end;
    }
    ends
}

fn read_numbers(path: &Path) -> Vec<u32> {
    Bag::open(path)
        .unwrap()
        .messages()
        .filter_map(Result::ok)
        .map(|message| message.sequence)
        .collect()
}

#[test]
fn a_bag_cut_off_at_any_byte_gives_all_its_complete_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, numbers) = sample_of(100, folder.path());
    let ends = chunk_ends(&bytes);
    assert!(ends.len() > 4 && ends.last().unwrap().1 == numbers.len());
    let path = folder.path().join("cut.mcap");
    for cut in 0..bytes.len() {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        let bag = Bag::open(&path).unwrap();
        let complete = ends
            .iter()
            .take_while(|(end, _)| *end <= cut)
            .last()
            .map_or(0, |(_, messages)| *messages);
        let read: Vec<u32> = bag
            .messages()
            .map(|message| message.unwrap().sequence)
            .collect();
        assert_eq!(read, numbers[..complete], "cut at byte {cut}");
        if complete < numbers.len() {
            assert!(
                bag.damage()
                    .iter()
                    .any(|damage| damage.kind == DamageKind::Truncated),
                "cut at byte {cut}"
            );
        }
    }
}

#[test]
fn a_flipped_bit_costs_at_most_the_chunk_it_hits() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, numbers) = sample(folder.path());
    let ends = chunk_ends(&bytes);
    let largest = ends
        .iter()
        .scan(0, |before, (_, messages)| {
            Some(messages - std::mem::replace(before, *messages))
        })
        .max()
        .unwrap();
    let path = folder.path().join("flipped.mcap");
    let mut random = Pcg64::seed_from_u64(6);
    for flip in 0..4000 {
        let mut flipped = bytes.clone();
        let (byte, bit) = (
            random.random_range(8..bytes.len()),
            random.random_range(0..8),
        );
        flipped[byte] ^= 1 << bit;
        std::fs::write(&path, &flipped).unwrap();
        let read = read_numbers(&path);
        assert!(
            read.len() + largest >= numbers.len(),
            "flip {flip}: bit {bit} of byte {byte} cost {} messages",
            numbers.len() - read.len()
        );
        if read.len() < numbers.len() {
            assert!(
                !Bag::open(&path).unwrap().verify().is_empty(),
                "flip {flip}: loss without damage"
            );
        }
    }
}

#[test]
fn files_cut_and_flipped_in_many_places_are_read_without_panic_or_invented_messages() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, _) = sample(folder.path());
    let path = folder.path().join("broken.mcap");
    let mut random = Pcg64::seed_from_u64(7);
    for round in 0..3000 {
        let mut broken = bytes.clone();
        broken.truncate(random.random_range(8..=bytes.len()));
        for _ in 0..random.random_range(1..20) {
            let byte = random.random_range(0..broken.len());
            // Runs of 0xff make the largest lengths a field can hold.
            let end = (byte + random.random_range(1..10)).min(broken.len());
            broken[byte..end].fill(if random.random() {
                0xff
            } else {
                random.random()
            });
        }
        std::fs::write(&path, &broken).unwrap();
        let Ok(bag) = Bag::open(&path) else { continue };
        for message in bag.messages().filter_map(Result::ok) {
            assert!(
                message.sequence < 600 && message.payload.len() == 80,
                "round {round}"
            );
        }
        drop(bag.verify());
        let _info = bag.info(true);
    }
}

#[test]
fn other_files_are_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("text.mcap");
    std::fs::write(&path, b"no bag at all").unwrap();
    let error = Bag::open(&path).unwrap_err().to_string();
    assert!(
        error.starts_with("not an MCAP file") && error.contains("text.mcap"),
        "{error}"
    );
    assert!(
        Bag::open(folder.path().join("absent.mcap"))
            .unwrap_err()
            .to_string()
            .contains("absent.mcap")
    );
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    assert!(
        Bag::open(folder.path().join("empty"))
            .unwrap_err()
            .to_string()
            .starts_with("no .mcap file")
    );
}

#[test]
fn recovery_saves_everything_readable_and_says_what_was_lost() {
    let folder = tempfile::tempdir().unwrap();
    let (mut bytes, _) = sample(folder.path());
    let ends = chunk_ends(&bytes);
    bytes[ends[10].0 - 20] ^= 4;
    bytes.truncate(ends[20].0 + 100);
    let broken: PathBuf = folder.path().join("broken.mcap");
    std::fs::write(&broken, &bytes).unwrap();
    let before = read_numbers(&broken);
    let whole = folder.path().join("whole");
    let recovery = recover(&broken, &whole, None).unwrap();
    assert!(recovery.lost_messages());
    assert_eq!(recovery.damage.len(), 2, "{:?}", recovery.damage);
    assert_eq!(recovery.messages, before.len() as u64);
    assert_eq!(before.len(), ends[20].1 - (ends[10].1 - ends[9].1));
    let bag = Bag::open(&whole).unwrap();
    assert_eq!(bag.verify(), []);
    assert_eq!(read_numbers(&whole), before);
    assert_eq!(bag.attachments().next().unwrap().unwrap().data.len(), 300);
    assert_eq!(bag.channels(), Bag::open(&broken).unwrap().channels());
    assert!(
        recover(&broken, &whole, None).is_err(),
        "a recovery is never written over another"
    );
}
