//! The shortest list of faults that still fails.

use crate::{Cells, Fault, Invariant, run};

/// Drops faults from the list of a seed, in halves and then one by one, while the same invariant still does not hold.
pub fn shortened(cells: &Cells, seed: u64, invariant: Invariant) -> Vec<Fault> {
    let fails = |faults: &[Fault]| {
        let outcome = run(cells.of(seed), seed, faults, None);
        outcome
            .violation
            .is_some_and(|found| found.invariant == invariant)
    };
    let mut faults = cells.faults(seed);
    let mut size = faults.len().div_ceil(2);
    while size > 0 {
        let mut begin = 0;
        while begin < faults.len() {
            let mut fewer = faults.clone();
            fewer.drain(begin..(begin + size).min(faults.len()));
            if fails(&fewer) {
                faults = fewer;
            } else {
                begin += size;
            }
        }
        size /= 2;
    }
    faults
}
