//! `cargo run --release -p fault_world -- --seeds A..B`: runs as many seeds as you like on all cores, and prints of each
//! failure its seed, the shortened list of faults and the invariant. `-- --gate STATES`: searches the orders of events about
//! two corrections, up to that many states in each search.

#![allow(clippy::print_stdout, reason = "a command prints")]

use std::{
    process::ExitCode,
    sync::atomic::{AtomicU64, Ordering},
};

use clap::Parser;
use fault_world::{Cells, Count, DEEP, SEARCHES, Search, shortened};

/// Runs the default cell under the faults of each seed.
#[derive(Parser)]
struct Arguments {
    /// Seeds, the last one excluded.
    #[arg(long, value_name = "A..B", value_parser = seeds, required_unless_present = "gate")]
    seeds: Option<(u64, u64)>,
    /// Search the orders of events about two corrections, up to so many states in each search: 48 bytes each, and 1 kB of
    /// those that are still to be left.
    #[arg(long, value_name = "STATES", conflicts_with = "seeds")]
    gate: Option<usize>,
    /// Print the faults of each seed and what came of it.
    #[arg(long)]
    verbose: bool,
    /// Do not shorten the lists of failures.
    #[arg(long)]
    whole: bool,
}

fn seeds(text: &str) -> Result<(u64, u64), String> {
    let (from, to) = text.split_once("..").ok_or("it has the form A..B")?;
    let number = |text: &str| text.parse::<u64>().map_err(|error| error.to_string());
    Ok((number(from)?, number(to)?))
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Some(limit) = arguments.gate {
        return search(limit);
    }
    let (from, to) = arguments.seeds.unwrap_or_default();
    let next = AtomicU64::new(from);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let work = || {
        let cells = Cells::default();
        let (mut count, mut failures) = (Count::default(), 0_u64);
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= to {
                return (count, failures);
            }
            let outcome = cells.run(seed);
            count.parts += outcome.count.parts;
            count.writes += outcome.count.writes;
            count.touches += outcome.count.touches;
            if arguments.verbose {
                println!(
                    "seed {seed}: {:?}, replay {:?}",
                    outcome.count, outcome.replay
                );
            }
            if let Some(found) = outcome.violation {
                failures += 1;
                let faults = if arguments.whole {
                    cells.faults(seed)
                } else {
                    shortened(&cells, seed, found.invariant)
                };
                let list: Vec<String> = faults.iter().map(ToString::to_string).collect();
                println!(
                    "seed {seed}: {:?} does not hold at {:.2} s: {}\n{}",
                    found.invariant,
                    found.at,
                    found.text,
                    list.join("\n")
                );
            }
        }
    };
    let (count, failures) = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let mut sum = (Count::default(), 0);
        for thread in threads {
            let (count, failures) = thread.join().unwrap_or_default();
            sum.0.parts += count.parts;
            sum.0.writes += count.writes;
            sum.0.touches += count.touches;
            sum.1 += failures;
        }
        sum
    });
    println!(
        "{} seeds: {} parts, {} corrections written, {} touches; {failures} failures",
        to.saturating_sub(from),
        count.parts,
        count.writes,
        count.touches
    );
    if failures == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn search(limit: usize) -> ExitCode {
    let cells = Cells::default();
    let mut search = Search::new(cells.of(1), None);
    let mut states = 0;
    for bounds in SEARCHES.iter().chain(DEEP) {
        let found = search.run(*bounds, limit);
        states += found.states;
        println!("{found}, of {bounds:?}");
        if let Some((events, why)) = found.violation {
            println!("{why}:\n{}", events.join("\n"));
            return ExitCode::FAILURE;
        }
    }
    println!("{states} states");
    ExitCode::SUCCESS
}
