//! Time of a diagnosis of one drive, 25 s at 1 kHz, against the time the record itself took.

use std::time::Instant;

use diagnosis::{Options, diagnose_together_with_residuals};

use crate::drive_plant::{Content, drive_session};

pub(crate) fn run() {
    println!("| session | samples | s | share of the record |");
    println!("|---|---|---|---|");
    let long = (0..200)
        .map(|seed| drive_session(seed, Content::Effort(2)).0)
        .filter(|session| session.joint_states.len() > 20_000);
    for session in long.take(5) {
        let begun = Instant::now();
        let report = diagnose_together_with_residuals(
            std::slice::from_ref(&session),
            &[],
            &Options::default(),
        );
        let took = begun.elapsed().as_secs_f64();
        let share = took / 25.0;
        let samples = session.joint_states.len();
        match report {
            Ok(_) => println!("| {} | {samples} | {took:.3} | {share:.4} |", session.name),
            Err(error) => println!("| {} | {error} | | |", session.name),
        }
    }
}
