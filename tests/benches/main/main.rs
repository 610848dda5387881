//! Benchmarks of whole cells on virtual time: `cargo bench -p cell_tests --bench main -- replay` runs that one, without a name all
//! are run.
//!
//! - `parts`: a series of parts in a row: what they are reported as, their sizes, what the cell keeps in memory
//! - `replay`: how fast a recorded part is computed again

#![allow(
    clippy::print_stdout,
    reason = "a benchmark's result is what it prints"
)]

use std::process::ExitCode;

mod parts;
mod replay;

const BENCHES: [(&str, fn()); 2] = [("parts", parts::run), ("replay", replay::run)];

fn main() -> ExitCode {
    // Cargo adds options of its own.
    let arguments = std::env::args().skip(1);
    let named: Vec<String> = arguments.filter(|one| !one.starts_with("--")).collect();
    let known = BENCHES.map(|(name, _)| name);
    if let Some(unknown) = named.iter().find(|name| !known.contains(&name.as_str())) {
        eprintln!("there is no benchmark {unknown:?} here, but {known:?}");
        return ExitCode::from(2);
    }
    for (name, run) in BENCHES {
        if named.is_empty() || named.iter().any(|one| one == name) {
            run();
        }
    }
    ExitCode::SUCCESS
}
