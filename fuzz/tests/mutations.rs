//! Each target with some thousand seeded mutations of its seeds: what libFuzzer does for hours, in seconds on stable. No input takes
//! more than 10 s, or more memory than four times its size and 200 MB. `PROBECELL_TESTS=whole` runs at least 10,000 of each.

use std::{
    fs,
    path::Path,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use probecell_fuzz::{TARGETS, Target};
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_pcg::Pcg64;

/// Words that readers of numbers and of lengths stumble over.
const WORDS: [&[u8]; 14] = [
    b"nan",
    b"inf",
    b"-1",
    b"0",
    b"1e308",
    b"-1e-308",
    b"4294967296",
    b"\"",
    b"[",
    b"\n",
    b"\xff\xff\xff\xff",
    b"\0\0\0\0",
    b"\xff\xff\xff\xff\xff\xff\xff\x7f",
    b"\xc3",
];

/// Longest time and most memory, bytes, beside four times its size, that an input takes.
const LONGEST: Duration = Duration::from_secs(10);
const MOST: usize = 200_000_000;

/// Inputs with a piece very often, and bytes of the longest.
const GROWN: usize = 16;
const SIZE: usize = 4 << 20;

/// Keeps the input where the next run of a debugger finds it, if the target panics.
struct Kept<'a> {
    target: &'a str,
    input: &'a [u8],
}

impl Drop for Kept<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let file =
                Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("failing_{}", self.target));
            match fs::write(&file, self.input) {
                Ok(()) => eprintln!("the input is kept in {}", file.display()),
                Err(error) => eprintln!("the input cannot be kept: {error}"),
            }
        }
    }
}

fn check(name: &str, mutations: u32) {
    let Target { run, seeds, .. } = *TARGETS
        .iter()
        .find(|target| target.name == name)
        .expect("a target");
    let seeds = seeds();
    let mut random = Pcg64::seed_from_u64(7);
    for seed in &seeds {
        bounded(name, run, seed);
    }
    let whole = std::env::var_os("PROBECELL_TESTS").is_some_and(|value| value == "whole");
    let least = if whole { 10_000 } else { 0 };
    for _ in 0..mutations.max(least) {
        let mut input = seeds.choose(&mut random).expect("seeds").clone();
        for _ in 0..random.random_range(1..=4) {
            mutate(&mut input, &seeds, &mut random);
        }
        bounded(name, run, &input);
    }
    // Messages and replies are no files: who sends them bounds them.
    if !["cdr", "remote_shell"].contains(&name) {
        for seed in seeds.iter().cycle().take(GROWN.max(seeds.len())) {
            bounded(name, run, &grown(seed, &mut random));
        }
    }
}

/// The input with one of its pieces so often that it is some megabytes long.
fn grown(seed: &[u8], random: &mut Pcg64) -> Vec<u8> {
    let at = random.random_range(0..seed.len());
    let end = (at + random.random_range(1..=400)).min(seed.len());
    let often = random.random_range(SIZE / 8..SIZE) / (end - at);
    [&seed[..at], &seed[at..end].repeat(often), &seed[end..]].concat()
}

/// Runs one input, while no other runs in this process: its memory is the largest that the process then holds.
fn bounded(target: &str, run: fn(&[u8]), input: &[u8]) {
    static ALONE: Mutex<()> = Mutex::new(());
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let _kept = Kept { target, input };
    fs::write("/proc/self/clear_refs", "5").expect("the largest memory is that of now");
    let begin = Instant::now();
    run(input);
    let took = begin.elapsed();
    assert!(took < LONGEST, "{} bytes took {took:?}", input.len());
    let bound = 4 * input.len() + MOST;
    let peak = peak();
    assert!(
        peak < bound,
        "{} bytes took {peak} bytes of memory",
        input.len()
    );
}

/// Largest resident memory of this process, bytes.
fn peak() -> usize {
    let status = fs::read_to_string("/proc/self/status").expect("the state of this process");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let number = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<usize>().ok());
    1024 * number.expect("its largest resident memory")
}

fn mutate(input: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut Pcg64) {
    let length = input.len();
    let at = random.random_range(0..=length);
    let end = (at + random.random_range(0..=16)).min(length);
    match random.random_range(0..7) {
        0 if at < length => input[at] ^= 1 << random.random_range(0..8),
        1 if at < length => input[at] = random.random(),
        2 => input.truncate(at),
        3 => drop(input.drain(at..end)),
        4 => drop(input.splice(
            at..end,
            WORDS.choose(random).expect("words").iter().copied(),
        )),
        5 => {
            // Twice the same, or a piece of another seed.
            let other = seeds.choose(random).expect("seeds");
            let from = random.random_range(0..=other.len());
            let to = (from + random.random_range(0..=256)).min(other.len());
            drop(input.splice(at..at, other[from..to].iter().copied()));
        }
        _ => number(input, random),
    }
}

/// Puts a word in place of a number in a text.
fn number(input: &mut Vec<u8>, random: &mut Pcg64) {
    let starts: Vec<usize> = (0..input.len())
        .filter(|&at| {
            input[at].is_ascii_digit() && (at == 0 || !input[at - 1].is_ascii_alphanumeric())
        })
        .collect();
    let Some(&at) = starts.choose(random) else {
        return;
    };
    let digits = input[at..]
        .iter()
        .take_while(|byte| byte.is_ascii_digit() || **byte == b'.')
        .count();
    drop(input.splice(
        at..at + digits,
        WORDS.choose(random).expect("words").iter().copied(),
    ));
}

#[test]
fn no_bytes_make_the_readers_of_messages_disagree() {
    check("cdr", 200_000);
}

#[test]
fn no_file_makes_a_bag_panic_or_recover_to_a_damaged_one() {
    check("mcap", 1_500);
}

#[test]
fn no_robot_description_that_is_accepted_is_no_machine() {
    check("urdf", 10_000);
}

#[test]
fn no_cell_file_that_is_accepted_has_a_plan_that_is_not_finite() {
    check("cell_file", 3_000);
}

#[test]
fn no_reply_of_a_controller_passes_a_number_that_is_not_finite() {
    check("remote_shell", 50_000);
}

#[test]
fn no_metadata_makes_a_folder_disagree_with_its_recording() {
    check("folder", 1_500);
}

#[test]
fn no_table_that_is_imported_has_a_touch_that_is_not_finite() {
    check("table", 100_000);
}

#[test]
fn no_report_that_is_read_cannot_be_told() {
    check("report", 3_000);
}

#[test]
fn no_document_of_another_system_gives_a_plan_that_is_not_a_number() {
    check("documents", 100_000);
}
