//! Each target with some thousand seeded mutations of its seeds: what libFuzzer does for hours, in seconds on stable.

use std::{fs, path::Path};

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
        let _kept = Kept {
            target: name,
            input: seed,
        };
        run(seed);
    }
    for _ in 0..mutations {
        let mut input = seeds.choose(&mut random).expect("seeds").clone();
        for _ in 0..random.random_range(1..=4) {
            mutate(&mut input, &seeds, &mut random);
        }
        let _kept = Kept {
            target: name,
            input: &input,
        };
        run(&input);
    }
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
