//! How fast a recorded part is computed again, planning and diagnosis included: messages/s, and multiples of the time
//! that the part took.

use std::time::Instant;

use cell::Cell;
use cell_tests::{factories, launch_scripts, make_part, recording};
use graph::{
    Published,
    replay::{Verdict, replay},
};

const ROUNDS: usize = 5;

pub(crate) fn run() {
    for file in ["turn_mill.toml", "five_axis.toml"] {
        let path = launch_scripts().join(file);
        let cell = Cell::read(&path).unwrap_or_else(|error| panic!("{error}"));
        let (_, log) = make_part(&cell, "part");
        let took = log
            .last()
            .map_or(0.0, |last| (last.at.0 - log[0].at.0) as f64 * 1e-9);
        let mut times = Vec::new();
        for _ in 0..ROUNDS {
            let start = Instant::now();
            let recording = recording(&log);
            let report = replay(&recording, &factories(&cell, &cell.node_names()))
                .unwrap_or_else(|error| panic!("{error}"));
            times.push(start.elapsed().as_secs_f64());
            assert_eq!(report.verdict, Verdict::Equal, "{file}");
        }
        times.sort_by(f64::total_cmp);
        let seconds = times[ROUNDS / 2];
        println!(
            "{file}: {} messages of {took:.1} s computed again in {seconds:.2} s: {:.0} messages/s, {:.0} x real time",
            log.len(),
            log.len() as f64 / seconds,
            took / seconds,
        );
        println!("{file}: {:.1} MB of payload", bytes(&log) as f64 * 1e-6);
    }
}

fn bytes(log: &[Published]) -> usize {
    log.iter().map(|published| published.payload.len()).sum()
}
