//! Some seeds of every change; `cargo run --release -p fault_world -- --seeds A..B` runs as many others as you like.

use std::sync::atomic::{AtomicU64, Ordering};

use fault_world::{Cells, Count, shortened};

/// About half a minute on two cores.
const SEEDS: u64 = 60;

#[test]
fn no_invariant_is_broken_by_the_faults_of_these_seeds() {
    let next = AtomicU64::new(0);
    let seeds = shared_data::share(SEEDS / 5, SEEDS);
    let work = || {
        let cells = Cells::default();
        let mut sum = Count::default();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds {
                return sum;
            }
            let outcome = cells.run(seed);
            if let Some(found) = outcome.violation {
                let faults = shortened(&cells, seed, found.invariant);
                panic!("seed {seed}: {found:?}\n{faults:#?}");
            }
            sum.parts += outcome.count.parts;
            sum.writes += outcome.count.writes;
            sum.touches += outcome.count.touches;
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let counts: Vec<Count> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let joined = threads.into_iter().map(|thread| {
            thread
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        joined.collect()
    });
    let sum = |of: fn(&Count) -> usize| counts.iter().map(of).sum::<usize>();
    let (parts, writes, touches) = (
        sum(|one| one.parts),
        sum(|one| one.writes),
        sum(|one| one.touches),
    );
    println!("{seeds} seeds: {parts} parts, {writes} corrections written, {touches} touches");
    // The faults leave the cell something to do.
    let each = |all: usize, of_60: usize| all * 60 > of_60 * seeds as usize;
    assert!(each(parts, 200) && each(writes, 60) && each(touches, 8000));
}

#[test]
fn a_seed_is_a_run() {
    let cells = Cells::default();
    for seed in [2, 7] {
        assert_eq!(cells.run(seed), cells.run(seed));
    }
}
