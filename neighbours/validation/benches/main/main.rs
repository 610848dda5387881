//! How long a diagnosis takes: `cargo bench -p probecell_validation --bench main -- touches` runs that one, without a name both are
//! run.
//!
//! - `drive`: a diagnosis of one drive against the time that its record took
//! - `touches`: a diagnosis against the number of touches and of effects; `touches 10000` makes only the lines of so many touches

#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a table for a person; a failure ends it"
)]

use std::process::ExitCode;

mod drive;
#[path = "../../tests/main/drive_plant/mod.rs"]
mod drive_plant;
#[path = "../../../../crates/diagnosis/tests/main/layouts/mod.rs"]
mod layouts;
mod touches;

fn main() -> ExitCode {
    // Cargo adds options of its own.
    let arguments = std::env::args().skip(1);
    let (numbers, named): (Vec<String>, Vec<String>) = arguments
        .filter(|one| !one.starts_with("--"))
        .partition(|one| one.parse::<usize>().is_ok());
    if let Some(unknown) = named
        .iter()
        .find(|name| !["drive", "touches"].contains(&name.as_str()))
    {
        eprintln!("there is no benchmark {unknown:?} here, but drive and touches");
        return ExitCode::from(2);
    }
    let wanted: Vec<usize> = numbers.iter().filter_map(|one| one.parse().ok()).collect();
    let runs = |name: &str| named.iter().any(|one| one == name);
    // A number alone is one of touches.
    if runs("drive") || named.is_empty() && wanted.is_empty() {
        drive::run();
    }
    if runs("touches") || named.is_empty() {
        touches::run(&wanted);
    }
    ExitCode::SUCCESS
}
